"""``scenario serve`` as people start it: what it says, what it refuses, how it ends."""

import builtins
import re
import signal
import socket
import stat
import subprocess
from contextlib import ExitStack
from itertools import takewhile
from pathlib import Path

import pytest

from grammars.model.map_files import read_map
from grammars.text.plugins import install_command
from scenario_tui.cli.answer import ExitCode
from tests.parts import DEADLINE
from tests.people.cli.real import COMMAND


@pytest.fixture
def file(campaigns):
    return str(campaigns / "demo" / "campaign.yaml")


def test_without_a_terminal_it_serves_until_it_is_interrupted(scenario, tmp_path, monkeypatch):
    for module in ("foxglove", "websockets", "daemon.stacks.ros2.link"):
        pytest.importorskip(module)
    from tests.batch.live.foxglove_client import foxglove_client

    monkeypatch.chdir(tmp_path)
    scenario("new", "mine", "--nav2")
    how = ("--ros2", "--foxglove", "--sut", "my-nav2", "--port", "0", "--speed", "3")
    command = [*COMMAND, "serve", "mine/campaign.yaml", *how]
    pipes = {"stdin": subprocess.DEVNULL, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, text=True, **pipes) as process, ExitStack() as left:
        left.callback(process.kill)
        said = "".join(takewhile(lambda line: "Ctrl-C" not in line, process.stderr))
        port = re.search(r"ws://127\.0\.0\.1:(\d+)", said)
        with foxglove_client(int(port[1])) as client:
            client.subscribe("/clock", "/ground_truth")
            client.until(lambda: len(client.heard("/clock")) > 5)
        # The stack is told what to type, and its map is a file.
        line = re.search(r"^SCENARIO_SOCKET=(\S+) SCENARIO_NONCE=\w+ python3 (\S+)$", said, re.M)
        address = Path(line[1])
        assert Path(line[2]).is_file()
        assert stat.S_IMODE(address.stat().st_mode) == 0o600
        assert stat.S_IMODE(address.parent.stat().st_mode) == 0o700
        drawn = Path(re.search(r"^map for the stack: (\S+)$", said, re.M)[1])
        assert read_map(drawn).grid.resolution == 0.05
        process.send_signal(signal.SIGINT)
        _, rest = process.communicate(timeout=DEADLINE)
    assert process.returncode == ExitCode.EXPECTED
    assert "the world has ended" in rest
    assert not address.parent.exists()
    assert not drawn.exists()


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
    assert install_command("foxglove") in left.err
