"""The warm-up compiles what a fold needs."""

import importlib
import pkgutil

import emd_cloth_sim
from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.manipulate import manipulate
from emd_cloth_sim.neat_folds import neat_fold
from emd_cloth_sim.warm_up import compile_kernels


def compiled() -> dict[str, list]:
    """Signatures of every compiled function of the package."""
    found = {}
    for module in pkgutil.iter_modules(emd_cloth_sim.__path__):
        for name, value in vars(importlib.import_module(f"emd_cloth_sim.{module.name}")).items():
            if hasattr(value, "nopython_signatures"):
                found[f"{module.name}.{name}"] = list(value.nopython_signatures)
    return found


def test_a_fold_compiles_nothing_more_after_the_warm_up() -> None:
    """A fold of a larger cloth needs no signature that the warm-up has not compiled."""
    compile_kernels()
    before = compiled()
    config = ClothConfig(vertices=(15, 15))
    manipulate(Cloth(config), neat_fold("half", config).manipulations[0])
    assert any(before.values())
    assert compiled() == before
