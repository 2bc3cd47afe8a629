"""Where on the table each arm can grasp a hem of a given direction, and where it can let go."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray
from emd_core.voxel_grid import BoolArray
from emd_core.whole_file import whole_file

_FORMAT = "emd_reach_map 1"


@dataclass(frozen=True)
class ReachMap:
    """Samples of the table, all arms and directions of the hand.

    Attributes:
        arms: Names of the A arms.
        axis: Coordinates of the samples along x and along y, table frame, shape (N,), metres.
        yaws: Directions in which a hand comes to a hem, angles about the table's z, equally
            spaced over a turn from 0, shape (K,), radians.
        grasp: Whether a hand that comes in a direction can grasp a hem and rise with it, axes
            (A, K, X, Y).
        release: Whether a hand of that direction can come down, open and rise, axes (A, K, X, Y).
        identity: Of the cell for which it holds.
    """

    arms: tuple[str, ...]
    axis: FloatArray
    yaws: FloatArray
    grasp: BoolArray
    release: BoolArray
    identity: str = ""

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            InvalidInputError: If a shape does not fit or the samples are not equally spaced.
        """
        shape = (len(self.arms), len(self.yaws), len(self.axis), len(self.axis))
        even = len(self.axis) > 1 and np.allclose(np.diff(self.axis), self.step)
        if np.shape(self.grasp) != shape or np.shape(self.release) != shape or not even:
            raise InvalidInputError(
                f"a reach map of {shape} (arms, yaws, x, y) on an even axis is wanted, got "
                f"{np.shape(self.grasp)} and {np.shape(self.release)} on {self.axis}"
            )

    @property
    def step(self) -> float:
        """Distance between neighbouring samples, metres."""
        return float(self.axis[1] - self.axis[0])

    def save(self, path: Path) -> None:
        """Write an npz file, whole or not at all."""
        with whole_file(path) as temporary:
            np.savez_compressed(
                temporary,
                format=np.array(_FORMAT),
                arms=np.array(self.arms),
                axis=self.axis,
                yaws=self.yaws,
                grasp=self.grasp,
                release=self.release,
                identity=np.array(self.identity),
            )

    @classmethod
    def load(cls, path: Path) -> ReachMap:
        """Read what `save` wrote.

        Raises:
            InvalidInputError: If the file is missing or no reach map.
        """
        try:
            with np.load(path) as file:
                if str(file["format"]) != _FORMAT:
                    raise InvalidInputError(
                        f"{path} should be an '{_FORMAT}', it is {file['format']}"
                    )
                return cls(
                    tuple(str(name) for name in file["arms"]),
                    file["axis"],
                    file["yaws"],
                    file["grasp"],
                    file["release"],
                    str(file["identity"]),
                )
        except (OSError, ValueError, KeyError) as err:
            raise InvalidInputError(
                f"{path} should be a reach map; write one with `./cell reach`: {err}"
            ) from err
