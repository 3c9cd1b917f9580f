"""ROS 2 for tests: a test that asks for it runs once for each distribution.

Without the environments (`make test-ros2` makes them) such tests are skipped and say so.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import pytest

from daemon.stacks.ros2.isolation import lock_domain
from tests.ros2.environment import DISTRIBUTIONS, environment_python


@dataclass(frozen=True)
class Ros2Environment:
    """A ROS 2 that tests may start processes in."""

    distribution: str
    python: Path

    @property
    def prefix(self):
        """Where it is installed: `share/<package>` and the like."""
        return self.python.parents[1]


def pytest_generate_tests(metafunc):
    if "distribution" in metafunc.fixturenames:
        one = metafunc.definition.get_closest_marker("one_distribution")
        chosen = DISTRIBUTIONS[-1:] if one else DISTRIBUTIONS
        metafunc.parametrize("distribution", chosen, scope="session")


@pytest.fixture(scope="session")
def ros2_environment(distribution):
    python = environment_python(distribution)
    if python is None:
        pytest.skip(
            f"no ROS 2 environment for {distribution}, or an outdated one: `make test-ros2`, or"
            f" `python -m tests.ros2.environment {distribution}`"
        )
    return Ros2Environment(distribution, python)


@pytest.fixture(scope="session")
def ros2_python(ros2_environment):
    return ros2_environment.python


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
