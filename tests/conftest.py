"""Motions and videos with known answers, made once for all tests of a run."""

import os
from pathlib import Path

import pytest

for pool in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(pool, "1")  # the tests run side by side: one core each


@pytest.fixture(scope="session")
def shared() -> Path:
    """Return the folder of real recordings and reference numbers, which a user's checkout does not have."""
    folder = Path(__file__).parents[2] / "shared"
    if not folder.is_dir():
        pytest.skip("needs the reference data beside the checkout")
    return folder
