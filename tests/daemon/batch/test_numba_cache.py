"""Compiled kernels are kept somewhere, whatever cannot be written."""

import os
from pathlib import Path

import pytest

from daemon.batch.numba_cache import CACHE_VARIABLE, numba_cache_environment
from daemon.batch.paths import StatePaths


@pytest.fixture
def read_only(monkeypatch, tmp_path):
    folder = tmp_path / "site-packages"
    folder.mkdir()
    real = os.access
    monkeypatch.setattr(
        os, "access", lambda path, mode: not Path(path).is_relative_to(folder) and real(path, mode)
    )
    return folder


def test_the_usual_places_are_left_to_numba(tmp_path, read_only):
    usual = (read_only / "__pycache__", tmp_path / "not-yet" / "made")
    assert numba_cache_environment(StatePaths.find(tmp_path), {"A": "1"}, usual) == {"A": "1"}


def test_a_read_only_installation_without_a_home_uses_the_state_directory(tmp_path, read_only):
    usual = (read_only / "__pycache__", read_only / "home" / ".cache")
    found = numba_cache_environment(StatePaths.find(tmp_path), {"A": "1"}, usual)
    assert found == {"A": "1", CACHE_VARIABLE: str(tmp_path / "kernels")}


def test_a_choice_of_the_user_stands(tmp_path, read_only):
    chosen = {CACHE_VARIABLE: "/somewhere"}
    assert numba_cache_environment(StatePaths.find(tmp_path), chosen, (read_only,)) == chosen
