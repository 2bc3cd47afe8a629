"""How a lens bends what a pinhole camera would see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from emd_core.errors import InvalidInputError

# Names and counts of coefficients of sensor_msgs/CameraInfo and of OpenCV, which ROS takes over.
MODELS = {"plumb_bob": (4, 5), "rational_polynomial": (8, 12, 14), "equidistant": (4,)}


@dataclass(frozen=True)
class LensDistortion:
    """A distortion model and its coefficients.

    Attributes:
        model: plumb_bob (k1 k2 p1 p2 k3), rational_polynomial (k1 k2 p1 p2 k3 .. k6 and more) or
            equidistant (a fisheye's k1 .. k4).
        coefficients: In OpenCV's order; none: no distortion.
    """

    model: str = "plumb_bob"
    coefficients: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Check model and coefficients.

        Raises:
            InvalidInputError: If the model is unknown, their count does not fit it or a
                coefficient is not finite.
        """
        if not self.coefficients:
            return
        if self.model not in MODELS:
            raise InvalidInputError(
                f"a distortion model out of {', '.join(MODELS)} is needed, got '{self.model}'; "
                "calibrate with one of them, or publish rectified images"
            )
        if len(self.coefficients) not in MODELS[self.model]:
            wanted = " or ".join(str(count) for count in MODELS[self.model])
            raise InvalidInputError(
                f"{self.model} needs {wanted} coefficients, got {len(self.coefficients)}"
            )
        if not np.isfinite(self.coefficients).all():
            raise InvalidInputError(
                f"distortion coefficients must be finite, got {self.coefficients}"
            )

    @property
    def is_none(self) -> bool:
        """Whether the lens bends nothing."""
        return not any(self.coefficients)
