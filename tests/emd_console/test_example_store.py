"""Recorded examples: whole or absent, reviewed, exported, trained on."""

import multiprocessing
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_cell import HALF, example, observation

from emd_console.example_store import ACCEPTED, REJECTED, ExampleStore, Review, export_examples
from emd_console.goals import neat_goal
from emd_console.replay import read_replay
from emd_core.errors import BusyError, InvalidInputError
from emd_core.sequence_reader import SequenceReader
from emd_planner.sequence_files import load_sequences


def test_an_example_is_a_data_set_of_one_sequence(store) -> None:
    """The generator's reader gives grids and manipulation back."""
    stored = store.add(example())
    (sequence,) = SequenceReader([stored.folder])
    assert (sequence.grids[0] == observation().grid.occupancy).all()
    assert (sequence.grids[1] == neat_goal("half").grid.occupancy).all()
    scale = neat_goal("half").grid.field_of_view.half_extent
    assert np.allclose(sequence.picks[0] * scale, HALF.grasp_points_in_table, atol=1e-6)
    assert np.allclose(sequence.moves[0] * scale, HALF.displacement_in_table, atol=1e-6)
    names = {file.name for file in stored.folder.iterdir()}
    assert {"before.jpg", "after.jpg", "goal.npz", "observations.npz", "example.json"} <= names


def test_numbers_go_on_after_a_restart(tmp_path) -> None:
    """Nothing is overwritten."""
    for wanted in range(3):
        store = ExampleStore(tmp_path)
        assert store.add(example()).number == wanted
        store.close()


def test_only_one_console_records_in_a_folder(store) -> None:
    """The second is told why."""
    with pytest.raises(BusyError, match="another console"):
        ExampleStore(store.root)


def test_reviews_are_kept_and_bad_ones_refused(store) -> None:
    """Verdict, note and who."""
    number = store.add(example()).number
    store.review(number, Review(ACCEPTED, "neat", "ada"))
    assert store.get(number).review == Review(ACCEPTED, "neat", "ada")
    with pytest.raises(InvalidInputError, match="verdict"):
        store.review(number, Review("splendid"))
    with pytest.raises(InvalidInputError, match="500"):
        store.review(number, Review(ACCEPTED, "x" * 501))
    with pytest.raises(InvalidInputError, match="no example 7"):
        store.review(7, Review(ACCEPTED))


def test_the_export_holds_what_was_accepted_and_can_be_trained_on(store, tmp_path) -> None:
    """In the order of recording, over several shards; the trainer loads it."""
    for number in range(20):
        store.add(example())
        store.review(number, Review(REJECTED if number == 3 else ACCEPTED))
    out = tmp_path / "data"
    assert export_examples(store.root, out) == 19
    reader = SequenceReader([out])
    assert [sequence.index for sequence in reader] == [n for n in range(20) if n != 3]
    assert load_sequences([out]).manipulation_count == 19
    with pytest.raises(InvalidInputError, match="not empty"):
        export_examples(store.root, out)


def test_the_export_takes_the_motions_along_if_asked(store, tmp_path) -> None:
    """Each as a bag of its own; the data set beside them is read as before."""
    number = store.add(example()).number
    store.review(number, Review(ACCEPTED))
    assert export_examples(store.root, tmp_path / "plain") == 1
    assert not (tmp_path / "plain" / "motions").exists()
    assert export_examples(store.root, tmp_path / "data", motions=True) == 1
    bag = tmp_path / "data" / "motions" / "example_00000"
    assert read_replay(bag).phases[1][1] == "carry"
    assert load_sequences([tmp_path / "data"]).manipulation_count == 1


def test_an_export_of_nothing_is_refused(store, tmp_path) -> None:
    """With the remedy."""
    store.add(example())
    with pytest.raises(InvalidInputError, match="review"):
        export_examples(store.root, tmp_path / "data")


def test_no_path_leads_out_of_the_store(store) -> None:
    """Pictures are named by number and moment alone."""
    number = store.add(example()).number
    assert store.picture(number, "before").startswith(b"\xff\xd8")
    for moment in ("../../secret", "example.json", "before.jpg", ""):
        assert store.picture(number, moment) is None
    assert store.picture(99, "before") is None


def record_for_ever(root: Path, ready: Any) -> None:
    """Record one example after the other until killed."""
    store = ExampleStore(root)
    store.add(example())
    ready.set()
    while True:
        store.add(example())


def test_a_killed_recorder_leaves_only_whole_examples(tmp_path) -> None:
    """SIGKILL at many moments: every folder that has a name is complete."""
    rng = np.random.default_rng(0)
    fork = multiprocessing.get_context("fork")
    for _ in range(10):
        ready = fork.Event()
        process = fork.Process(target=record_for_ever, args=(tmp_path, ready))
        process.start()
        assert ready.wait(60)
        time.sleep(float(rng.uniform(0.0, 0.1)))
        process.kill()
        process.join()
    store = ExampleStore(tmp_path)
    assert not list(tmp_path.glob(".partial-*"))
    examples = store.all()
    assert len(examples) >= 10
    for stored in examples:
        (sequence,) = SequenceReader([stored.folder])
        assert sequence.grids[1].any()
        bag = store.motion(stored.number)
        assert bag is not None and read_replay(bag).times[-1] == pytest.approx(2.0)
        assert store.picture(stored.number, "after") is not None
    store.close()
