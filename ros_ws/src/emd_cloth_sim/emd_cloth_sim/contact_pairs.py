"""The lists of what may touch what, and the motion that says how long they are good for."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from emd_cloth_sim.broad_phase import PLACES, Patches
from emd_cloth_sim.mesh import IndexArray
from emd_cloth_sim.planes import FAST

Singles = NDArray[np.float32]


class Candidates(NamedTuple):
    """Pairs of vertex and triangle that may touch before their patches' next search; all (M,).

    Attributes:
        vertex: Vertex of a pair.
        triangle: Its triangle.
        side: Side of the triangle on which the vertex is, 1 or -1.
        wake: The pair sleeps until its two patches have moved this far, metres; -1 in contact.
    """

    vertex: IndexArray
    triangle: IndexArray
    side: Singles
    wake: Singles


class Segments(NamedTuple):
    """The candidates and contacts of each pair of patches, shapes (P,).

    Attributes:
        start: Its first candidate and first contact.
        stop: The place after its last candidate.
        touching: How many contacts it has.
        search: When its patches have moved this far its candidates are searched again, metres.
        wake: The first wake among its candidates, metres.
        good: When its patches have moved this far its contacts are listed again, metres.
    """

    start: IndexArray
    stop: IndexArray
    touching: IndexArray
    search: Singles
    wake: Singles
    good: Singles


class Contacts(NamedTuple):
    """Candidates that may touch within the next few substeps.

    Those of a pair of patches begin at the place of its first candidate.

    Attributes:
        corners: The vertex and the triangle's three, shape (M, 4).
        weights: Barycentric, of the triangle's point that is closest to the vertex, shape (M, 3).
        normal: Unit vector from there to the side on which the vertex belongs, shape (M, 3).
    """

    corners: IndexArray
    weights: Singles
    normal: Singles


class Motion(NamedTuple):
    """How far each patch has moved since the pairs of patches were listed; all (N,), metres.

    "So far" is the sum over the substeps of the longest way of any of its vertices.

    Attributes:
        moved: Way so far.
        last: Way in the last substep.
        boxed: Way so far when the patch's boxes were made; negative if they are not.
    """

    moved: Singles
    last: Singles
    boxed: Singles


def allocate_candidates(size: int) -> Candidates:
    """Make lists for `size` pairs."""
    return Candidates(
        np.empty(size, np.int32),
        np.empty(size, np.int32),
        np.empty(size, np.float32),
        np.empty(size, np.float32),
    )


def allocate_segments(size: int) -> Segments:
    """Make room for `size` pairs of patches."""
    return Segments(
        np.empty(size, np.int32),
        np.empty(size, np.int32),
        np.empty(size, np.int32),
        np.empty(size, np.float32),
        np.empty(size, np.float32),
        np.empty(size, np.float32),
    )


def allocate_contacts(size: int) -> Contacts:
    """Make lists for `size` pairs."""
    return Contacts(
        np.empty((size, 4), np.int32),
        np.empty((size, 3), np.float32),
        np.empty((size, 3), np.float32),
    )


def allocate_motion(patches: int) -> Motion:
    """Motion of patches that rest."""
    return Motion(*(np.zeros(patches, np.float32) for _ in range(3)))


@njit(**FAST)
def note_motion(ways: Singles, patches: Patches, motion: Motion) -> None:
    """Add a substep, given its square way of every vertex (V,), to the motion of the patches."""
    for p in range(motion.moved.shape[0]):
        longest = np.float32(0.0)
        for n in range(p * PLACES, (p + 1) * PLACES):
            if patches.places[n] >= 0:
                longest = max(longest, ways[patches.places[n]])
        motion.last[p] = math.sqrt(longest)
        motion.moved[p] += motion.last[p]
