"""What all tests share."""

import pytest

from emd_cloth_sim.warm_up import prepare_kernels


@pytest.fixture(scope="session", autouse=True)
def kernels() -> None:
    """Every test process loads the same compiled cloth, so that results are the same to the bit."""
    prepare_kernels()
