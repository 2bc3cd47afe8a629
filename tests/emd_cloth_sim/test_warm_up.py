"""The warm-up compiles what a fold needs."""

from emd_cloth_sim import contact, xpbd
from emd_cloth_sim.warm_up import compile_kernels


def test_a_fold_compiles_nothing_more_after_the_warm_up() -> None:
    """Every compiled function of the solver has a signature once the warm-up is through."""
    compile_kernels()
    kernels = [
        value
        for module in (contact, xpbd)
        for value in vars(module).values()
        if hasattr(value, "nopython_signatures")
    ]
    assert kernels
    assert all(kernel.nopython_signatures for kernel in kernels)
