"""Scenes and data that several tests share."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from perception_scenes import (  # noqa: E402  (the folder must be on the path first)
    BLUE,
    GREY,
    LIGHT_BLUE,
    WHITE,
    Layer,
    Scene,
    rectangle,
    render,
)

SHARED_DATA = Path(__file__).parents[2].parent / "shared" / "data"


@pytest.fixture(scope="session")
def flat_scene() -> Scene:
    """A flat blue cloth of 0.4 m, turned a little, 3 mm high."""
    return render([Layer(rectangle(0.4, 0.4, turn=0.2), 0.003, BLUE)], frames=3)


@pytest.fixture(scope="session")
def folded_scene() -> Scene:
    """A cloth with its nearer half doubled (6 mm), its inside of another colour."""
    layers = [
        Layer(rectangle(0.4, 0.4), 0.003, BLUE),
        Layer(rectangle(0.2, 0.4, (0.1, 0.0)), 0.006, LIGHT_BLUE),
    ]
    return render(layers, seed=3, frames=8)


@pytest.fixture(scope="session")
def hand_scene() -> Scene:
    """A white cloth, a corner of it hidden by a grey hand that reaches in from the border."""
    layers = [
        Layer(rectangle(0.4, 0.4, turn=0.2), 0.003, WHITE),
        Layer(rectangle(0.18, 0.08, (0.24, 0.16), 0.3), 0.06, GREY, is_cloth=False),
        Layer(rectangle(0.3, 0.1, (0.37, 0.2), 0.3), 0.14, GREY, is_cloth=False),
    ]
    return render(layers, seed=5)


@pytest.fixture(scope="session")
def empty_scene() -> Scene:
    """The bare table."""
    return render([], seed=6)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Data that are not part of the project; tests that need them are skipped elsewhere."""
    if not SHARED_DATA.is_dir():
        pytest.skip("needs the recorded frames of ../shared/data, which are not distributed")
    return SHARED_DATA
