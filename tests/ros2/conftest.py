"""ROS 2 for tests: a test that asks for it runs once for each distribution.

Without the environments (`make test-ros2` makes them) such tests are skipped and say so.
"""

import os

import pytest

from daemon.stacks.ros2.isolation import lock_domain
from tests.ros2.environment import DISTRIBUTIONS, environment_python


def pytest_generate_tests(metafunc):
    if "distribution" in metafunc.fixturenames:
        one = metafunc.definition.get_closest_marker("one_distribution")
        chosen = DISTRIBUTIONS[-1:] if one else DISTRIBUTIONS
        metafunc.parametrize("distribution", chosen, scope="session")


@pytest.fixture(scope="session")
def ros2_python(distribution):
    python = environment_python(distribution)
    if python is None:
        pytest.skip(
            f"no ROS 2 environment for {distribution}, or an outdated one: `make test-ros2`, or"
            f" `python -m tests.ros2.environment {distribution}`"
        )
    return python


@pytest.fixture
def ros2_variables(tmp_path):
    """Environment of processes that hear each other and nobody else: a domain of their own."""
    # As runs get theirs, which may go on beside this test.
    domain, held = lock_domain(None)
    with held:
        yield {
            "PATH": os.environ["PATH"],
            "HOME": str(tmp_path),
            "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        }
