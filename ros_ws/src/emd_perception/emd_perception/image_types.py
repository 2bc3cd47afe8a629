"""Names for the images that the core passes around."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

ColourImage = NDArray[np.uint8]  # (H, W, 3), RGB
DepthImage = NDArray[np.float32]  # (H, W), metres, NaN where unknown; also heights
FloatImage = NDArray[np.float32]  # (H, W)
LabImage = NDArray[np.float32]  # (H, W, 3), CIE L*a*b*: L* 0..100, a* and b* about +-100
Mask = NDArray[np.bool_]  # (H, W)
