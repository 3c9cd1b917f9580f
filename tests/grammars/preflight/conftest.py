"""The robot of the tests of pre-flight: 0.699 m x 0.466 m, 0.289 m high."""

from __future__ import annotations

from pathlib import Path

import pytest

from grammars.model.robot import Robot
from grammars.model.robot_files import load_robot


@pytest.fixture(scope="package")
def robile(campaigns: Path) -> Robot:
    return load_robot(campaigns / "robots" / "robile.yaml")
