"""What the tests of daemons stand on: ports of their own, and parts that are forked."""

import signal
import subprocess

import pytest

from tests.parts import ROOT, Part, free_endpoint
from tests.prepared_parts import PreparedProcess, start_prepared


def test_a_forked_part_is_a_process_as_others_are(tmp_path):
    state = tmp_path / "state"
    options = ("--state", str(state), "--listen", free_endpoint(), "--slots", "0")
    first = Part("serve", tmp_path / "first.log", *options)
    assert isinstance(first.process, PreparedProcess)
    with pytest.raises(subprocess.TimeoutExpired):
        first.wait(0.0)
    first.kill()
    assert first.process.poll() == -signal.SIGKILL
    wrong = Part("serve", tmp_path / "wrong.log", "--slots", '"none"')
    assert wrong.wait() == 1
    assert "unable to parse string as an integer" in wrong.output


def test_where_python_is_set_up_otherwise_a_part_is_not_forked(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    assert start_prepared(["daemon", "serve"], ROOT, 1) is None
    part = Part("serve", tmp_path / "log", "--slots", '"none"')
    assert isinstance(part.process, subprocess.Popen)
    assert part.wait() == 1
