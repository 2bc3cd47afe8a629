"""Uploaded voxel grids: bounded, and never run."""

import io
import zipfile

import numpy as np
import pytest

from emd_console.goals import neat_goal
from emd_console.grid_file import LARGEST_UPLOAD, grid_from_bytes
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView


def npz(**arrays: object) -> bytes:
    """An .npz in memory; objects are pickled by numpy."""
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]
    return stream.getvalue()


def parts(**changed: object) -> dict[str, object]:
    """What a grid's file holds, with changes."""
    fov = FieldOfView()
    occupancy = np.zeros(fov.size, dtype=np.uint8)
    whole = {"occupancy": occupancy, "half_extent": fov.half_extent, "height": fov.height}
    return {**whole, **changed}


def test_a_saved_grid_is_read_back(tmp_path) -> None:
    """The same voxels."""
    goal = neat_goal("half").grid
    goal.save(tmp_path / "goal.npz")
    read = grid_from_bytes((tmp_path / "goal.npz").read_bytes())
    assert (read.occupancy == goal.occupancy).all()


class Trap:
    """Writes a file when it is unpickled."""

    def __reduce__(self):
        """What a pickle would do."""
        return open, ("trapped", "w")


def test_a_pickle_is_refused_and_not_run(tmp_path, monkeypatch) -> None:
    """Neither inside an .npz nor as the file itself."""
    monkeypatch.chdir(tmp_path)
    for content in (npz(**parts(occupancy=np.array([Trap()]))), b"\x80\x04cbuiltins\nexec\n."):
        with pytest.raises(InvalidInputError):
            grid_from_bytes(content)
    assert not (tmp_path / "trapped").exists()


def test_a_bomb_is_refused_before_it_is_unpacked() -> None:
    """Small packed, large unpacked."""
    bomb = npz(**parts(occupancy=np.zeros((4096, 4096), dtype=np.uint8)))
    assert len(bomb) < LARGEST_UPLOAD
    with pytest.raises(InvalidInputError, match="unpacked"):
        grid_from_bytes(bomb)


def test_a_header_that_claims_too_much_is_refused() -> None:
    """Sizes in the header are not believed."""
    stream = io.BytesIO()
    header = {"descr": "|u1", "fortran_order": False, "shape": (1 << 30, 1 << 10)}
    np.lib.format.write_array_header_1_0(stream, header)
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as made:
        for name in ("occupancy", "half_extent", "height"):
            made.writestr(f"{name}.npy", stream.getvalue())
    with pytest.raises(InvalidInputError):
        grid_from_bytes(archive.getvalue())


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"PK\x03\x04 not a zip",
        npz(),
        npz(**parts(occupancy=np.zeros((16, 16, 16), dtype=np.uint8))),
        npz(**parts(half_extent=np.nan)),
        npz(**parts(half_extent=np.zeros(3))),
        npz(**parts(occupancy=np.full((32, 32, 16), 7, dtype=np.uint8))),
        npz(**parts(occupancy=np.zeros((32, 32, 16)))),
        b"\0" * (LARGEST_UPLOAD + 1),
    ],
)
def test_what_is_no_grid_of_this_cell_is_refused(content) -> None:
    """With a sentence, whatever it is."""
    with pytest.raises(InvalidInputError):
        grid_from_bytes(content)
