"""Images of a sensor whose pixels each see one colour, as many camera drivers give them."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from emd_core.errors import InvalidInputError

# ROS names the four upper left pixels row by row (sensor_msgs/image_encodings.hpp), as these do.
_CODES = {
    "rggb": cv2.COLOR_BayerRGGB2RGB,
    "bggr": cv2.COLOR_BayerBGGR2RGB,
    "gbrg": cv2.COLOR_BayerGBRG2RGB,
    "grbg": cv2.COLOR_BayerGRBG2RGB,
}
_LEAST_SIDE = 3  # pixels; smaller images do not have all neighbours


def rgb_from_bayer(image: NDArray[Any], encoding: str) -> NDArray[np.uint8]:
    """Interpolate the colours that each pixel does not see (OpenCV, bilinear).

    Args:
        image: Shape (H, W), uint8, or uint16 of which 65535 is white; cameras of 10 or 12 bits
            must fill the upper ones, else the picture is dark.
        encoding: ROS's name: bayer_rggb8, bayer_bggr8, bayer_gbrg8, bayer_grbg8, or the same with
            16.

    Returns:
        Shape (H, W, 3), RGB.

    Raises:
        InvalidInputError: If a side is shorter than 3 pixels.
    """
    if min(image.shape) < _LEAST_SIDE:
        raise InvalidInputError(
            f"an image of encoding {encoding} needs at least {_LEAST_SIDE} x {_LEAST_SIDE} "
            f"pixels, got {image.shape[1]} x {image.shape[0]}; is the camera's region cut off?"
        )
    colour = np.asarray(cv2.cvtColor(image, _CODES[encoding[6:10]]))
    if colour.dtype == np.uint16:
        colour = (colour.astype(np.uint32) + 128) // 257  # 65535 becomes 255
    return colour.astype(np.uint8, copy=False)
