"""``scenario serve`` as people start it: what it says, what it refuses, how it ends."""

import builtins
import os
import re
import signal
import socket
import stat
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

from grammars.model.map_files import read_map
from scenario_tui.cli.exit_codes import ExitCode

COMMAND = [sys.executable, "-c", "from scenario_tui.cli import main; main()", "serve"]
DEADLINE = 120.0


@pytest.fixture
def file(campaigns):
    return str(campaigns / "demo" / "campaign.yaml")


@contextmanager
def served(*arguments):
    process = subprocess.Popen(
        [*COMMAND, *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={k: v for k, v in os.environ.items() if k != "SCENARIO_CONNECT"},
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def said_until(process, last):
    """Read what it says until a line with ``last`` came; the end of the process ends it too."""
    assert process.stderr is not None
    said = ""
    for line in process.stderr:
        said += line
        if last in line:
            return said
    raise AssertionError(f"it never said {last!r}: {said}")


def test_without_a_terminal_it_serves_until_it_is_interrupted(file):
    pytest.importorskip("foxglove")
    pytest.importorskip("websockets")
    from tests.batch.live.foxglove_client import foxglove_client

    with served(file, "--scenario", "busy-house", "--port", "0", "--speed", "3") as process:
        said = said_until(process, "Ctrl-C")
        port = re.search(r"ws://127\.0\.0\.1:(\d+)", said)
        assert port is not None
        with foxglove_client(int(port[1])) as client:
            client.subscribe("/clock", "/ground_truth")
            client.until(lambda: len(client.heard("/clock")) > 5)
        process.send_signal(signal.SIGINT)
        _, rest = process.communicate(timeout=DEADLINE)
        assert process.returncode == ExitCode.EXPECTED
        assert "the world has ended" in rest


def test_a_stack_is_told_what_to_type(file):
    pytest.importorskip("daemon.stacks.ros2.relay_link")
    with served(file, "--ros2", "--no-foxglove") as process:
        said = said_until(process, "Ctrl-C")
        line = re.search(r"^SCENARIO_SOCKET=(\S+) SCENARIO_NONCE=\w+ python3 (\S+)$", said, re.M)
        assert line is not None
        address, relay = Path(line[1]), Path(line[2])
        assert relay.is_file()
        assert stat.S_IMODE(address.stat().st_mode) == 0o600
        assert stat.S_IMODE(address.parent.stat().st_mode) == 0o700
        process.terminate()
        _, rest = process.communicate(timeout=DEADLINE)
        assert process.returncode == ExitCode.EXPECTED
        assert "the world has ended" in rest
        assert not address.parent.exists()


def test_the_map_is_named_that_a_stack_reads_from_a_file(file, scenario, tmp_path, monkeypatch):
    pytest.importorskip("daemon.stacks.ros2.relay_link")
    monkeypatch.chdir(tmp_path)
    scenario("new", "mine", "--nav2")
    arguments = ("mine/campaign.yaml", "--ros2", "--sut", "my-nav2", "--no-foxglove")
    with served(*arguments) as process:
        lines = said_until(process, "Ctrl-C")
        named = re.search(r"^map for the stack: (\S+)$", lines, re.M)
        assert named is not None
        drawn = read_map(Path(named[1])).grid
        assert drawn.resolution == 0.05
        process.terminate()
        process.communicate(timeout=DEADLINE)
    assert not Path(named[1]).exists()


def test_a_port_that_is_taken(scenario, file):
    pytest.importorskip("foxglove")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        left = scenario("serve", file, "--headless", "--port", str(port))
    assert left.code == ExitCode.INFRASTRUCTURE
    assert f"127.0.0.1:{port}" in left.err
    assert "--port 0 takes a free port" in left.err


def test_an_extra_that_is_missing(scenario, file, monkeypatch):
    real = builtins.__import__

    def missing(name, *rest, **more):
        if name == "daemon.live.foxglove_server":
            raise ModuleNotFoundError("No module named 'foxglove'", name="foxglove")
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", missing)
    left = scenario("serve", file, "--headless", "--foxglove")
    assert left.code == ExitCode.INFRASTRUCTURE
    assert "pip install 'scenario-tui[foxglove]'" in left.err
