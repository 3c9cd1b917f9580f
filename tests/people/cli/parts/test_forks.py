"""Commands that fork processes have one thread at that moment: no lock of another one is copied."""

import json
import os
import subprocess
import sys

from daemon.model.spec import SutReference
from tests.analysis.old_runs import recorded
from tests.parts import ROOT

WATCHED = """
import json
import os
import sys
import threading

from daemon.analysis import parallel_map
from scenario_tui.cli import invoke

def note_threads():
    if os.getpid() == main:
        threads = sorted(one.name for one in threading.enumerate())
        with open(sys.argv[1], "a") as file:
            file.write(json.dumps([command, threads]) + "\\n")

main = os.getpid()
parallel_map._FEW = 1
os.register_at_fork(before=note_threads)
for command in json.loads(sys.argv[2]):
    invoke(command.split())
"""
COMMANDS = [
    "judge traces --processes 2",
    "verify traces/one.mcap -n 1",
]


def test_no_thread_of_a_progress_bar_is_there_when_processes_are_forked(tmp_path):
    (tmp_path / "traces").mkdir()
    for name in ("one", "two"):
        trace, _ = recorded(tmp_path, sut=SutReference(name, "idle", {}))
        trace.rename(tmp_path / "traces" / f"{name}.mcap")
    forks = tmp_path / "forks.txt"
    # rich takes its word for it that there is a terminal.
    words = {"FORCE_COLOR": "1", "PYTHONPATH": str(ROOT), "SCENARIO_STATE": str(tmp_path / "state")}
    done = subprocess.run(
        [sys.executable, "-c", WATCHED, str(forks), json.dumps(COMMANDS)],
        cwd=tmp_path,
        env=os.environ | words,
        capture_output=True,
        text=True,
    )
    assert "Traceback" not in done.stderr
    threads = [json.loads(line) for line in forks.read_text().splitlines()]
    assert {command for command, _ in threads} == set(COMMANDS)
    assert all(names == ["MainThread"] for _, names in threads)
