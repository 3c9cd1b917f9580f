"""Children are ours wherever they are started."""

import platform
import subprocess
import sys

import pytest

from daemon.model.execution import (
    available_cores,
    machine_text,
    python_command,
)
from tests.make import make_submission
from tests.parts import daemon_at, eventually, finished

WORKER = """
import sys
from daemon.batch.worker import work
work(sys.argv[1], slots=1, executor="tests.fake_run:execute")
"""


@pytest.fixture
def foreign(tmp_path):
    """A folder in which somebody keeps modules that have our names."""
    for name in ("daemon", "templates", "scenario_tui"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('somebody else')")
    return tmp_path


def test_a_module_in_the_current_folder_is_never_taken_for_ours(foreign):
    words = ("-m", "daemon", "serve", "{}")
    theirs = subprocess.run([sys.executable, *words], cwd=foreign, capture_output=True, text=True)
    assert "somebody else" in theirs.stderr
    ours = subprocess.run(python_command(*words), cwd=foreign, capture_output=True, text=True)
    assert "Missing required argument" in ours.stderr


def test_a_zygote_is_ours_too(foreign, tmp_path):
    """Also when its parent, like the ``scenario`` command, was not started with ``-P``."""
    script = foreign / "scripts" / "command.py"
    script.parent.mkdir()
    script.write_text(WORKER)
    with daemon_at(tmp_path / "state") as daemon, daemon.client() as client:
        client.submit(make_submission("c", 1))
        command = [sys.executable, str(script), daemon.endpoint]
        with subprocess.Popen(command, cwd=foreign, stderr=subprocess.PIPE) as worker:
            try:
                eventually(lambda: finished(client, 1) or worker.poll() is not None, 60.0)
            finally:
                worker.terminate()
        assert finished(client, 1)


def test_a_machine_is_told_by_its_processor_and_cores_and_not_by_its_name():
    said = machine_text()
    assert f"{available_cores()} core" in said
    assert platform.python_version() in said
    assert platform.node() not in said
    assert all(part.strip() for part in said.split(","))
