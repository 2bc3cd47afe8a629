"""What all tests share."""

import pytest

from emd_cloth_sim.warm_up import prepare_kernels


@pytest.fixture(scope="session", autouse=True)
def kernels() -> None:
    """Every process loads the same compiled cloth, so that results agree to the bit."""
    prepare_kernels()
