"""Noise of a Kinect v1: what it does to depth and colour."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray
from emd_core.pinhole_camera import PinholeCamera

DepthImage = NDArray[np.float32]
ColourImage = NDArray[np.uint8]

# Normal deviates by looking random 16-bit numbers up among the quantiles: much faster than exact
# ones, and exact to 1e-4 of a standard deviation, cut off at 4.3 of them. Four of them are the 64
# random bits of a pixel.
_QUANTILES = ndtri((np.arange(65536) + 0.5) / 65536).astype(np.float32)


@dataclass(frozen=True)
class KinectNoiseConfig:
    """Constants of the noise model.

    Attributes:
        axial_floor: Standard deviation of the depth at `axial_distance`, metres.
        axial_growth: Its growth with the square of the distance beyond that, 1/m (Nguyen, Izadi
            and Lovell, 3DIMPVT 2012).
        axial_distance: Distance of least noise, metres.
        lateral_jitter: Standard deviation of the place where a pixel measures, pixels (same
            source).
        disparity_step: The sensor measures disparity in steps of this, pixels (Khoshelham and Oude
            Elberink, Sensors 2012).
        infrared_focal_length: Of the camera that measures disparity, pixels.
        baseline: From projector to that camera, metres.
        grazing_angle: Half of the pixels that see a surface at this angle between ray and normal
            have no depth, radians.
        grazing_softness: Width of the change from all to none, radians.
        dropout_rate: Share of pixels without depth anywhere.
        nearest: Nothing nearer is measured, metres.
        farthest: Nothing farther is measured, metres.
        colour_sigma: Standard deviation of the colour channels, levels of 255.
    """

    axial_floor: float = 0.0012
    axial_growth: float = 0.0019
    axial_distance: float = 0.4
    lateral_jitter: float = 0.8
    disparity_step: float = 0.125
    infrared_focal_length: float = 580.0
    baseline: float = 0.075
    grazing_angle: float = math.radians(80.0)
    grazing_softness: float = math.radians(2.0)
    dropout_rate: float = 0.002
    nearest: float = 0.4
    farthest: float = 4.0
    colour_sigma: float = 2.5

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a value is negative, a length or step zero, the rate above 1 or
                the range empty.
        """
        values = np.array([getattr(self, name) for name in self.__dataclass_fields__])
        if not np.isfinite(values).all() or (values < 0).any():
            raise InvalidInputError(f"noise constants must be finite and >= 0, got {self}")
        positive = (self.infrared_focal_length, self.baseline, self.grazing_softness)
        if min(*positive, self.disparity_step) <= 0:
            raise InvalidInputError(f"lengths and steps must be positive, got {self}")
        if self.dropout_rate > 1 or self.nearest >= self.farthest:
            raise InvalidInputError(
                f"a rate up to 1 and nearest < farthest are wanted, got {self.dropout_rate}, "
                f"{self.nearest} and {self.farthest}"
            )

    def axial_sigma(self, depth: float) -> float:
        """Standard deviation of a depth before it is quantised, metres."""
        beyond = max(depth - self.axial_distance, 0.0)
        return self.axial_floor + self.axial_growth * beyond**2

    def depth_step(self, depth: float) -> float:
        """Distance of neighbouring depths that the sensor can tell, metres."""
        return self.disparity_step * depth**2 / (self.infrared_focal_length * self.baseline)


class KinectNoise:
    """Adds noise to rendered pictures; the same generator state gives the same noise."""

    def __init__(self, rng: np.random.Generator, config: KinectNoiseConfig | None = None) -> None:
        """Take the source of randomness and the constants of the model."""
        self._rng = rng
        self.config = config or KinectNoiseConfig()

    def depth(self, depth: DepthImage, camera: PinholeCamera) -> DepthImage:
        """Measure a depth image as the sensor would.

        Args:
            depth: Metres, shape (H, W), NaN where nothing is.
            camera: Its intrinsics.

        Returns:
            Metres, shape (H, W), float32, NaN where the sensor has no answer.
        """
        if depth.shape != (camera.height, camera.width):
            raise InvalidInputError(
                f"a depth image of shape {(camera.height, camera.width)} is wanted, "
                f"got {depth.shape}"
            )
        config = self.config
        constants = np.array(
            [
                config.axial_floor,
                config.axial_growth,
                config.axial_distance,
                config.lateral_jitter,
                config.infrared_focal_length * config.baseline / config.disparity_step,
                config.grazing_angle,
                config.grazing_softness,
                config.dropout_rate,
                config.nearest,
                config.farthest,
            ]
        )
        intrinsics = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
        measured = np.empty_like(depth, dtype=np.float32)
        bits = self._bits(depth.shape)
        _measure(np.ascontiguousarray(depth), intrinsics, constants, _QUANTILES, bits, measured)
        return measured

    def colour(self, colour: ColourImage) -> ColourImage:
        """Add noise to a colour image, shape (H, W, 3), uint8."""
        levels = np.rint(_QUANTILES * self.config.colour_sigma).astype(np.int16)
        noisy = np.empty_like(colour)
        _add_levels(np.ascontiguousarray(colour), levels, self._bits(colour.shape[:2]), noisy)
        return noisy

    def _bits(self, shape: tuple[int, ...]) -> NDArray[np.uint64]:
        return self._rng.integers(0, 2**64, shape, dtype=np.uint64)


@numba.njit(cache=True, error_model="numpy", inline="always")
def _quarter(bits: np.uint64, place: int) -> np.uintp:
    """Give the 16 bits at one of four places."""
    return np.uintp(bits >> np.uint64(16 * place)) & np.uintp(65535)


@numba.njit(cache=True, error_model="numpy", nogil=True)
def _add_levels(
    colour: ColourImage, levels: NDArray[np.int16], bits: NDArray[np.uint64], noisy: ColourImage
) -> None:
    """Add a level, drawn by the pixel's bits, to each channel."""
    for row in range(colour.shape[0]):
        for column in range(colour.shape[1]):
            for channel in range(3):
                level = levels[_quarter(bits[row, column], channel)]
                bright = np.int16(colour[row, column, channel]) + level
                noisy[row, column, channel] = np.uint8(min(max(bright, 0), 255))


@numba.njit(cache=True, error_model="numpy", nogil=True)
def _measure(
    depth: DepthImage,
    intrinsics: FloatArray,
    constants: FloatArray,
    quantiles: NDArray[np.float32],
    bits: NDArray[np.uint64],
    measured: DepthImage,
) -> None:
    """Measure every pixel: jitter, axial noise, quantisation of the disparity, drop-outs."""
    # Where the angle is too small to lose a pixel (less than one in 10^8).
    certain = _seen_steeply(depth, intrinsics, np.cos(max(constants[5] - 5.0 * constants[6], 0.0)))
    floor, growth, best, jitter, steps = constants[:5]
    grazing, softness, rate, nearest, farthest = constants[5:]
    # Scalars: the compiler cannot know that `measured` does not overlap the array.
    inverse_fx, inverse_fy = 1.0 / intrinsics[0], 1.0 / intrinsics[1]
    cx, cy = intrinsics[2], intrinsics[3]
    height, width = depth.shape
    for row in range(height):
        for column in range(width):
            drawn = bits[row, column]
            i = int(np.rint(row + jitter * quantiles[_quarter(drawn, 0)]))
            j = int(np.rint(column + jitter * quantiles[_quarter(drawn, 1)]))
            i, j = min(max(i, 0), height - 1), min(max(j, 0), width - 1)
            z = float(depth[i, j])
            lost = rate
            if not certain[i, j]:
                along, both = _incidence(depth, i, j, inverse_fx, inverse_fy, cx, cy)
                # At gaps both are NaN, and the cosine counts as 0.
                cosine = along / np.sqrt(both) if both > 0.0 else 0.0
                off = (grazing - np.arccos(cosine)) / (0.25 * softness)
                lost += 1.0 / (1.0 + np.exp(off))
            measured[row, column] = np.nan
            # A comparison with NaN is false, so that missing depth stays missing.
            if z > 0.0 and (_quarter(drawn, 3) + 0.5) / 65536.0 >= lost:
                beyond = max(z - best, 0.0)
                z += (floor + growth * beyond * beyond) * quantiles[_quarter(drawn, 2)]
                z = steps / np.rint(steps / max(z, 1e-3))
                if nearest <= z <= farthest:
                    measured[row, column] = z


@numba.njit(cache=True, error_model="numpy", nogil=True)
def _seen_steeply(depth: DepthImage, intrinsics: FloatArray, cosine: float) -> NDArray[np.bool_]:
    """Mark pixels whose ray meets what it sees at an angle of at least this cosine, (H, W).

    Without roots and branches, so that many pixels are done at a time; the picture's border, where
    slopes have one neighbour, is not marked.
    """
    steep = np.zeros(depth.shape, dtype=np.bool_)
    inverse_fx, inverse_fy = 1.0 / intrinsics[0], 1.0 / intrinsics[1]
    cx, cy = intrinsics[2], intrinsics[3]
    least = cosine * cosine
    for row in range(1, depth.shape[0] - 1):
        above, here, below = depth[row - 1], depth[row], depth[row + 1]
        y = (row - cy) * inverse_fy
        for column in range(1, depth.shape[1] - 1):
            z = np.float64(here[column])
            zu = (np.float64(here[column + 1]) - np.float64(here[column - 1])) * 0.5
            zv = (np.float64(below[column]) - np.float64(above[column])) * 0.5
            x = (column - cx) * inverse_fx
            along, both = _ray_and_normal(z, zu, zv, x, y, inverse_fx, inverse_fy)
            steep[row, column] = along * along >= least * both
    return steep


@numba.njit(cache=True, error_model="numpy", inline="always")
def _incidence(
    depth: DepthImage,
    row: int,
    column: int,
    inverse_fx: float,
    inverse_fy: float,
    cx: float,
    cy: float,
) -> tuple[float, float]:
    """Tell how obliquely a pixel's ray meets what it sees.

    Returns:
        Scalar product of the ray and the surface's normal, not negative, and the product of their
        squared lengths; NaN at gaps.
    """
    height, width = depth.shape
    up, down = max(row - 1, 0), min(row + 1, height - 1)
    left, right = max(column - 1, 0), min(column + 1, width - 1)
    z = float(depth[row, column])
    zu = (float(depth[row, right]) - float(depth[row, left])) * (0.5 if right - left == 2 else 1.0)
    zv = (float(depth[down, column]) - float(depth[up, column])) * (0.5 if down - up == 2 else 1.0)
    x, y = (column - cx) * inverse_fx, (row - cy) * inverse_fy
    along, both = _ray_and_normal(z, zu, zv, x, y, inverse_fx, inverse_fy)
    return abs(along), both


@numba.njit(cache=True, error_model="numpy", inline="always")
def _ray_and_normal(
    z: float, zu: float, zv: float, x: float, y: float, inverse_fx: float, inverse_fy: float
) -> tuple[float, float]:
    """Scalar product of a pixel's ray (x, y, 1) and the surface's normal, and squared lengths'.

    The normal is dP/du x dP/dv of the point P = z (x, y, 1), up to a factor z, where the depth z
    grows by zu and zv from column to column and from row to row.
    """
    nx, ny = -zu * inverse_fy, -zv * inverse_fx
    nz = z * inverse_fx * inverse_fy + x * zu * inverse_fy + y * zv * inverse_fx
    return nx * x + ny * y + nz, (nx * nx + ny * ny + nz * nz) * (x * x + y * y + 1.0)
