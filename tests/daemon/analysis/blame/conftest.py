"""Shared by the tests of blame."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest


@pytest.fixture
def folder(tmp_path: Path, campaigns: Path) -> Path:
    """The demonstration's layers, to write campaigns beside."""
    for name in ("demo", "robots", "suts"):
        shutil.copytree(campaigns / name, tmp_path / name)
    return tmp_path / "demo"
