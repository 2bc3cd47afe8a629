"""Claims about import and export of the authors' format."""

from pathlib import Path

import numpy as np
import pytest

from emd_cloth_sim.authors_files import export_authors_file, import_authors_files
from emd_cloth_sim.generate import generate
from emd_cloth_sim.generation_config import GenerationConfig
from emd_cloth_sim.random_manipulation import ManipulationRule
from emd_cloth_sim.replay import load_recording
from emd_core.errors import InvalidInputError
from emd_core.sequence_reader import SequenceReader

REFERENCE = Path(__file__).parents[2].parent / "shared" / "data" / "blender_reference"
CONFIG = GenerationConfig(sequences=5, steps=2, seed=3, vertices=(11, 11), shard_size=2)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small data set."""
    folder = tmp_path_factory.mktemp("data")
    generate(CONFIG, folder)
    return folder


def test_export_holds_picks_moves_and_the_surface(data: Path, tmp_path: Path) -> None:
    """The file is of the authors' format, and its vertices are those that the grids show."""
    count = export_authors_file(data, tmp_path / "all.npz")
    recording = load_recording(tmp_path / "all.npz")
    sequences = list(SequenceReader([data]))
    assert count == len(sequences) == len(recording.states) and recording.side == 11
    for row, sequence in enumerate(sequences):
        np.testing.assert_array_equal(recording.states[row], sequence.upper_surface)
        np.testing.assert_array_equal(recording.picks[row], sequence.picks)
        np.testing.assert_array_equal(recording.moves[row], sequence.moves)


def test_there_and_back_again(data: Path, tmp_path: Path) -> None:
    """An exported data set imports to the same manipulations, vertices and nearly all voxels."""
    export_authors_file(data, tmp_path / "all.npz")
    assert import_authors_files(tmp_path / "all.npz", tmp_path / "back") > 0
    for old, new in zip(SequenceReader([data]), SequenceReader([tmp_path / "back"]), strict=True):
        np.testing.assert_array_equal(new.picks, old.picks)
        np.testing.assert_array_equal(new.moves, old.moves)
        np.testing.assert_allclose(new.states, old.upper_surface, atol=1e-3)  # half precision
        assert (new.grids != old.grids).mean() < 2e-3


def test_reference_sequences_import_row_by_row(tmp_path: Path) -> None:
    """Blender's vertex order becomes row-major: neighbours lie a vertex spacing apart."""
    if not REFERENCE.is_dir():
        pytest.skip("the reference sequences are not at hand")
    path = sorted(REFERENCE.glob("seq*.npz"))[0]
    assert import_authors_files(path, tmp_path / "data") == 1
    (sequence,) = SequenceReader([tmp_path / "data"])
    grid = sequence.states[0].astype(float).reshape(81, 81, 3)
    for axis in (0, 1):
        gaps = np.diff(grid, axis=axis)
        np.testing.assert_allclose(gaps[..., axis], 0.0175, atol=1e-3)
        np.testing.assert_allclose(gaps[..., 1 - axis], 0.0, atol=1e-3)
    (original,) = [s for s in SequenceReader([REFERENCE]) if s.index == 9]
    np.testing.assert_array_equal(sequence.grids, original.grids)
    (file,) = SequenceReader([tmp_path / "data"]).files
    assert path.name in file.meta["files"] and file.meta["cloth"]["vertices"] == [81, 81]


def test_import_appears_whole_or_not_at_all(data: Path, tmp_path: Path) -> None:
    """A broken file among good ones leaves no folder; a folder in use is refused."""
    source = tmp_path / "source"
    source.mkdir()
    export_authors_file(data, source / "a.npz")
    content = (source / "a.npz").read_bytes()
    (source / "b.npz").write_bytes(content[: len(content) // 2])
    with pytest.raises(InvalidInputError, match="b.npz"):
        import_authors_files(source, tmp_path / "out")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["source"]
    with pytest.raises(InvalidInputError, match="empty"):
        import_authors_files(source / "a.npz", source)


def test_what_the_format_cannot_say_is_refused(data: Path, tmp_path: Path) -> None:
    """Independent hands are not exported, and a shard of ours is not imported."""
    config = GenerationConfig(
        2, 1, 0, vertices=(11, 11), rule=ManipulationRule(independent_hands=True)
    )
    generate(config, tmp_path / "own")
    with pytest.raises(InvalidInputError, match="both hands"):
        export_authors_file(tmp_path / "own", tmp_path / "own.npz")
    with pytest.raises(InvalidInputError, match="authors' format"):
        import_authors_files(data, tmp_path / "again")
    assert not (tmp_path / "own.npz").exists()
