"""Layers to write campaigns beside."""

import shutil
from pathlib import Path

import pytest


@pytest.fixture
def demo(tmp_path, campaigns):
    """A copy of the folder of the demonstration."""
    return Path(shutil.copytree(campaigns / "demo", tmp_path / "demo"))
