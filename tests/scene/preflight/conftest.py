"""The robot of the tests of pre-flight: 0.699 m x 0.466 m, 0.289 m high."""

import pytest

from grammars.model.robot_files import load_robot


@pytest.fixture(scope="package")
def robile(campaigns):
    return load_robot(campaigns / "robots" / "robile.yaml")
