"""Units that systemd takes, with paths that need quoting, and time to finish what runs."""

import configparser
import os
import re
import shutil
import subprocess
import tempfile

import pytest

from daemon.batch.server import DaemonSettings
from daemon.batch.systemd import daemon_unit, worker_unit
from daemon.model.execution import RunLimits

AWKWARD = '/srv/my robots/50%/$HOME/"x"\\y'


def parsed(unit):
    parser = configparser.ConfigParser(interpolation=None)
    parser.optionxform = str
    parser.read_string(unit)
    return parser


def words(line):
    """The words of a command as systemd.service(5) reads them."""
    quoted = re.findall(r'"((?:[^"\\]|\\.)*)"', line)
    assert " ".join(f'"{word}"' for word in quoted) == line
    return [re.sub(r"\\(.)", r"\1", word).replace("%%", "%").replace("$$", "$") for word in quoted]


def test_the_daemon_is_given_the_time_its_drain_takes():
    command = [AWKWARD, "daemon", "--state", AWKWARD, "--traces", "s3://bucket/50%"]
    service = parsed(daemon_unit(command))["Service"]
    assert words(service["ExecStart"]) == ["/usr/bin/env", *command]
    assert service["KillMode"] == "mixed"
    # After its patience it gives its worker two last moments of 3 s, then it is gone.
    assert float(service["TimeoutStopSec"]) >= DaemonSettings().patience + 6.0
    assert service["Restart"] == "on-failure"


def test_a_worker_is_given_the_time_of_a_run():
    command = ["/bin/scenario", "worker", "--connect", "tcp/far:7447"]
    service = parsed(worker_unit(command, RunLimits()))["Service"]
    assert words(service["ExecStart"]) == command
    assert float(service["TimeoutStopSec"]) > RunLimits().wall_of(0.0)
    assert (service["KillMode"], service["Restart"]) == ("mixed", "always")
    # It starts before its daemon does after a power cut: that it was refused is no reason to stay.
    assert "RestartPreventExitStatus" not in service


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze")
def test_systemd_takes_them(tmp_path):
    for name in ("plain", "my 100% robots", 'a "b" $HOME'):
        folder = tmp_path / name
        folder.mkdir()
        command = folder / "scenario"
        command.write_text("#!/bin/sh\n")
        command.chmod(0o755)
        (folder / "daemon.service").write_text(daemon_unit([str(command), "daemon", str(folder)]))
        words = [str(command), "worker", "--state", str(folder)]
        (folder / "worker.service").write_text(worker_unit(words, RunLimits()))
        done = _verify(folder)
        assert (done.returncode, done.stderr) == (0, "")
    unit = folder / "daemon.service"
    unit.write_text(unit.read_text().replace("mixed", "nonsense"))
    assert "nonsense" in _verify(folder).stderr


def _verify(folder):
    # Not the folder of the test: paths of the sockets of others in it would be too long.
    with tempfile.TemporaryDirectory() as runtime:
        return subprocess.run(
            ["systemd-analyze", "--user", "verify", "daemon.service", "worker.service"],
            cwd=folder, capture_output=True, text=True, check=False,
            env={**os.environ, "XDG_RUNTIME_DIR": runtime},
        )  # fmt: skip
