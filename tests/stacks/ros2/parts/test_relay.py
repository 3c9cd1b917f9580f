"""The relay as a program: run by a Python without rclpy."""

import subprocess
import sys

import pytest

from daemon.stacks.ros2.link import LinkLost, RelayLink, relay_path


def run(*words, stdin=subprocess.DEVNULL, **environment):
    command = [sys.executable, "-I", relay_path(), *words]
    return subprocess.Popen(
        command, env=environment, stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True,
    )  # fmt: skip


def test_it_says_what_it_is():
    said, _ = run("--help").communicate(timeout=60)
    assert len(said.splitlines()) == 2
    assert "ROS 2" in said


def test_it_says_what_it_lacks_over_the_socket(tmp_path):
    link = RelayLink.listen(tmp_path / "socket", "8f14e45f")
    child = run(SCENARIO_SOCKET=link.address, SCENARIO_NONCE="8f14e45f")
    with pytest.raises(LinkLost, match=r"cannot import rclpy: .*setup file"):
        link.accept(60)
    _, error = child.communicate(timeout=60)
    assert child.returncode == 1
    assert "cannot import rclpy" in error


@pytest.mark.parametrize(
    ("environment", "code", "words"),
    [
        ({"SCENARIO_SOCKET": "/nowhere"}, 0, "stdin was closed"),
        ({}, 2, "SCENARIO_SOCKET is not set"),
    ],
)
def test_one_whose_starter_closes_its_stdin_or_gives_no_address_ends(environment, code, words):
    child = run(stdin=subprocess.PIPE, **environment)
    _, error = child.communicate(timeout=60)
    assert child.returncode == code
    assert words in error
