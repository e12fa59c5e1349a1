"""Writes tests/data/network: small nets with random weights, an input of each, and what PyTorch makes of it, layer by layer.

Run by hand where the network changes, by a Python that has PyTorch and NumPy; CI only reads what this writes:

    python tools/train.d/reference.py

NAME.net is the net, NAME.f32 little-endian f32, x fastest: the input, what each layer gives before Mish in the order of the layers,
and the output. Weights are those of the file, rounded to f16; everything else is f32 on the processor. Inputs are numbers of f16.
"""

from pathlib import Path

import torch
from torch.nn import functional as F

import network

TARGET = Path(__file__).resolve().parents[2] / "tests" / "data" / "network"

# Name, shape, voxels along x, y, z. Their table is in tests/support/networks.rs too.
NETS = [
    # Several workgroups along each axis.
    ("cube", network.Shape(edge=16, filters=4, cap=8, levels=2, label="mean"), (16, 16, 16)),
    # Down to a single voxel, where nothing is normalised.
    ("deep", network.Shape(edge=8, filters=8, cap=16, levels=3, label="end"), (8, 8, 8)),
    # Channels that are no multiples of 8, edges of which none is like another.
    ("slab", network.Shape(edge=8, filters=12, cap=20, levels=1, label="mean"), (12, 6, 10)),
]


def smooth(dims, random):
    """Blobs, empty between them and full inside."""
    coarse = torch.rand(1, 1, *(max(2, d // 3) for d in reversed(dims)), generator=random)
    fine = F.interpolate(coarse, size=tuple(reversed(dims)), mode="trilinear", align_corners=True)
    return ((fine - 0.35) * 2.5).clamp(0, 1).half().float()


def record(net, grid):
    """What each layer gives, by name, and the output."""
    given = {}
    conv = net.conv

    def recorded(name, x):
        given[name] = conv(name, x)
        return given[name]

    net.conv = recorded
    with torch.no_grad():
        output = net(grid)
    return given, output


def main():
    TARGET.mkdir(parents=True, exist_ok=True)
    for seed, (name, shape, dims) in enumerate(NETS):
        random = torch.Generator().manual_seed(seed)
        net = network.Net(shape)
        with torch.no_grad():
            for layer, inputs, *_ in shape.layers():
                weight = net.weight(layer)
                # So that what is normalised stays near 1 and reaches the bends of Mish and of the sigmoid.
                weight.copy_(torch.randn(weight.shape, generator=random) * (1 / (27 * inputs)) ** 0.5)
        network.write(TARGET / f"{name}.net", net, {"name": name, "seed": seed, "weights": "random, for tests"})
        net, _ = network.read(TARGET / f"{name}.net")
        grid = smooth(dims, random)
        given, output = record(net, grid)
        names = [layer for layer, *_ in shape.layers()]
        values = torch.cat([grid.flatten(), *(given[layer].flatten() for layer in names), output.flatten()])
        values.numpy().astype("<f4").tofile(TARGET / f"{name}.f32")
        spread = ", ".join(f"{layer} {given[layer].std():.2f}" for layer in names)
        print(f"{name}: {sum(net.weight(layer).numel() for layer in names)} weights, {len(values)} values")
        print(f"  output {output.min():.3f} to {output.max():.3f}; deviation of {spread}")


if __name__ == "__main__":
    main()
