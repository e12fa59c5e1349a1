"""The network of DVAO (section 3.2) as its authors programmed it, in PyTorch, and its weight files.

The shape, the order of layers and their names are those of src/model/network.rs. A layer is conv3(IN(Mish(x))): the first one is
of the grid itself, and of a single voxel there is no variance to normalise by. Tensors are [batch, channel, z, y, x].

Injections of the transfer function (section 3.4): `preclassified` is opacity alone; `global` also has the opacity, halved, beside
every skip; `latent` has values in place of opacity, and beside what goes into `middle` a descriptor of the transfer function's points
(section 3.3, Fig. 3a). Only preclassified nets are written to files, since only they are run elsewhere.
"""

import hashlib
import json
import struct
from dataclasses import asdict, dataclass

import numpy
import torch
from active import Active
from arguments import INJECTIONS, LABELS
from torch import nn
from torch.nn import functional as F

DESCRIPTOR = 64


@dataclass(frozen=True)
class Shape:
    """Of a net: cubes of edge^3 voxels, channels at level 0, most channels, halvings, what it gives."""

    edge: int = 64
    filters: int = 8
    cap: int = 64
    levels: int = 5
    label: str = "mean"

    def check(self):
        if self.label not in LABELS:
            raise ValueError(f"label {self.label!r}; expected one of {', '.join(LABELS)}")
        if min(self.levels, self.filters) < 1 or self.cap < self.filters:
            raise ValueError(f"levels {self.levels}, filters {self.filters}, cap {self.cap}; expected 1 <= filters <= cap, 1 <= levels")
        if self.edge < 1 << self.levels or self.edge % (1 << self.levels):
            raise ValueError(f"edge {self.edge}; expected a multiple of {1 << self.levels}")

    def channels(self, level):
        return min(self.filters << level, self.cap)

    def radius(self):
        """Length of the rays in voxels: 10 % of a cube's diagonal."""
        return 0.1 * 3**0.5 * self.edge

    def layers(self, injection="preclassified"):
        """Name, inputs, outputs, whether normalised."""
        c, last = self.channels, self.levels
        beside = 1 if injection == "global" else 0
        out = [("first", 1, c(0), False)]
        for i in range(last):
            normal = self.edge >> (i + 1) > 1
            out.append((f"encoder.{i}.0", c(i), c(i), normal))
            out.append((f"encoder.{i}.1", c(i), c(i + 1), normal))
        latent = DESCRIPTOR if injection == "latent" else 0
        out.append(("middle", c(last) + latent, c(last), self.edge >> last > 1))
        for i in range(last):
            level = last - i
            out.append((f"decoder.{i}.0", 2 * c(level) + beside, c(level), True))
            out.append((f"decoder.{i}.1", c(level), c(level - 1), True))
        out.append(("last", 2 * c(0) + beside, 1, True))
        return out


def halved(x):
    return x[..., ::2, ::2, ::2]


def doubled(x):
    return F.interpolate(x, scale_factor=2, mode="nearest")


class Extractor(nn.Module):
    """Points (value, opacity) to a descriptor: three layers shared by all points, then the largest of each feature (Fig. 3a)."""

    def __init__(self):
        super().__init__()
        self.layers = nn.ModuleList([nn.Linear(a, b) for a, b in ((2, 64), (64, 64), (64, DESCRIPTOR))])

    def forward(self, points):
        for i, layer in enumerate(self.layers):
            points = layer(F.mish(points) if i else points)
        return points.amax(dim=-2)


class Net(nn.Module):
    """What goes in: [batch, 1, edge, edge, edge] of opacity (of values: latent); points [batch, n, 2] for latent; opacity for global
    is what goes in. What comes out: the ambient factor, 0 to 1, in f32. `precision` is that of the convolutions' inputs and weights."""

    def __init__(self, shape, injection="preclassified", precision=torch.float32):
        super().__init__()
        shape.check()
        if injection not in INJECTIONS:
            raise ValueError(f"injection {injection!r}; expected one of {', '.join(INJECTIONS)}")
        self.shape, self.injection, self.precision = shape, injection, precision
        self.normalised = {}
        self.kernels = nn.ModuleDict()
        for name, inputs, outputs, norm in shape.layers(injection):
            self.normalised[name] = norm
            self.kernels[name.replace(".", "_")] = nn.Conv3d(inputs, outputs, 3, padding=1, bias=False)
        self.extractor = Extractor() if injection == "latent" else None

    def weight(self, name):
        return self.kernels[name.replace(".", "_")].weight

    def conv(self, name, x):
        x = x.to(self.precision).contiguous(memory_format=torch.channels_last_3d)
        return F.conv3d(x, self.weight(name).to(self.precision), padding=1)

    def active(self, name, x):
        return Active.apply(x) if self.normalised[name] else F.mish(x)

    def block(self, name, x):
        return self.conv(name, self.active(name, x))

    def forward(self, grid, points=None):
        levels = self.shape.levels
        beside = [grid] if self.injection == "global" else []
        opacity = grid
        x = self.conv("first", grid)
        skips = [[x, *beside]]
        for i in range(levels):
            x = self.block(f"encoder.{i}.0", halved(x))
            x = self.block(f"encoder.{i}.1", x)
            if beside:
                opacity = halved(opacity)
                beside = [opacity.to(x.dtype)]
            skips.append([x, *beside])
        x = self.active("middle", x)
        if self.extractor is not None:
            # Behind the normalisation: it makes 0 of what is the same everywhere.
            descriptor = F.mish(self.extractor(points))[:, :, None, None, None]
            x = torch.cat([x, descriptor.to(x.dtype).expand(-1, -1, *x.shape[2:])], 1)
        x = self.conv("middle", x)
        x = torch.cat([x, *skips.pop()], 1)
        for i in range(levels):
            name = f"decoder.{i}.0"
            # Doubling repeats every value, so that normalising before it is the same and an eighth of the work.
            x = self.conv(name, doubled(self.active(name, x).to(self.precision)))
            x = self.block(f"decoder.{i}.1", x)
            x = torch.cat([x, *skips.pop()], 1)
        return torch.sigmoid(self.block("last", x).float())


MAGIC = b"caonet\r\n"
VERSION = 1


def write(path, net, card):
    """Writes a preclassified net. `card` is free: data, seed, steps, errors. Returns the file's SHA-256."""
    if net.injection != "preclassified":
        raise ValueError(f"a net with injection {net.injection}: only preclassified ones have files")
    names = [name for name, *_ in net.shape.layers()]
    tensors = [net.weight(name).detach().cpu().to(torch.float16) for name in names]
    for name, tensor in zip(names, tensors):
        if not torch.isfinite(tensor).all():
            raise ValueError(f"{name} has weights that are no finite numbers in f16")
    listed = [{"name": name, "shape": list(tensor.shape)} for name, tensor in zip(names, tensors)]
    header = json.dumps(asdict(net.shape) | {"tensors": listed, "card": card}, ensure_ascii=False, separators=(",", ":")).encode()
    header += b" " * (-(16 + len(header)) % 16)
    data = MAGIC + struct.pack("<II", VERSION, len(header)) + header
    data += b"".join(tensor.contiguous().numpy().astype("<f2").tobytes() for tensor in tensors)
    digest = hashlib.sha256(data)
    with open(path, "wb") as file:
        file.write(data + digest.digest())
    return digest.hexdigest()


def read(path, precision=torch.float32):
    """The net of a file, and its card."""
    with open(path, "rb") as file:
        data = file.read()
    if data[:8] != MAGIC or struct.unpack("<I", data[8:12])[0] != VERSION:
        raise ValueError(f"{path}: no network file of version {VERSION}")
    if hashlib.sha256(data[:-32]).digest() != data[-32:]:
        raise ValueError(f"{path}: cut or changed: its SHA-256 does not fit")
    length = struct.unpack("<I", data[12:16])[0]
    header = json.loads(data[16 : 16 + length])
    card, tensors = header.pop("card"), header.pop("tensors")
    net = Net(Shape(**header), precision=precision)
    if tensors != [{"name": name, "shape": [outputs, inputs, 3, 3, 3]} for name, inputs, outputs, _ in net.shape.layers()]:
        raise ValueError(f"{path}: its tensors are not those of its shape")
    at = 16 + length
    with torch.no_grad():
        for tensor in tensors:
            weight = net.weight(tensor["name"])
            values = numpy.frombuffer(data, "<f2", weight.numel(), at)
            weight.copy_(torch.from_numpy(values.astype(numpy.float32)).reshape(weight.shape))
            at += 2 * weight.numel()
    if at != len(data) - 32:
        raise ValueError(f"{path}: {len(data) - 32 - at} bytes more than its tensors have")
    return net, card
