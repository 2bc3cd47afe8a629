"""The path on which hands without a robot carry cloth: an arc that the cloth's length allows.

A hand that folds cloth about a crease must stay within half the folded length of it, or it drags
the layer below: (x - x_crease)^2 + h^2 <= (d / 2)^2 for a displacement d about a crease half-way.
With the height h = H sin(pi s) over the progress s, H <= d / 2 keeps within that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from emd_cloth_sim.config import HandPathConfig
from emd_core.frames import FloatArray


@dataclass(frozen=True)
class HandPath:
    """Positions of one hand over time.

    Attributes:
        start_in_table: Where it grasps, shape (3,), metres.
        end_in_table: Where it releases, shape (3,), metres.
        rise: Highest rise over the straight line, metres.
        duration: Seconds.
    """

    start_in_table: FloatArray
    end_in_table: FloatArray
    rise: float
    duration: float

    def position_in_table(self, time: float) -> FloatArray:
        """Position at `time` seconds after the grasp, shape (3,), metres."""
        share = min(max(time / self.duration, 0.0), 1.0)
        progress = 0.5 * (1.0 - math.cos(math.pi * share))
        position = self.start_in_table + progress * (self.end_in_table - self.start_in_table)
        position[2] += self.rise * math.sin(math.pi * progress)
        return position


def arc_path(
    start_in_table: FloatArray,
    displacement_in_table: FloatArray,
    end_height: float,
    config: HandPathConfig,
) -> HandPath:
    """Plan the arc from a grasp (3,) by a displacement (2,) to an end height; all metres."""
    distance = float(np.hypot(*displacement_in_table))
    end = np.array([*(start_in_table[:2] + displacement_in_table), end_height])
    rise = min(config.lift_height, config.rise_ratio * distance)
    length = math.hypot(distance, 2.0 * rise)
    duration = max(config.min_duration, 0.5 * math.pi * length / config.hand_speed)
    return HandPath(np.array(start_in_table, dtype=np.float64), end, rise, duration)
