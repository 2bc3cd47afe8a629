"""Claims about the hands' path of the authors' generator."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.manipulate import manipulate
from emd_cloth_sim.presets import preset
from emd_cloth_sim.reference_path import ReferencePathConfig, reference_offsets
from emd_core.errors import InvalidInputError
from emd_core.manipulation import Manipulation

REFERENCE = Path(__file__).parents[2].parent / "shared" / "data" / "blender_reference"
CONFIG = ReferencePathConfig(half_extent=1.0)


def test_path_has_the_quirks_of_the_generator() -> None:
    """It starts beside the grasp, the more the shorter the way, and ends one lift above it."""
    for length in (0.1, 0.5, 1.4):
        offsets = reference_offsets(np.array([0.0, -length]), CONFIG)
        np.testing.assert_allclose(offsets[0], [0.0, -0.03125 / length, 0.0], atol=1e-9)
        assert offsets[-2, 2] == pytest.approx(0.25)
        assert offsets[-1, 2] == pytest.approx(0.25 * (1.0 - CONFIG.sink))
        frames = np.ceil(np.hypot(0.25, length) / 0.05)
        assert len(offsets) == frames + 2


def test_path_ends_where_the_reference_hand_ended() -> None:
    """Ends of all recorded manipulations agree to half precision."""
    files = sorted(REFERENCE.glob("*.npz"))
    if not files:
        pytest.skip("the shared reference sequences are not here")
    for path in files:
        with np.load(path) as stored:
            moves, ends = stored["moves"][0], stored["hand_displacements"][0]
        ours = [reference_offsets(move, CONFIG)[-1, :2] for move in moves.astype(np.float64)]
        np.testing.assert_allclose(ours, ends, atol=2e-3)


@pytest.mark.parametrize(
    "values",
    [
        {"lift": 0.0},
        {"hand_speed": 0.0},
        {"sink": 1.5},
        {"frames_after": -1},
        {"frames_more": -1},
        {"frame": float("nan")},
    ],
)
def test_bad_path_is_rejected(values: dict) -> None:
    """A value out of range raises InvalidInputError."""
    with pytest.raises(InvalidInputError):
        ReferencePathConfig(**values)


def test_path_needs_a_displacement() -> None:
    """A displacement of zero, by whose length the generator divides, is rejected."""
    with pytest.raises(InvalidInputError):
        reference_offsets(np.zeros(2), CONFIG)


def test_a_jump_of_the_hand_tears_nothing() -> None:
    """A short move, which begins with a long jump, is made no faster than the hand can."""
    chosen = preset("reference", (21, 21))
    cloth = Cloth(chosen.cloth)
    grasp = np.array([[0.15, 0.15], [np.nan, np.nan]])
    outcome = manipulate(cloth, Manipulation(grasp, np.array([0.015, 0.0])), chosen.path)
    jump = 0.03125 * chosen.path.half_extent**2 / 0.015
    assert outcome.carry_time > jump / chosen.path.hand_speed > 5 * chosen.path.frame
    assert outcome.diagnostics.failure == ""


def test_a_cloth_that_is_stretched_too_far_gets_more_time() -> None:
    """Beyond its frames the reference's path waits for strain to go, up to a bound."""
    chosen = preset("reference", (21, 21))
    manipulation = Manipulation(np.array([[0.15, 0.15], [np.nan, np.nan]]), np.array([-0.2, 0.0]))
    usual = manipulate(Cloth(chosen.cloth), manipulation, chosen.path)
    strict = Cloth(replace(chosen.cloth, max_stretch=1e-6))
    more = manipulate(strict, manipulation, chosen.path)
    assert usual.settle_time == pytest.approx(chosen.path.frames_after * chosen.path.frame)
    frames = chosen.path.frames_after + chosen.path.frames_more
    assert more.settle_time == pytest.approx(frames * chosen.path.frame)
