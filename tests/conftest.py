"""Motions and videos with known answers, made once for all tests of a run."""

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# Tests never time: a slow machine must not turn a property red. Derandomised, so that a red run can be repeated.
settings.register_profile(
    "tagsway", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow], database=None
)
settings.load_profile("tagsway")

for pool in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(pool, "1")  # the tests run side by side: one core each


@pytest.fixture(scope="session")
def shared() -> Path:
    """Return the folder of real recordings and reference numbers, which a user's checkout does not have."""
    folder = Path(__file__).parents[2] / "shared"
    if not folder.is_dir():
        pytest.skip("needs the reference data beside the checkout")
    return folder
