"""Claims about the generator of training sequences."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import maximum_filter

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.diagnostics import ClothDiagnostics
from emd_cloth_sim.generate import GenerationProgress, generate
from emd_cloth_sim.generation_config import GenerationConfig
from emd_cloth_sim.manipulate import manipulate
from emd_cloth_sim.random_manipulation import ManipulationRule
from emd_cloth_sim.simulate_sequence import simulate_sequence
from emd_cloth_sim.workers import ProcessRunner
from emd_core.errors import BusyError, InvalidInputError, SimulationError
from emd_core.frames import FieldOfView
from emd_core.manipulation import Manipulation
from emd_core.sequence_reader import SequenceReader
from emd_core.voxel_grid import voxelise

CONFIG = GenerationConfig(sequences=7, steps=2, seed=3, vertices=(11, 11), shard_size=3)


def contents(folder: Path) -> dict[str, bytes]:
    """Bytes of all files of a folder."""
    paths = [path for path in folder.rglob("*") if path.is_file()]
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set made in one go."""
    folder = tmp_path_factory.mktemp("whole")
    generate(CONFIG, folder)
    return folder


def with_neighbours(grid: np.ndarray) -> np.ndarray:
    """Occupied voxels and all that touch them; x and y wrap."""
    return maximum_filter(grid, size=3, mode=("wrap", "wrap", "constant"))


class Killed(Exception):
    """Stands for a kill at a certain file operation."""


@pytest.mark.parametrize("name", ["replace", "unlink", "rmdir"])
def test_kill_at_any_file_operation_leaves_nothing_wrong(
    name: str, whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Interrupted before each of its file operations in turn, the run ends in the same bytes."""
    real, left = getattr(os, name), [0]

    def until_killed(*arguments: object, **options: object) -> None:
        if left[0] == 0:
            raise Killed
        left[0] -= 1
        real(*arguments, **options)

    samples = {index: simulate_sequence(CONFIG, index) for index in range(CONFIG.sequences)}

    def recall(config: GenerationConfig, indices: list[int]):
        for index in indices:
            yield samples[index]

    for operations in range(1, 100):
        left[0] = operations
        with monkeypatch.context() as patch:
            patch.setattr(os, name, until_killed)
            try:
                generate(CONFIG, tmp_path, recall)
                break
            except Killed:
                pass
    assert contents(tmp_path) == contents(whole)
    assert operations > 1 or name == "rmdir"


def start_generator(folder: Path, sequences: int, workers: int) -> subprocess.Popen:
    """Generate in a process of its own."""
    script = (
        "import sys; from pathlib import Path\n"
        "from emd_cloth_sim.generate import generate\n"
        "from emd_cloth_sim.generation_config import GenerationConfig\n"
        "from emd_cloth_sim.workers import ProcessRunner\n"
        "if __name__ == '__main__':\n"
        f"    config = GenerationConfig({sequences}, 2, 3, 'towel', (11, 11), shard_size=3)\n"
        f"    generate(config, Path(sys.argv[1]), ProcessRunner({workers}))\n"
    )
    # A spawned worker imports the main module again, so it must be a file.
    path = folder.parent / "generator.py"
    path.write_text(script)
    return subprocess.Popen([sys.executable, str(path), str(folder)], start_new_session=True)


@pytest.mark.slow
def test_killed_generator_resumes_to_the_bytes_of_an_unbroken_run(tmp_path: Path) -> None:
    """Killed three times at random by SIGKILL and resumed, two workers give one's files."""
    sequences = 24
    config = replace(CONFIG, sequences=sequences)
    generate(config, tmp_path / "whole")
    folder = tmp_path / "killed"
    rng = np.random.default_rng(int.from_bytes(os.urandom(4), "little"))
    kills = 0
    for part in (0, 6, 12):
        process = start_generator(folder, sequences, 2)
        while process.poll() is None and files_written(folder) <= part:
            time.sleep(0.01)
        time.sleep(rng.uniform(0.0, 0.3))
        if process.poll() is None:
            os.kill(process.pid, signal.SIGKILL)
            kills += 1
        process.wait()
    assert kills == 3
    assert start_generator(folder, sequences, 2).wait() == 0
    assert contents(folder) == contents(tmp_path / "whole")


def files_written(folder: Path) -> int:
    """Sequences that a running generator has kept."""
    shards = len(list(folder.glob("shard_*.npz")))
    return 3 * shards + len(list((folder / "partial").glob("sequence_*.npz")))


def test_workers_end_with_a_killed_generator(whole: Path, tmp_path: Path) -> None:
    """No worker outlives a generator that SIGKILL ends, and what was done is not done again."""
    process = start_generator(tmp_path / "data", CONFIG.sequences, 2)
    while files_written(tmp_path / "data") < 1:
        time.sleep(0.02)
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    assert len(children) >= 2
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    deadline = time.monotonic() + 10.0
    while any(is_running(child) for child in children) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(is_running(child) for child in children)
    assert generate(CONFIG, tmp_path / "data").new < CONFIG.sequences
    assert contents(tmp_path / "data") == contents(whole)


def is_running(process: str) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_killed_worker_is_replaced(whole: Path, tmp_path: Path) -> None:
    """A worker that dies costs nothing but its time: the data set is complete and the same."""
    killed = []

    def kill_one(progress: GenerationProgress) -> None:
        children = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read_text().split()
        workers = [child for child in children if "spawn_main" in command_of(child)]
        if progress.new == 1 and not killed:
            killed.append(int(workers[0]))
            os.kill(killed[0], signal.SIGKILL)

    generate(CONFIG, tmp_path, ProcessRunner(2), kill_one)
    assert killed and contents(tmp_path) == contents(whole)


def command_of(process: str) -> str:
    """Command line of a process."""
    return Path(f"/proc/{process}/cmdline").read_text()


def test_worker_that_always_dies_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A sequence over which workers die again and again ends the run with its number."""
    monkeypatch.setattr("emd_cloth_sim.workers._work", exit_at_once)
    with pytest.raises(SimulationError, match="sequence 0"):
        generate(CONFIG, tmp_path, ProcessRunner(1))


def exit_at_once(*_: object) -> None:
    """A worker that dies."""
    os._exit(1)


def test_data_set_grows_to_what_a_longer_run_gives(whole: Path, tmp_path: Path) -> None:
    """Asking for more sequences later adds them; the files are those of asking once."""
    assert generate(replace(CONFIG, sequences=4), tmp_path).done == 4
    assert generate(CONFIG, tmp_path).new == 3
    assert contents(tmp_path) == contents(whole)
    with pytest.raises(InvalidInputError, match="at least as many"):
        generate(replace(CONFIG, sequences=4), tmp_path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": 4}, "seed: 3 there, 4 here"),
        ({"steps": 1}, "steps"),
        ({"start": "random"}, "start"),
        ({"rule": ManipulationRule("hem")}, "mode"),
        ({"vertices": (12, 12)}, "cloth"),
        ({"shard_size": 5}, "shard_size"),
    ],
)
def test_other_settings_in_the_same_folder_are_refused(
    change: dict, message: str, whole: Path
) -> None:
    """Data of two settings never mix; the message names what differs."""
    before = contents(whole)
    with pytest.raises(InvalidInputError, match=message):
        generate(replace(CONFIG, **change), whole)
    assert contents(whole) == before


def test_other_code_is_refused(whole: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A data set cannot be continued by a program whose sources differ."""
    monkeypatch.setattr("emd_cloth_sim.generation_config.code_hash", lambda: "other")
    with pytest.raises(InvalidInputError, match="code_sha256"):
        generate(CONFIG, whole)


def test_place_that_cannot_be_a_folder_is_refused(whole: Path) -> None:
    """A file in the way is an input error, not a crash."""
    with pytest.raises(InvalidInputError, match="name another"):
        generate(CONFIG, whole / "generation.json")


def test_two_generators_do_not_share_a_folder(whole: Path) -> None:
    """A second generator is refused while the first one writes."""
    with pytest.raises(BusyError):
        generate(CONFIG, whole, on_progress=lambda _: generate(CONFIG, whole) and None)


def test_shards_hold_what_was_simulated(whole: Path) -> None:
    """Sequences and failures are all there once, and grids are those of the vertices."""
    reader = SequenceReader([whole])
    fov = FieldOfView()
    seen = [failure.index for failure in reader.failures]
    thickness = CONFIG.material.cloth.thickness
    for sequence in reader:
        seen.append(sequence.index)
        part = simulate_sequence(CONFIG, sequence.index)
        np.testing.assert_array_equal(sequence.states, part.arrays["states"][0])
        wanted = voxelise(Cloth(CONFIG.material.cloth).top_surface_in_table, fov)
        np.testing.assert_array_equal(sequence.grids[0], wanted.occupancy)
        for grid, points in zip(sequence.grids, sequence.upper_surface, strict=True):
            again = voxelise(fov.table_from_normalised(points)).occupancy
            # Half precision moves a vertex by less than 0.5 mm: over one side of a voxel at most.
            assert not (grid & ~with_neighbours(again)).any()
            assert not (again & ~with_neighbours(grid)).any()
    assert sorted(seen) == list(range(CONFIG.sequences))
    assert sequence.surface_height == pytest.approx(0.5 * thickness / fov.half_extent)


def test_failures_are_kept_with_their_reasons(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A failed sequence is counted, listed with its step, and not among the data."""
    monkeypatch.setattr(ClothDiagnostics, "failure", property(lambda _: "the cloth tore"))
    made = generate(CONFIG, tmp_path)
    assert [failure.index for failure in made.failures] == list(range(7))
    reader = SequenceReader([tmp_path])
    assert len(reader) == 0 and len(reader.failures) == 7
    assert {failure.step for failure in reader.failures} == {0}
    assert {failure.reason for failure in reader.failures} == {"the cloth tore"}
    again = generate(CONFIG, tmp_path)
    assert (again.new, len(again.failures)) == (0, 7)


def test_simulation_error_is_a_failure_of_its_sequence(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the solver raises is recorded with the step and does not end the run."""

    def refuse(*_: object) -> None:
        raise SimulationError("the cloth tore")

    monkeypatch.setattr("emd_cloth_sim.simulate_sequence.manipulate", refuse)
    (flat,) = simulate_sequence(CONFIG, 0).failures
    assert (flat.step, flat.reason) == (0, "the cloth tore")
    (later,) = simulate_sequence(replace(CONFIG, start="random"), 0).failures
    assert later.step == -1 and "before the start: the cloth tore" in later.reason


def test_sequence_depends_on_seed_and_index_only() -> None:
    """The same index gives the same sequence whatever else is generated."""
    longer = replace(CONFIG, sequences=100, shard_size=16)
    one, other = simulate_sequence(CONFIG, 3), simulate_sequence(longer, 3)
    np.testing.assert_array_equal(one.arrays["states"], other.arrays["states"])
    np.testing.assert_array_equal(one.arrays["moves"], other.arrays["moves"])
    different = simulate_sequence(CONFIG, 4)
    assert not np.array_equal(one.arrays["moves"], different.arrays["moves"])


def test_random_start_is_the_outcome_of_manipulations() -> None:
    """With a random start the first state is not flat, and it is the same again."""
    config = replace(CONFIG, start="random", steps=1)
    parts = [simulate_sequence(config, index) for index in range(4)]
    starts = [part.arrays["states"][0, 0] for part in parts if not part.failures]
    assert len(starts) > 1
    flat = FieldOfView().normalised_from_table(Cloth(config.material.cloth).positions_in_table)
    assert all(np.abs(start - flat).max() > 0.05 for start in starts)
    again = simulate_sequence(config, 3)
    np.testing.assert_array_equal(again.arrays["states"], parts[3].arrays["states"])


def test_replaying_a_sample_gives_its_states() -> None:
    """Picks and moves of a sample are what was done to the cloth."""
    parts = (simulate_sequence(CONFIG, index) for index in range(10))
    arrays = next(part.arrays for part in parts if not part.failures)
    cloth = Cloth(CONFIG.material.cloth)
    fov = FieldOfView()
    picks, move = arrays["picks"][0, 0], arrays["moves"][0, 0]
    used = np.isfinite(picks).all(axis=1)
    values = np.concatenate([picks.ravel(), move]).astype(np.float64)
    manipulate(cloth, Manipulation.from_network(values, (used[0], used[1]), fov))
    # float32 grasp points move the outcome a little; crumpling amplifies it, so only roughly.
    got = fov.normalised_from_table(cloth.positions_in_table)
    assert np.abs(got - arrays["states"][0, 1]).mean() < 0.02


def test_provenance_says_all_that_matters(whole: Path) -> None:
    """Each shard tells settings, cloth, versions and code; none tells when or by whom."""
    (file, *_) = SequenceReader([whole]).files
    assert file.meta["seed"] == 3 and file.meta["mode"] == "any"
    assert file.meta["cloth"]["vertices"] == [11, 11] and file.meta["path"]["hand_speed"] > 0
    assert len(file.meta["code_sha256"]) == 64 and "numba" in file.meta["versions"]
    assert file.meta["processors"]
    assert json.loads((whole / "generation.json").read_text())["sequences"] == 7


@pytest.mark.parametrize(
    "change", [{"sequences": 0}, {"steps": 0}, {"seed": -1}, {"start": "heap"}, {"preset": "tin"}]
)
def test_bad_settings_are_refused(change: dict) -> None:
    """Counts below one, and names that do not exist, raise InvalidInputError."""
    with pytest.raises(InvalidInputError):
        replace(CONFIG, **change)
    with pytest.raises(InvalidInputError):
        ProcessRunner(0)
