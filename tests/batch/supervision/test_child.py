"""Processes that end with whoever holds their standard input."""

import os
import socket
import subprocess
import sys
import threading

import pytest

from daemon.supervision.child import when_stdin_ends

HELD = """
import os, time
from daemon.supervision.child import when_stdin_ends
when_stdin_ends(lambda: os._exit(1))
os.write(0, b"!")
while True:
    time.sleep(60.0)
"""


@pytest.mark.parametrize("unread", [False, True])
def test_a_process_ends_with_the_other_end_of_its_tether(unread):
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


def test_a_tether_that_does_not_wait_has_not_ended_yet(monkeypatch):
    theirs, ours = os.pipe()
    os.set_blocking(theirs, False)  # as whoever gave it to us may have left it
    asked = threading.Event()
    read = os.read

    def watched_read(descriptor, size):
        try:
            return read(descriptor, size)
        except BlockingIOError:
            asked.set()
            raise

    with os.fdopen(theirs) as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        monkeypatch.setattr(os, "read", watched_read)
        ended = threading.Event()
        when_stdin_ends(ended.set)
        assert asked.wait(60.0)
        asked.clear()
        os.write(ours, b"?")  # still held
        assert asked.wait(60.0)
        assert not ended.is_set()
        os.close(ours)
        assert ended.wait(60.0)
