"""Damped springs, stiffer or slack under compression: the membrane of the reference cloth.

The reference's sheet (Blender's cloth) is a lattice of springs along the sides and both diagonals
of every cell. Its diagonals only pull, and the rate of every spring's length is damped, so the
sheet behaves like a viscous film where it is pulled fast.
"""

from __future__ import annotations

import math
from typing import Any

from numba import njit
from numpy.typing import NDArray

from emd_cloth_sim.mesh import IndexArray
from emd_core.frames import FloatArray

Positions = NDArray[Any]  # in single or double precision


@njit(cache=True)
def hold_damped_lengths(
    position: Positions,
    previous: Positions,
    mobility: FloatArray,
    pairs: IndexArray,
    lengths: FloatArray,
    multipliers: FloatArray,
    stretch_compliance: float,
    squeeze_compliance: float,
    damping: float,
    limit: float,
    shortest: float,
) -> None:
    """Pull pairs to their rest lengths, against their lengths' rate of change.

    One sweep over damped XPBD constraints (Macklin et al., "XPBD", 2016, eq. 26).

    Args:
        position: Vertices (V, 3), metres; changed.
        previous: Vertices at the start of the substep.
        mobility: Inverse masses over that of a free vertex, (V,): 0 for those in a rigid grip.
        pairs: Vertices of each spring, (C, 2).
        lengths: Rest lengths (C,), metres.
        multipliers: What the sweeps of this substep have pulled so far, (C,), metres; changed.
        stretch_compliance: Of a spring longer than at rest; scaled, no unit.
        squeeze_compliance: Of a shorter one; negative: a shorter spring is slack.
        damping: Retardation time (damping over stiffness) over the substep; no unit.
        limit: Longest length, as a multiple of that at rest, up to which springs give way.
        shortest: Length up to which springs give way when they are squeezed, metres.
    """
    for c in range(pairs.shape[0]):
        a = pairs[c, 0]
        b = pairs[c, 1]
        x = position[b, 0] - position[a, 0]
        y = position[b, 1] - position[a, 1]
        z = position[b, 2] - position[a, 2]
        length = math.sqrt(x * x + y * y + z * z)
        one, other = mobility[a], mobility[b]
        if length < 1e-9 or one + other == 0.0:
            continue
        compliance = stretch_compliance
        if length < lengths[c]:
            if squeeze_compliance < 0.0:
                continue
            compliance = squeeze_compliance
        before = (
            x * (previous[b, 0] - previous[a, 0])
            + y * (previous[b, 1] - previous[a, 1])
            + z * (previous[b, 2] - previous[a, 2])
        ) / length
        error = length - lengths[c] + damping * (length - before) - compliance * multipliers[c]
        pull = error / ((one + other) * (1.0 + damping) + compliance)
        multipliers[c] += pull
        pull = max(pull, (length - limit * lengths[c]) / (one + other))
        pull = min(pull, (length - shortest) / (one + other)) / length
        position[a, 0] += one * pull * x
        position[a, 1] += one * pull * y
        position[a, 2] += one * pull * z
        position[b, 0] -= other * pull * x
        position[b, 1] -= other * pull * y
        position[b, 2] -= other * pull * z
