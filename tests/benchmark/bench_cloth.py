"""The simulated cloth beside MuJoCo flex, in manipulations a minute, and in lockstep.

The same bimanual half fold of the same sheet, 81 x 81 vertices, runs in both until the hands open,
1.5 simulated seconds, one core each, one after the other. Our cloth is kept from resting, which
would cost nothing. `EMD_BENCH_SPAN` (seconds) lets both go on; MuJoCo takes more than 9 minutes
for 3.5 s, as the layers then touch everywhere. Random manipulations by the rule of the authors'
generator then run on all cores.
"""

import json
import math
import os
import subprocess
import sys
import time
from dataclasses import replace

import mujoco
import numpy as np

from emd_cell.bench import BenchmarkResult
from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.manipulate import manipulate
from emd_cloth_sim.presets import preset
from emd_cloth_sim.random_manipulation import ManipulationRule
from emd_cloth_sim.warm_up import compile_kernels
from emd_core.frames import FieldOfView

MESH = 81
FOLD_TIME, LOCKSTEP_SPAN = 1.5, 3.5
LIFT = 0.07
SEQUENCES_A_CORE, STEPS = 4, 3
# The authors' generator under Blender 5.0, one core, mean over the shared reference sequences.
REFERENCE_SECONDS = 18.0
MUJOCO_STEP = 0.002


def run() -> BenchmarkResult:
    """Time the fold in both engines, the lockstep at 41 x 41, and random manipulations."""
    compile_kernels()
    span = float(os.environ.get("EMD_BENCH_SPAN", FOLD_TIME))
    rows = [_ours(MESH, span), _mujoco(MESH, span), _ours(41, LOCKSTEP_SPAN), _manipulations()]
    ours, theirs, lockstep, manipulations = rows
    config = {
        "fold": "both corners of one side carried to the other in 1.5 s along an arc",
        "vertices": [MESH, MESH],
        "simulated_seconds": span,
        "mujoco": {"solver": "CG", "timestep": MUJOCO_STEP, "version": theirs.pop("version")},
        "sequences": SEQUENCES_A_CORE * manipulations["cores"],
        "steps": STEPS,
    }
    summary = {
        "ratio_to_mujoco": theirs["wall_per_simulated_s"] / ours["wall_per_simulated_s"],
        "manipulations_per_minute": manipulations["manipulations_per_minute"],
        "seconds_per_manipulation_and_core": manipulations["core_seconds_each"],
        "reference_seconds_per_manipulation": REFERENCE_SECONDS,
        "real_time_factor_41": 1.0 / lockstep["wall_per_simulated_s"],
    }
    return BenchmarkResult(config, rows, summary)


def _hand(corner: float, side: float, seconds: float) -> tuple[float, float, float]:
    """Where the hand at y = `corner` is; it starts at x = -side / 2 on the desk."""
    share = 0.5 - 0.5 * math.cos(math.pi * min(seconds / FOLD_TIME, 1.0))
    return (
        side * (share - 0.5),
        corner,
        0.0015 + 0.003 * share + LIFT * math.sin(math.pi * share),
    )


def _ours(mesh: int, span: float) -> dict:
    """The fold in lockstep with hands that move every 1/240 s; a cloth that never rests."""
    chosen = preset("towel", (mesh, mesh)).cloth
    cloth = Cloth(replace(chosen, settle_speed=1e-12))
    side = chosen.side_lengths[0]
    corners = (-0.5 * chosen.side_lengths[1], 0.5 * chosen.side_lengths[1])
    for hand, corner in enumerate(corners):
        cloth.grasp(hand, _tool(_hand(corner, side, 0.0)))
    start, simulated = time.perf_counter(), 0.0
    while simulated < span - 1e-9:
        simulated += chosen.step
        for hand, corner in enumerate(corners):
            if cloth.held_count(hand) and simulated > FOLD_TIME:
                cloth.release(hand)
            cloth.move_hand(hand, _tool(_hand(corner, side, simulated)))
        cloth.advance(chosen.step)
    wall = time.perf_counter() - start
    result = cloth.check()
    return {
        "engine": "emd_cloth_sim",
        "mesh": mesh,
        "wall_s": wall,
        "wall_per_simulated_s": wall / simulated,
        "stretch_p99": result.stretch_p99,
        "crossings": result.crossings,
    }


def _tool(position: tuple[float, float, float]) -> np.ndarray:
    transform = np.diag([1.0, -1.0, -1.0, 1.0])
    transform[:3, 3] = position
    return transform


def _mujoco(mesh: int, span: float) -> dict:
    """The fold in MuJoCo: a flex whose edges keep their lengths, and mocap hands."""
    chosen = preset("towel").cloth
    side, corner = chosen.side_lengths[0], 0.5 * chosen.side_lengths[1]
    model = mujoco.MjModel.from_xml_string(_flex(mesh))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    start = time.perf_counter()
    while data.time < span - 1e-9:
        for hand, y in enumerate((-corner, corner)):
            data.mocap_pos[hand] = _hand(y, side, data.time)
        if data.time > FOLD_TIME:
            data.eq_active[:2] = 0
        mujoco.mj_step(model, data)
    wall = time.perf_counter() - start
    grid = data.flexvert_xpos.reshape(mesh, mesh, 3)
    lengths = np.concatenate(
        [np.linalg.norm(np.diff(grid, axis=axis), axis=2).ravel() for axis in (0, 1)]
    )
    return {
        "engine": "MuJoCo flex",
        "version": mujoco.__version__,
        "mesh": mesh,
        "wall_s": wall,
        "wall_per_simulated_s": wall / data.time,
        "stretch_p99": float(np.percentile(lengths, 99) / (side / (mesh - 1))),
        "contacts": int(data.ncon),
    }


def _flex(mesh: int) -> str:
    """The same sheet, desk and hands as a MuJoCo model."""
    cloth = preset("towel", (mesh, mesh)).cloth
    side, spacing = cloth.side_lengths[0], cloth.spacing[0]
    mass = cloth.areal_density * side * side
    radius = 0.5 * cloth.thickness
    hands = "".join(
        f'<body name="hand{hand}" mocap="true" pos="{-side / 2} {y} {radius}"/>'
        for hand, y in enumerate((-side / 2, side / 2))
    )
    return f"""<mujoco>
<option timestep="{MUJOCO_STEP}" solver="CG" tolerance="1e-6" integrator="implicitfast"/>
<size memory="4G"/>
<worldbody>
<geom type="plane" size="1 1 0.1" friction="{cloth.desk_friction} 0 0" condim="3"/>
{hands}
<flexcomp name="cloth" type="grid" dim="2" count="{mesh} {mesh} 1" pos="0 0 {radius}"
  spacing="{spacing} {spacing} {spacing}" radius="{radius}" mass="{mass}">
<edge equality="true" damping="0.001" solref="{2 * MUJOCO_STEP} 1"/>
<contact selfcollide="auto" condim="3" friction="{cloth.cloth_friction} 0 0"
  solref="{2 * MUJOCO_STEP} 1"/>
</flexcomp>
</worldbody>
<equality>
<connect body1="hand0" body2="cloth_0" anchor="0 0 0"/>
<connect body1="hand1" body2="cloth_{mesh - 1}" anchor="0 0 0"/>
</equality>
</mujoco>"""


def _manipulations() -> dict:
    """Random sequences at 81 x 81, a process for each core that starts when compiled."""
    cores = len(os.sched_getaffinity(0))
    seeds = [str(seed) for seed in range(SEQUENCES_A_CORE * cores)]
    workers = [
        subprocess.Popen([sys.executable, __file__, *seeds[core::cores]], stdout=subprocess.PIPE)
        for core in range(cores)
    ]
    results = [json.loads(worker.communicate()[0]) for worker in workers]
    steps = [step for result in results for step in result["steps"]]
    wall = max(result["wall_s"] for result in results)
    return {
        "engine": "emd_cloth_sim",
        "mesh": MESH,
        "cores": cores,
        "manipulations": len(steps),
        "wall_s": wall,
        "manipulations_per_minute": 60.0 * len(steps) / wall,
        "core_seconds_each": sum(step["core_s"] for step in steps) / len(steps),
        "failed": sum(bool(step["failure"]) for step in steps),
        "worst_stretch_p99": max(step["stretch_p99"] for step in steps),
    }


def _work(seeds: list[int]) -> dict:
    """Simulate sequences one after the other."""
    compile_kernels()
    start = time.perf_counter()
    steps = [step for seed in seeds for step in _sequence(seed)]
    return {"wall_s": time.perf_counter() - start, "steps": steps}


def _sequence(seed: int) -> list[dict]:
    chosen = preset("towel", (MESH, MESH))
    cloth, rng, steps = Cloth(chosen.cloth), np.random.default_rng(seed), []
    for _ in range(STEPS):
        manipulation = ManipulationRule("any").draw(cloth, FieldOfView(), rng)
        start = time.process_time()
        result = manipulate(cloth, manipulation, chosen.path).diagnostics
        steps.append(
            {
                "core_s": time.process_time() - start,
                "failure": result.failure,
                "stretch_p99": result.stretch_p99,
            }
        )
    return steps


if __name__ == "__main__":
    print(json.dumps(_work([int(seed) for seed in sys.argv[1:]])))
