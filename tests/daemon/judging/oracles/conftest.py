"""Shared by the oracle tests."""

import pytest

from daemon.judging.oracles import warm_up


@pytest.fixture(scope="session", autouse=True)
def compiled_kernels():
    """Compile before the first test, so that no test pays for it."""
    warm_up()
