"""Compiles the solver before a simulation runs, so that no clock stands still in its middle."""

from __future__ import annotations

import subprocess
import sys

import numpy as np

from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig


def compile_kernels() -> None:
    """Fold a small cloth once; Numba keeps what it compiles for later processes.

    It takes some ten seconds the first time and little afterwards.
    """
    config = ClothConfig(side_lengths=(0.10, 0.10), vertices=(11, 11))
    cloth = Cloth(config)
    hand = np.eye(4)
    hand[:3, 3] = cloth.positions_in_table[0]
    cloth.grasp(0, hand)
    for height in (0.0, 0.01, 0.02):
        hand[2, 3] = height
        hand[:2, 3] += 0.01
        cloth.move_hand(0, hand)
        cloth.advance(1.0 / 60.0)
    cloth.release(0)
    cloth.advance(1.0 / 60.0)
    Cloth.from_positions(cloth.positions_in_table, config).check()


def prepare_kernels() -> None:
    """Compile the solver in a process of its own, so that this one loads what every other loads.

    What a process compiles itself may differ in the last bit from what it would have loaded, as
    its linker sees the kernels in another order; results must not depend on who came first.
    """
    script = f"from {__name__} import compile_kernels; compile_kernels()"
    subprocess.run([sys.executable, "-c", script], check=True)
