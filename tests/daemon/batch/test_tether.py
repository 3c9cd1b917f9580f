"""Processes that end with whoever holds their standard input."""

from __future__ import annotations

import socket
import subprocess
import sys

import pytest

HELD = """
import os, time
from daemon.batch.tether import exit_when_stdin_closes
exit_when_stdin_closes()
os.write(0, b"!")
while True:
    time.sleep(60.0)
"""


@pytest.mark.parametrize("unread", [False, True])
def test_a_process_ends_with_the_other_end_of_its_tether(unread: bool) -> None:
    ours, theirs = socket.socketpair()
    # As a server that is killed leaves a socket: with what it has not read, that is an error.
    with ours, theirs, subprocess.Popen([sys.executable, "-c", HELD], stdin=theirs) as process:
        theirs.close()
        ours.recv(1, 0 if not unread else socket.MSG_PEEK)
        ours.close()
        try:
            assert process.wait(60.0) == 1
        finally:
            process.kill()
