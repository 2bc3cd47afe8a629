"""Which plans fail, learned from the reports of executed ones."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from emd_cell.evaluation.doubt import draw, judge, read_executed
from emd_core.errors import InvalidInputError
from emd_planner.trust import TrustModel, fit_trust


def _report(path: Path, count: int, seed: int) -> Path:
    """Plans that fail the more often the worse they are expected to end."""
    rng = np.random.default_rng(seed)
    records = []
    for number in range(count):
        ratio = rng.uniform(0.1, 0.9)
        came = 0.1 * (0.7 if rng.random() < ratio else 0.2)
        figures = {
            "expected_error": 0.1 * ratio,
            "initial_loss": 0.1,
            "reconstruction_loss": 0.005,
            "steps": 1 + number % 2,
        }
        for mode in ("open", "replan"):
            records.append(
                {
                    "planner": "ours",
                    "mode": mode,
                    "voxel_mse": came,
                    "idle_mse": 0.1,
                    "failure": "",
                    "figures": figures,
                }
            )
    records.append({**records[0], "planner": "paper"})
    records.append({**records[0], "failure": "the simulation failed"})
    records.append({**records[0], "planner": "ours", "figures": None})
    path.write_text(json.dumps({"records": records}))
    return path


def test_plans_executed_as_a_whole_are_read(tmp_path: Path) -> None:
    """Of replanned tasks those of one step count too; failed simulations do not."""
    plans = read_executed([_report(tmp_path / "a.json", 10, 0)])
    assert len(plans) == 10 + 5
    for wrong in ("{}", '{"records": []}'):
        (tmp_path / "wrong.json").write_text(wrong)
        with pytest.raises(InvalidInputError, match="evaluate"):
            read_executed([tmp_path / "wrong.json"])


def test_doubt_is_judged_by_other_plans(tmp_path: Path) -> None:
    """A fitted model ranks plans better than chance and tells the share that fails."""
    plans = read_executed([_report(tmp_path / "a.json", 400, 0)])
    others = read_executed([_report(tmp_path / "b.json", 400, 1)])
    model = fit_trust([p.figures for p in plans], [p.failed for p in plans])
    report = judge(model, others)
    assert report.auroc > 0.7 and report.brier < 0.9 * report.brier_of_rate
    np.testing.assert_allclose(report.foretold, report.came, atol=0.15)
    assert report.foretold == tuple(sorted(report.foretold))
    blind = TrustModel((0.3, 0.0, 0.0, 0.0, 0.0), 1, 1)
    assert judge(blind, others).auroc == pytest.approx(0.5)
    draw({"learned from": judge(model, plans), "others": report}, tmp_path / "doubt.png")
    assert Image.open(tmp_path / "doubt.png").size == (550, 550)


def test_nothing_is_judged_without_failures(tmp_path: Path) -> None:
    """All plans of one kind."""
    plans = [p for p in read_executed([_report(tmp_path / "a.json", 40, 0)]) if not p.failed]
    with pytest.raises(InvalidInputError, match="failed"):
        judge(TrustModel((0.0,) * 5, 1, 1), plans)
