"""Claims about the evaluation of planners: tasks, execution, rows, going on after a kill."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from emd_cell.evaluation import rivals
from emd_cell.evaluation.execution import Record, perform, unwrapped
from emd_cell.evaluation.rivals import (
    REACHES,
    NetPlanner,
    Problem,
    Proposal,
    Rival,
    make_rivals,
    within_reach,
)
from emd_cell.evaluation.run import Evaluation, evaluate
from emd_cell.evaluation.table import markdown, rows_of
from emd_cell.evaluation.tasks import Task, neat_tasks, sequence_tasks
from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.generate import generate
from emd_cloth_sim.generation_config import GenerationConfig
from emd_cloth_sim.presets import preset
from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView
from emd_core.manipulation import Manipulation
from emd_core.sequence_reader import SequenceReader
from emd_planner.config import PLANNERS, PlannerConfig
from emd_planner.fold_plan import FoldPlan
from emd_planner.weights import load_net

MESH = 15
TOWEL = preset("towel", (MESH, MESH))
NONE = (np.nan, np.nan)


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> Path:
    """Three sequences of two steps."""
    folder = tmp_path_factory.mktemp("evaluation") / "data"
    generate(GenerationConfig(3, 2, 5, "towel", (MESH, MESH)), folder)
    return folder


@pytest.fixture(scope="module")
def tasks(data: Path) -> list[Task]:
    """All their parts."""
    return sequence_tasks([data], [1, 2], MESH)


def test_every_part_of_a_sequence_is_a_task(tasks: list[Task]) -> None:
    """Two steps make two tasks of one step and one of two, chained by their states."""
    assert [task.steps for task in tasks] == 3 * [1, 1, 2]
    for one, two, both in zip(tasks[::3], tasks[1::3], tasks[2::3], strict=True):
        np.testing.assert_allclose(one.goal, two.start, atol=1e-4)
        assert np.array_equal(both.start, one.start) and np.array_equal(both.goal, two.goal)
        assert both.recorded == one.recorded + two.recorded


def test_splits_are_disjoint_and_whole(data: Path) -> None:
    """Each sequence is for training or for the test, not both."""
    names = {
        split: {(task.name, task.start.tobytes()) for task in _or_none([data], split)}
        for split in ("train", "test", "all")
    }
    starts = {split: {start for _, start in found} for split, found in names.items()}
    assert starts["train"] | starts["test"] == starts["all"]
    assert len(names["train"]) + len(names["test"]) == len(names["all"])
    with pytest.raises(InvalidInputError, match="split"):
        sequence_tasks([data], [1], MESH, "validation")


def _or_none(paths: list[Path], split: str) -> list[Task]:
    try:
        return sequence_tasks(paths, [2], MESH, split)
    except InvalidInputError:
        return []


def test_the_oracle_comes_nearer_than_doing_nothing(tasks: list[Task]) -> None:
    """Recorded manipulations lead near the goal; nothing and empty score what they are."""
    rivals = make_rivals(("nothing", "empty", "oracle"), None, None)
    for task in tasks:
        records = {
            name: perform(task, name, rival, "replan", TOWEL, 0).record
            for name, rival in rivals.items()
        }
        assert records["nothing"].voxel_mse == records["oracle"].idle_mse > 0.0
        assert records["empty"].voxel_mse == task.grid(task.goal).occupancy.mean()
        assert records["oracle"].vertex_mm < 0.3 * records["nothing"].vertex_mm


@pytest.mark.parametrize("mode", ["replan", "open"])
def test_the_net_plans_and_its_plans_are_executed(tasks: list[Task], mode: str) -> None:
    """The search with the shipped weights moves the cloth, and its time is told."""
    task = tasks[2]
    quick = NetPlanner(load_net(), PlannerConfig(restarts=3, max_iterations=4), None)
    done = perform(task, "ours", quick, mode, TOWEL, 0)
    record, outcome = done.record, done.outcome
    assert record.plan_ms > 1.0 and record.failure == ""
    assert outcome.shape == task.start.shape and np.isfinite(outcome).all()


class _Remembers(NetPlanner):
    """Keeps what it has planned."""

    planned: list[Manipulation]

    def propose(self, problem: Problem) -> Proposal:
        """Plan, and keep it."""
        proposal = super().propose(problem)
        self.planned = [*getattr(self, "planned", ()), *proposal.manipulations]
        return proposal


def test_plans_of_arms_that_reach_half_of_the_view_stay_there(tasks: list[Task]) -> None:
    """All that is planned; carried out, too, unless the cloth lies partly beyond the view.

    There a grasp at one edge of the view is made where the cloth is, beyond the opposite one.
    """
    config = replace(PLANNERS["ours"], restarts=2, candidates=8, max_iterations=2)
    rival = _Remembers(load_net(), config, REACHES["half"])
    judged = 0
    for task in tasks[3:6]:
        record = perform(task, "ours", rival, "replan", TOWEL, 0, REACHES["half"]).record
        beyond = bool((np.abs(task.start[:, :2]) > task.field_of_view.half_extent).any())
        if not beyond:
            assert record.executable or record.failure
            judged += 1
        assert record.figures is None or record.figures.steps == task.steps
        assert Record.from_entry(json.loads(json.dumps(record.as_entry()))) == record
    regions = [np.array(REACHES["half"].left), np.array(REACHES["half"].right)]
    assert judged and rival.planned
    assert all(within_reach(manipulation, regions) for manipulation in rival.planned)


class _TriesFirst(Rival):
    """Tries out what was recorded, then does it, or nothing."""

    def __init__(self, then_does_it: bool) -> None:
        self.then_does_it, self.foreseen = then_does_it, None

    def propose(self, problem: Problem) -> Proposal:
        """Keep what is foreseen."""
        self.foreseen = problem.try_out(problem.recorded)
        return Proposal(problem.recorded if self.then_does_it else ())


def test_what_is_tried_out_comes_so_and_leaves_no_trace(tasks: list[Task]) -> None:
    """The outcome is the one foreseen; who only tries has done nothing."""
    task = tasks[2]
    does, idles = _TriesFirst(True), _TriesFirst(False)
    outcome = perform(task, "x", does, "open", TOWEL, 0).outcome
    assert np.array_equal(task.grid(outcome).occupancy, does.foreseen.occupancy)
    idle = perform(task, "x", idles, "open", TOWEL, 0)
    record, outcome = idle.record, idle.outcome
    assert record.voxel_mse == record.idle_mse
    np.testing.assert_allclose(outcome, task.start, atol=1e-6)


@pytest.mark.slow
def test_trying_plans_out_is_no_worse(tasks: list[Task], monkeypatch: pytest.MonkeyPatch) -> None:
    """Of several plans the one that turns out best; the first of them is the net's choice."""
    net, config = load_net(), replace(PLANNERS["ours"], restarts=3, candidates=8, max_iterations=2)
    outcome, tried_out = rivals._outcome, []

    def counted(problem: Problem, found: FoldPlan) -> float:
        tried_out.append(outcome(problem, found))
        return tried_out[-1]

    monkeypatch.setattr(rivals, "_outcome", counted)
    for task in tasks[3:6]:
        blind = perform(task, "x", NetPlanner(net, config, None), "open", TOWEL, 0).record
        assert not tried_out
        trying = NetPlanner(net, config, None, tried_out=3)
        tried = perform(task, "x", trying, "open", TOWEL, 0).record
        assert len(tried_out) > 1
        tried_out.clear()
        assert tried.voxel_mse <= blind.voxel_mse + 1e-3


def test_a_killed_evaluation_goes_on_where_it_was(tasks: list[Task], tmp_path: Path) -> None:
    """With a cut-off journal nothing is done twice, and the records are those of a whole run."""
    evaluation = Evaluation(tasks[:3], ("nothing", "random", "oracle"), "replan", TOWEL)
    whole = evaluate(evaluation, tmp_path / "whole.jsonl")
    lines = (tmp_path / "whole.jsonl").read_text().splitlines(keepends=True)
    journal = tmp_path / "killed.jsonl"
    journal.write_text("".join(lines[:5]) + lines[5][:20])
    told: list[int] = []
    assert evaluate(evaluation, journal, on_progress=lambda done, _: told.append(done)) == whole
    assert told == [5, 6, 7, 8, 9]
    other = replace(evaluation, seed=1)
    with pytest.raises(InvalidInputError, match="should be the journal of"):
        evaluate(other, journal)


def test_rows_average_what_belongs_together(tasks: list[Task], tmp_path: Path) -> None:
    """A row for each planner and number of steps, with means over its tasks."""
    evaluation = Evaluation(tasks, ("nothing", "empty"), "replan", TOWEL)
    records = evaluate(evaluation, tmp_path / "journal.jsonl")
    rows = rows_of(records)
    assert [(row["steps"], row["planner"], row["n"]) for row in rows] == [
        (1, "empty", 6),
        (1, "nothing", 6),
        (2, "empty", 3),
        (2, "nothing", 3),
    ]
    assert rows[1]["relative_mse"] == {"mean": 1.0, "sd": 0.0, "median": 1.0}
    wanted = np.mean([r.voxel_mse for r in records if (r.group, r.planner) == ("2", "nothing")])
    assert rows[3]["voxel_mse"]["mean"] == pytest.approx(wanted)
    assert markdown(rows).count("\n") == 6 and json.dumps(rows)


def test_neat_folds_are_tasks_in_millimetres() -> None:
    """The folds' own manipulations come within a cell of the ideal folds."""
    found = {task.name: task for task in neat_tasks(TOWEL.cloth)}
    rivals = make_rivals(("oracle",), None, None)
    record = perform(found["half"], "oracle", rivals["oracle"], "open", TOWEL, 0).record
    assert record.vertex_mm < 5.0 and len(found) == 7


def test_grasps_follow_the_cloth_across_the_edge(tasks: list[Task]) -> None:
    """A point planned where the grid wraps is taken at the cloth, and others stay as they are."""
    extent = 2.0 * FieldOfView().half_extent
    task = replace(tasks[0], start=tasks[0].start + [0.3, 0.0, 0.0])
    cloth = Cloth.from_positions(task.start, TOWEL.cloth)
    seen_at = np.array([[0.45 - extent, 0.0], [0.2, 0.1]])
    planned = Manipulation(seen_at, np.array([0.1, 0.0]))
    points = unwrapped(planned, cloth, task).grasp_points_in_table
    np.testing.assert_allclose(points, [[0.45, 0.0], [0.2, 0.1]], atol=1e-12)


@pytest.mark.parametrize(
    ("points", "move", "wanted"),
    [
        ([(0.5, 0.5), NONE], (1.0, 0.0), True),
        ([(0.5, 0.5), NONE], (5.0, 0.0), False),
        ([(0.5, 0.5), (2.5, 0.5)], (0.0, 0.2), True),
        ([(0.5, 0.5), (0.6, 0.5)], (0.0, 0.2), False),
    ],
)
def test_reach_needs_an_arm_for_each_hand(points: list, move: tuple, wanted: bool) -> None:
    """Grasp and release of each hand lie in the region of an arm of its own."""
    square = np.array([[0, 0], [2, 0], [2, 1], [0, 1]], dtype=float)
    found = within_reach(Manipulation(np.array(points), np.array(move)), [square, square + [2, 0]])
    assert found is wanted


def test_executed_plans_are_kept_as_training_data(tasks: list[Task], tmp_path: Path) -> None:
    """What was carried out can be read as sequences: where hands were sent, what came of it."""
    folder = tmp_path / "kept"
    evaluation = Evaluation(tasks[3:6], ("nothing", "oracle"), "replan", TOWEL, keep=folder)
    evaluate(evaluation, tmp_path / "journal.jsonl")
    oracle = make_rivals(("oracle",), None, None)["oracle"]
    reader = SequenceReader([folder])
    kept = {file.path.stem: sequence for file, sequence in zip(reader.files, reader, strict=True)}
    run = evaluation.identity[:8]
    assert set(kept) == {f"shard_{run}_{task.name}_oracle" for task in tasks[3:6]}
    for task in tasks[3:6]:
        sequence = kept[f"shard_{run}_{task.name}_oracle"]
        assert (len(sequence), sequence.index) == (task.steps, task.sequence)
        wanted = [m.to_network(task.field_of_view)[4:] for m in task.recorded]
        np.testing.assert_allclose(sequence.moves, wanted, atol=1e-5)
        start = Cloth.from_positions(task.start, TOWEL.cloth).positions_in_table
        before = np.packbits(task.grid(start).occupancy)
        assert np.array_equal(sequence.packed_grids[0], before)
        outcome = perform(task, "oracle", oracle, "replan", TOWEL, 0).outcome
        assert np.array_equal(sequence.packed_grids[-1], np.packbits(task.grid(outcome).occupancy))
    with pytest.raises(InvalidInputError, match="another place"):  # some would be missing
        evaluate(replace(evaluation, keep=tmp_path / "later"), tmp_path / "journal.jsonl")
    with pytest.raises(InvalidInputError, match="folder for executed plans"):
        evaluate(replace(evaluation, keep=tmp_path / "journal.jsonl"), tmp_path / "other.jsonl")


def test_unknown_names_are_refused(tasks: list[Task]) -> None:
    """Planners and modes that do not exist are named."""
    with pytest.raises(InvalidInputError, match="dreams"):
        Evaluation(tasks, ("dreams",), "replan", TOWEL)
    with pytest.raises(InvalidInputError, match="mode"):
        Evaluation(tasks, ("nothing",), "closed", TOWEL)


def test_the_shipped_net_predicts_neat_folds() -> None:
    """Of one step: much better than that nothing changes, or that the cloth is gone."""
    net = load_net()
    for task in neat_tasks(preset("towel", (41, 41)).cloth):
        if task.steps > 1 or task.name == "corner":
            continue
        start, goal = task.grid(task.start), task.grid(task.goal).occupancy
        hands = task.recorded[0].to_network(task.field_of_view)
        hands = torch.from_numpy(np.nan_to_num(hands, nan=0.95)).float()
        predicted = net.predict(torch.from_numpy(start.occupancy)[None], hands[None, None])
        error = np.square(predicted[0].numpy() - goal).mean()
        assert error < 0.3 * (start.occupancy != goal).mean(), task.name
        assert error < 0.3 * goal.mean(), task.name
