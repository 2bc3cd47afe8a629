"""Robust fits of what changes smoothly across the picture: the table's colour and its height."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FloatArray

TERMS = 6  # of a trend
_CONCENTRATION_STEPS = 6
_CONCENTRATED_SHARE = 0.6
# The covariance of a three-dimensional normal sample against that of its nearest 60 %.
_CONSISTENCY = 2.0
_COLOUR_RIDGE = 0.02
_HEIGHT_ROUNDS = 4  # of fitting the bare table's height and leaving out what lies off it
_HEIGHT_RIDGE = 1e-3
_NORMAL = 1.4826  # standard deviation of a normal sample by its median absolute deviation


@numba.njit(cache=True, nogil=True, error_model="numpy")
def fit_colours(
    colours: FloatArray, basis: FloatArray, floor: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Fit colours by a trend (ridge regression, the constant term free) and a normal spread.

    Concentration steps, as in the minimum covariance determinant estimator (Rousseeuw and Van
    Driessen 1999), leave out the colours that are none of the table's.

    Args:
        colours: Shape (N, 3).
        basis: `trend_basis` at the same pixels, shape (N, 6).
        floor: Least spread of each channel, shape (3,).

    Returns:
        Coefficients of the trend, shape (6, 3), and the covariance about it, shape (3, 3), in no
        direction narrower than the floor.
    """
    count = len(colours)
    kept_count = int(_CONCENTRATED_SHARE * count)
    trend = np.zeros((TERMS, 3))
    for channel in range(3):
        trend[0, channel] = np.median(colours[:, channel].copy())
    covariance = np.diag(floor**2)
    squared = np.empty(count)
    for _ in range(_CONCENTRATION_STEPS):
        precision = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
        _square_distances(colours, basis, trend, precision, squared)
        limit = np.partition(squared, kept_count)[kept_count]
        trend, covariance = _fit_within(colours, basis, squared, limit, floor)
    return trend, covariance


@numba.njit(cache=True, nogil=True, error_model="numpy")
def fit_heights(
    heights: FloatArray, basis: FloatArray, floor: float, near: float, least: int
) -> tuple[FloatArray, float]:
    """Fit heights by a trend, again and again without what lies off it.

    Args:
        heights: Shape (N,), metres.
        basis: `trend_basis` at the same pixels, shape (N, 6).
        floor: Least spread that is assumed, metres.
        near: Spread that is assumed at the start, metres.
        least: Heights that a fit needs.

    Returns:
        Coefficients of the trend, shape (6,), and the spread about it, metres.
    """
    trend, spread = np.zeros(TERMS), near
    left = np.empty(len(heights))
    for _ in range(_HEIGHT_ROUNDS):
        normal, wanted, count = np.zeros((TERMS, TERMS)), np.zeros(TERMS), 0
        kept = np.empty(len(heights), dtype=np.int64)
        for sample in range(len(heights)):
            if abs(heights[sample] - _level(basis[sample], trend)) < 3.0 * spread:
                kept[count] = sample
                count += 1
                _add_products(basis[sample], normal)
                for term in range(TERMS):
                    wanted[term] += basis[sample, term] * heights[sample]
        if count < least:
            break
        for term in range(1, TERMS):
            normal[term, term] += _HEIGHT_RIDGE * count
        trend = np.asarray(np.linalg.solve(normal, wanted), dtype=np.float64)
        for index in range(count):
            left[index] = heights[kept[index]] - _level(basis[kept[index]], trend)
        middle = np.median(left[:count])
        spread = max(floor, _NORMAL * np.median(np.abs(left[:count] - middle)))
    return trend, spread


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _fit_within(
    colours: FloatArray,
    basis: FloatArray,
    squared: FloatArray,
    limit: float,
    floor: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Fit trend and spread to the colours whose squared distance is at most a limit."""
    normal, wanted = np.zeros((TERMS, TERMS)), np.zeros((TERMS, 3))
    total, products, count = np.zeros(3), np.zeros((3, 3)), 0
    for sample in range(len(colours)):
        if squared[sample] <= limit:
            count += 1
            _add_products(basis[sample], normal)
            _add_products(colours[sample], products)
            for channel in range(3):
                total[channel] += colours[sample, channel]
                for term in range(TERMS):
                    wanted[term, channel] += basis[sample, term] * colours[sample, channel]
    ridged = normal.copy()
    for term in range(1, TERMS):
        ridged[term, term] += _COLOUR_RIDGE * count
    trend = np.asarray(np.linalg.solve(ridged, wanted), dtype=np.float64)
    # Sums of the residuals c - B t and of their products, from those of c and B.
    shared = trend.T @ wanted
    left = total - normal[0] @ trend
    scatter = products - shared - shared.T + trend.T @ (normal @ trend)
    scatter -= left.reshape(3, 1) * left / count
    return trend, _widened(_CONSISTENCY / (count - 1) * scatter, floor)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _widened(covariance: FloatArray, floor: FloatArray) -> FloatArray:
    """Widen a covariance so that in no direction it is narrower than the floor."""
    scale = floor.reshape(3, 1) * floor
    values, vectors = np.linalg.eigh(covariance / scale)
    return (vectors * np.maximum(values, 1.0)) @ vectors.T * scale


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _square_distances(
    colours: FloatArray,
    basis: FloatArray,
    trend: FloatArray,
    precision: FloatArray,
    squared: FloatArray,
) -> None:
    """Fill in each colour's squared Mahalanobis distance from the trend."""
    left = np.empty(3)
    for sample in range(len(colours)):
        for channel in range(3):
            left[channel] = colours[sample, channel]
            for term in range(TERMS):
                left[channel] -= basis[sample, term] * trend[term, channel]
        squared[sample] = 0.0
        for channel in range(3):
            for other in range(3):
                squared[sample] += left[channel] * precision[channel, other] * left[other]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _level(basis: FloatArray, trend: FloatArray) -> float:
    total = 0.0
    for term in range(TERMS):
        total += basis[term] * trend[term]
    return total


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _add_products(values: NDArray[np.float64], total: FloatArray) -> None:
    """Add the products of all pairs of values (K,) to a matrix (K, K)."""
    for row in range(len(values)):
        for column in range(len(values)):
            total[row, column] += values[row] * values[column]
