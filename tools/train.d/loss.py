"""The loss of DVAO (eq. (3)) and its errors: 1 - SSIM + 5 MSE, in f32.

SSIM is that of the authors' program: a Gaussian of sigma 1.5 cut at 11 voxels, the 5 outermost voxels dropped, constants 0.01^2 and
0.03^2, structures that oppose each other taken for 0. SSIM-2D is of every slice along z, SSIM-3D of the volume.
"""

import functools

import torch

WINDOW, SIGMA = 11, 1.5
C1, C2 = 0.01**2, 0.03**2
ALPHA = 5.0


@functools.cache
def blur(edge, device):
    """A matrix [edge, edge - 10] that takes the mean within the window: a product with it is many times faster than a convolution."""
    at = torch.arange(WINDOW, dtype=torch.float32) - WINDOW // 2
    weights = torch.exp(-(at**2) / (2 * SIGMA**2))
    weights /= weights.sum()
    columns = edge - WINDOW + 1
    matrix = torch.zeros(edge, columns)
    for column in range(columns):
        matrix[column : column + WINDOW, column] = weights
    return matrix.to(device)


def blurred(x, axes):
    for axis in axes:
        x = torch.movedim(torch.movedim(x, axis, -1) @ blur(x.shape[axis], x.device), -1, axis)
    return x


def ssim(found, truth, axes):
    """Mean structural similarity of [batch, 1, z, y, x] over windows that spread along `axes`."""
    found, truth = found.float(), truth.float()
    stack = torch.cat([found, truth, found * found, truth * truth, found * truth], 1)
    f, t, ff, tt, ft = blurred(stack, axes).unbind(1)
    variances = ff - f * f + tt - t * t
    contrast = torch.relu((2 * (ft - f * t) + C2) / (variances + C2))
    return (contrast * (2 * f * t + C1) / (f * f + t * t + C1)).mean()


def ssim2(found, truth):
    return ssim(found, truth, (-1, -2))


def ssim3(found, truth):
    return ssim(found, truth, (-1, -2, -3))


def mse(found, truth):
    return (found.float() - truth.float()).square().mean()


def loss(name, found, truth):
    """mse, ssim2, ssim3, or one of the latter two + mse."""
    sum = 0.0
    if name.startswith("ssim2"):
        sum = 1.0 - ssim2(found, truth)
    if name.startswith("ssim3"):
        sum = 1.0 - ssim3(found, truth)
    if name.endswith("mse"):
        sum = sum + (ALPHA if "+" in name else 1.0) * mse(found, truth)
    return sum
