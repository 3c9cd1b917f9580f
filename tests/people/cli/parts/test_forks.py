"""Commands that fork processes have one thread at that moment: no lock of another one is copied."""

import os
import shutil
import threading

import pytest

from daemon.analysis import parallel_map
from scenario_tui.cli import invoke
from tests.analysis.old_runs import IDLE, recorded


@pytest.mark.parametrize("command", ["judge . --processes 2", "verify run.mcap -n 1"])
def test_no_thread_of_a_progress_bar_is_there_when_processes_are_forked(
    command, tmp_path, monkeypatch
):
    path, _ = recorded(tmp_path, sut=IDLE)
    shutil.copy(path, tmp_path / "again.mcap")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("FORCE_COLOR", "1")  # rich takes its word for it that there is a terminal
    monkeypatch.setattr(parallel_map, "_FEW", 1)
    earlier, started, fork = set(threading.enumerate()), [], os.fork

    def note_threads():
        started.append(set(threading.enumerate()) - earlier)
        return fork()

    monkeypatch.setattr(os, "fork", note_threads)
    invoke(command.split())
    assert started
    assert not any(started)
