"""The report of a demo."""

from __future__ import annotations

import json

from emd_cell.report import DemoReport, Score, StepReport


def test_only_what_was_carried_out_counts(tmp_path):
    """A manipulation that was planned and refused is told, but not counted."""
    done = StepReport(plan_ms=1.0, executed=Score(0.01, 0.9, 0.01))
    refused = StepReport(plan_ms=1.0, error={"code": 10, "name": "INVALID_INPUT", "message": ""})
    report = DemoReport("half", 0, "./cell demo", steps=[done, refused])
    assert report.carried_out == 1
    report.write(tmp_path / "report.json")
    assert len(json.loads((tmp_path / "report.json").read_text())["steps"]) == 2
