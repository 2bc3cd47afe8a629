"""What all tests share."""

import pytest
from hypothesis import settings

from emd_cloth_sim.warm_up import compile_kernels, prepare_kernels

# No test fails because the machine is busy.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


def pytest_configure(config: pytest.Config) -> None:
    """Compile once before workers start, rather than in each of them at the same time."""
    if not hasattr(config, "workerinput"):
        prepare_kernels()


@pytest.fixture(scope="session", autouse=True)
def kernels() -> None:
    """Every process loads the same compiled cloth, so that results agree to the bit.

    It does so before a test calls an inner kernel alone: the outer ones would be linked with that
    one then, and might differ in the last bit.
    """
    prepare_kernels()
    compile_kernels()
