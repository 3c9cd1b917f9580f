"""Commands that fork processes have one thread at that moment: no lock of another one is copied."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from daemon.model.spec import SutReference
from tests.analysis.old_runs import recorded
from tests.analysis.report.recordings import record_all

WATCHED = """
import os
import sys
import threading

from scenario_tui.cli import invoke

def note_threads():
    if os.getpid() == main:
        with open(sys.argv[1], "a") as file:
            file.write(f"{sorted(one.name for one in threading.enumerate())}\\n")

main = os.getpid()
os.register_at_fork(before=note_threads)
invoke(sys.argv[2:])
"""


@pytest.fixture(scope="module")
def traces(tmp_path_factory):
    """Folders of traces: enough to read them by several processes, and two to execute again."""
    folder = tmp_path_factory.mktemp("traces")
    record_all(folder / "many" / "a")
    record_all(folder / "many" / "b")
    for name in ("one", "two"):
        (folder / "few" / name).mkdir(parents=True)
        recorded(folder / "few" / name, sut=SutReference(name, "idle", {}))
    return folder


@pytest.mark.parametrize(
    "words",
    [
        ("judge", "many", "--processes", "2"),
        ("report", "many/a", "--processes", "2"),
        ("verify", "few"),
        ("verify", "few/one/run.mcap"),
    ],
    ids=["judge", "report", "verify two", "verify one"],
)
def test_no_thread_of_a_progress_bar_is_there_when_processes_are_forked(traces, tmp_path, words):
    forks = tmp_path / "forks.txt"
    state = ["--state", str(tmp_path / "state")]
    page = ["--output", str(tmp_path / "page.html")] if words[0] == "report" else []
    # rich takes its word for it that there is a terminal.
    environment = {**os.environ, "FORCE_COLOR": "1", "PYTHONPATH": str(Path.cwd())}
    done = subprocess.run(
        [sys.executable, "-c", WATCHED, str(forks), *words, *state, *page],
        cwd=traces,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert "Traceback" not in done.stderr
    assert set(forks.read_text().splitlines()) == {"['MainThread']"}
