"""The two losses of the EMD net (paper, eq. 1 and 2)."""

from __future__ import annotations

from torch import Tensor


def state_loss(predicted: Tensor, actual: Tensor) -> Tensor:
    """loss_s: mean squared difference of voxels, one value per example (paper, eq. 1).

    Args:
        predicted: Real-valued prediction D(M(E(s0), m0)), shape (B, X, Y, Z).
        actual: Actual outcome s1, shape (B, X, Y, Z) or (X, Y, Z), same type.

    Returns:
        Shape (B,); the mean over voxels is the sum divided by `n_s`.
    """
    return (predicted - actual).square().flatten(1).mean(1)


def consistency_loss(predicted_code: Tensor, actual_code: Tensor) -> Tensor:
    """loss_c: mean squared difference of codes, one value per example (paper, eq. 2).

    The paper prints D(M(E(s0), m0)) - E(s1), which sets a decoded grid of 16384 voxels against a
    code of 512 values and divides by n_c = 512. Only the code M(E(s0), m0) fits E(s1), so that is
    what is compared.

    Args:
        predicted_code: M(E(s0), m0), shape (B, C).
        actual_code: E(s1), shape (B, C).

    Returns:
        Shape (B,).
    """
    return (predicted_code - actual_code).square().flatten(1).mean(1)
