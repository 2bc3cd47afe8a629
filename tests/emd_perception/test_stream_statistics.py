"""Rates and latencies over the last seconds."""

import pytest

from emd_perception.stream_statistics import WINDOW, StreamStatistics


class Clock:
    """A clock that a test moves."""

    now = 0.0

    def __call__(self) -> float:
        """Seconds."""
        return self.now


def test_figures_are_those_of_the_last_seconds() -> None:
    """30 frames a second come, 15 are served after 40 ms each; what is old is forgotten."""
    clock = Clock()
    statistics = StreamStatistics(clock)
    for index in range(300):
        clock.now = index / 30.0
        statistics.arrived()
        if index % 2 == 0:
            statistics.served(age=0.04, waited=0.01, worked=0.02, refused=index < 10)
    figures = statistics.figures()
    assert float(figures["rate_in_hz"]) == pytest.approx(30.0, abs=0.3)
    assert float(figures["rate_out_hz"]) == pytest.approx(15.0, abs=0.3)
    assert (figures["latency_ms"], figures["work_ms"]) == ("40.0", "20.0")
    assert figures["since_arrival_ms_p95"] == "30.0"
    assert (figures["frames"], figures["frames_refused"]) == ("150", "5")
    clock.now += 2 * WINDOW
    assert statistics.figures()["rate_in_hz"] == "0.0"


def test_stamps_of_another_clock_are_no_latency() -> None:
    """A bag of last year tells nothing about how late an answer is."""
    statistics = StreamStatistics(Clock())
    statistics.served(age=3e7, waited=0.0, worked=0.02, refused=False)
    figures = statistics.figures()
    assert "latency_ms" not in figures
    assert figures["work_ms"] == "20.0"
