"""Shared by the tests of blame."""

import shutil

import pytest


@pytest.fixture
def folder(tmp_path, campaigns):
    """The demonstration's layers, to write campaigns beside."""
    for name in ("demo", "robots", "suts"):
        shutil.copytree(campaigns / name, tmp_path / name)
    return tmp_path / "demo"
