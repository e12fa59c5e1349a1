"""Checks what trains against PyTorch's own operations and known answers; each check is also shown something wrong, and has to see it."""

import pathlib
import tempfile

import active
import torch
from data import SYMMETRIES
from loss import ssim2, ssim3
from network import Net, Shape, read, write
from torch.nn import functional as F

# f32 with sums over some thousand voxels; and weights rounded to f16.
ROUNDING, HALF = 2e-5, 5e-3


def check(what, off, tolerance, wrong):
    """`off` is to be below the tolerance, `wrong`, of a planted fault, well above it."""
    good, seen = off < tolerance, wrong > 10 * tolerance
    print(f"{'ok' if good and seen else 'WRONG'}  {what}: {float(off):.1e}; with a fault {float(wrong):.1e}")
    if not (good and seen):
        raise SystemExit(1)


def literal(net, grid, order="mish first"):
    """The network as docs and paper have it, operation by operation, all channels first."""

    def block(name, x):
        norm = (lambda x: F.instance_norm(x, eps=active.EPSILON)) if net.normalised[name] else (lambda x: x)
        x = norm(F.mish(x)) if order == "mish first" else F.mish(norm(x))
        return F.conv3d(x.contiguous(), net.weight(name), padding=1)

    x = F.conv3d(grid, net.weight("first"), padding=1)
    skips = [x]
    for i in range(net.shape.levels):
        x = F.interpolate(x, scale_factor=0.5, mode="nearest")
        x = block(f"encoder.{i}.1", block(f"encoder.{i}.0", x))
        skips.append(x)
    x = torch.cat([block("middle", x), skips.pop()], 1)
    for i in range(net.shape.levels):
        x = block(f"decoder.{i}.1", block(f"decoder.{i}.0", F.interpolate(x, scale_factor=2, mode="nearest")))
        x = torch.cat([x, skips.pop()], 1)
    return torch.sigmoid(block("last", x))


def apart(a, b):
    return (a - b).abs().max()


def gradients():
    x = torch.randn(1, 5, 6, 7, 8).contiguous(memory_format=torch.channels_last_3d).requires_grad_()
    towards = torch.randn_like(x)
    (found,) = torch.autograd.grad(active.Active.apply(x), x, towards)
    m = F.mish(x)
    variance, mean = torch.var_mean(m, dim=(2, 3, 4), keepdim=True, correction=0)
    (expected,) = torch.autograd.grad((m - mean) * torch.rsqrt(variance + active.EPSILON), x, towards)
    (without,) = torch.autograd.grad(F.mish(x), x, towards)
    check("gradient of Mish and normalisation", apart(found, expected), ROUNDING, apart(found, without))


def main():
    torch.manual_seed(1)
    known = active.forward(torch.tensor([[0.0], [1.0], [-1.0], [3.0]]))[0]
    mish = torch.tensor([[0.0], [0.8650984], [-0.3034013], [2.9865350]])
    normal = (mish - mish.mean()) * torch.rsqrt(mish.var(correction=0) + active.EPSILON)
    check("known values of Mish", apart(known, normal), ROUNDING, apart(known, mish))
    gradients()
    for shape, weights in ((Shape(), 1_688_904), (Shape(128, 16, 512, 7, "end"), 108_498_960)):
        counted = sum(27 * inputs * outputs for _, inputs, outputs, _ in shape.layers())
        check(f"weights of {shape.filters} filters", abs(counted - weights), 1, counted)
    net, grid = Net(Shape(16, 4, 8, 3)), torch.rand(1, 1, 16, 16, 16)
    with torch.no_grad():
        found = net(grid)
        check("whole network", apart(found, literal(net, grid)), ROUNDING, apart(found, literal(net, grid, "norm first")))
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "a.net"
            write(file, net, {"what": "check"})
            check("file", apart(found, read(file)[0](grid)), HALF, apart(found, Net(net.shape)(grid)))
            file.write_bytes(file.read_bytes()[:-40] + bytes(40))
            try:
                read(file)
                raise SystemExit("WRONG  a damaged file is read")
            except ValueError:
                print("ok  a damaged file is refused")
        latent, few = Net(net.shape, "latent"), torch.rand(1, 6, 2)
        found, turned, other = (latent(grid, points) for points in (few, few.flip(1), few.flip(2)))
        check("order of the points is nothing", apart(found, turned), ROUNDING, apart(found, other))
        count = lambda net: sum(weight.numel() for weight in net.parameters())
        more = count(Net(net.shape, "global")) - count(net)
        check("opacity beside every skip", abs(more - 27 * (8 + 8 + 8 + 1)), 1, more)
    check("SSIM of a volume with itself", abs(1 - ssim3(grid, grid)), ROUNDING, abs(1 - ssim3(grid, 1 - grid)))
    # A constant against another one: (2ab + c1) / (a^2 + b^2 + c1).
    a, b = torch.full_like(grid, 0.2), torch.full_like(grid, 0.6)
    expected = (2 * 0.12 + 1e-4) / (0.04 + 0.36 + 1e-4)
    check("SSIM of two constants", abs(ssim2(a, b) - expected), ROUNDING, abs(ssim2(a, a) - expected))
    check("48 symmetries", abs(len({str(s) for s in SYMMETRIES}) - 48), 1, 48)


if __name__ == "__main__":
    main()
