"""Mish and instance normalisation in one, with the gradient in closed form and channels last in memory: PyTorch's own two keep four
volumes in f32, and their gradients take a detour for that order (those of `instance_norm` are wrong in it, PyTorch 2.15).

    y = (m - mean) r,   m = Mish(x),   r = (variance + 1e-5)^(-1/2)
    dm = r (dy - mean(dy) - y mean(dy y)),   dx = dm Mish'(x)

With q = e^x (e^x + 2): Mish(x) = x q / (q + 2). All of it is in f32, whatever is kept.
"""

import torch

EPSILON = 1e-5
# Mish(x) = x above it, in f32.
LINEAR = 20.0


def forward(x):
    before = x.float()
    e = torch.exp(before.clamp(max=LINEAR))
    q = e * (e + 2)
    m = before * (q / (q + 2))
    mean = m.sum(0) / x.shape[0]
    m = m - mean
    scale = torch.rsqrt((m * m).sum(0) / x.shape[0] + EPSILON)
    return (m * scale).to(x.dtype), scale


def backward(gradient, x, y, scale):
    gradient, y, before = gradient.float(), y.float(), x.float()
    product, mean = (gradient * y).sum(0) / x.shape[0], gradient.sum(0) / x.shape[0]
    e = torch.exp(before.clamp(max=LINEAR))
    q = e * (e + 2)
    t = q / (q + 2)
    slope = t + before * (1 - t * t) * (e / (e + 1))
    return ((gradient - mean - y * product) * scale * slope).to(x.dtype)


PASSES = {"forward": forward, "backward": backward}


def fuse(device):
    """Compiles both passes, several times as fast where a compiler is; returns whether it is."""
    try:
        # A variant for each number of channels, precision and order in memory.
        torch._dynamo.config.recompile_limit = 64
        compiled = {name: torch.compile(pass_, dynamic=True) for name, pass_ in (("forward", forward), ("backward", backward))}
        x = torch.randn(4096, 8, device=device)
        for kind in (torch.float32, torch.bfloat16):
            y, scale = compiled["forward"](x.to(kind))
            compiled["backward"](y, x.to(kind), y, scale)
    except Exception as problem:  # Compilers fail in many ways, and none of them is a reason not to train.
        print(f"not compiled, slower: {type(problem).__name__}")
        return False
    PASSES.update(compiled)
    return True


class Active(torch.autograd.Function):
    """Of one volume, [1, channels, z, y, x]."""

    @staticmethod
    def forward(context, x):
        before = rows(x.detach())
        y, scale = PASSES["forward"](before)
        context.save_for_backward(before, y, scale)
        context.shape = x.shape
        return volume(y, x.shape)

    @staticmethod
    def backward(context, gradient):
        before, y, scale = context.saved_tensors
        return volume(PASSES["backward"](rows(gradient).to(y.dtype), before, y, scale), context.shape)


def rows(x):
    """[voxels, channels] of a volume with channels last; no copy where they are."""
    return x.permute(0, 2, 3, 4, 1).reshape(-1, x.shape[1])


def volume(x, shape):
    """The reverse."""
    batch, channels, *edges = shape
    return x.reshape(batch, *edges, channels).permute(0, 4, 1, 2, 3)
