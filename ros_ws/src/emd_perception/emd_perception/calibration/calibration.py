"""A camera's calibrated pose, and its YAML file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray, pose_from_transform, transform_from_pose
from emd_core.pinhole_camera import PinholeCamera
from emd_core.whole_file import write_text

FORMAT = "emd camera calibration 1"


@dataclass(frozen=True)
class Calibration:
    """Where the camera is, and how well that is known.

    Attributes:
        camera: Intrinsics under which it was measured.
        transform_camera_to_table: Shape (4, 4), metres.
        table_plane: The table as measured: a, b, c, d in the camera optical frame, metres.
        reprojection_error: Root mean square over the board's corners, pixels.
        corners: How many corners of all pictures.
        frames: How many pictures.
        tilt: Between the table's depth and the board, radians: what the plane corrected.
        offset: Height of the table's depth over the board's, metres.
        made: When, ISO 8601, UTC.
    """

    camera: PinholeCamera
    transform_camera_to_table: FloatArray
    table_plane: FloatArray
    reprojection_error: float
    corners: int
    frames: int
    tilt: float
    offset: float
    made: str

    def save(self, path: Path) -> None:
        """Write the calibration as YAML, whole or not at all.

        Raises:
            InvalidInputError: If nothing can be written there.
        """
        position, orientation = pose_from_transform(self.transform_camera_to_table)
        entry = {
            "format": FORMAT,
            "made": self.made,
            "camera_in_table": {
                "position_m": position.tolist(),
                "orientation_xyzw": orientation.tolist(),
            },
            "table_plane_in_camera": self.table_plane.tolist(),
            "camera": asdict(self.camera),
            "reprojection_error_px": self.reprojection_error,
            "corners": self.corners,
            "frames": self.frames,
            "plane_against_board": {"tilt_rad": self.tilt, "offset_m": self.offset},
        }
        write_text(path, yaml.safe_dump(entry, sort_keys=False))

    @classmethod
    def load(cls, path: Path) -> Calibration:
        """Read what `save` wrote.

        Raises:
            InvalidInputError: If there is no such file or it is not a calibration.
        """
        try:
            entry = yaml.safe_load(path.read_text(encoding="utf-8"))
        except OSError as err:
            raise InvalidInputError(
                f"cannot read the calibration {path}: {err.strerror or err}; `./cell calibrate` "
                "makes one"
            ) from err
        except (yaml.YAMLError, UnicodeDecodeError, ValueError, RecursionError) as err:
            raise InvalidInputError(f"{path} is not a calibration in YAML: {err}") from err
        if not isinstance(entry, Mapping) or entry.get("format") != FORMAT:
            found = entry.get("format") if isinstance(entry, Mapping) else type(entry).__name__
            raise InvalidInputError(
                f"{path} should be a file of format '{FORMAT}', got '{found}'; `./cell calibrate` "
                "makes one"
            )
        try:
            return cls._from_entry(entry)
        except (KeyError, TypeError, ValueError, OverflowError, InvalidInputError) as err:
            raise InvalidInputError(
                f"{path} is a damaged calibration: {type(err).__name__}: {err}; calibrate again"
            ) from err

    @classmethod
    def _from_entry(cls, entry: Mapping[str, Any]) -> Calibration:
        camera, pose = dict(entry["camera"]), entry["camera_in_table"]
        size = {name: int(camera.pop(name)) for name in ("width", "height")}
        rest = {name: float(value) for name, value in camera.items()}
        correction = entry["plane_against_board"]
        figures = np.array(
            [
                entry["reprojection_error_px"],
                correction["tilt_rad"],
                correction["offset_m"],
                *entry["table_plane_in_camera"],
            ],
            dtype=np.float64,
        )
        if figures.shape != (7,) or not np.isfinite(figures).all():
            raise ValueError(f"finite figures and a plane of four are needed, got {figures}")
        return cls(
            PinholeCamera(**size, **rest),  # type: ignore[arg-type]
            transform_from_pose(pose["position_m"], pose["orientation_xyzw"]),
            figures[3:],
            float(figures[0]),
            int(entry["corners"]),
            int(entry["frames"]),
            float(figures[1]),
            float(figures[2]),
            str(entry["made"]),
        )
