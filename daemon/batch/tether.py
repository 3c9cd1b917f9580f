"""The tether: a pipe by which a process knows that whoever started it is still there."""

from __future__ import annotations

import os
import select
import subprocess
import sys
import threading
from contextlib import suppress
from typing import Any


def exit_when_stdin_closes() -> None:
    """End this process at once when standard input closes; its children follow by themselves.

    For a process whose parent may be killed, or is not the one it depends on: that of a worker
    started by ssh is sshd, which outlives the connection.
    """

    def watch() -> None:
        await_stdin_end()
        os._exit(1)

    threading.Thread(target=watch, name="tether", daemon=True).start()


def await_stdin_end() -> None:
    """Return when nobody holds the other end of standard input any more."""
    descriptor = sys.stdin.fileno()
    # A terminal that hung up, or a socket whose peer was killed, ends by an error.
    with suppress(OSError):
        while True:
            try:
                if not os.read(descriptor, 4096):
                    return
            except BlockingIOError:  # whoever made it does not wait for it: nothing has ended
                select.select([descriptor], [], [])


def end_tethered(process: subprocess.Popen[Any], patience: float) -> None:
    """End a process that holds the other end of its standard input as a tether.

    One that has not left after ``patience`` seconds is killed.
    """
    assert process.stdin is not None
    process.stdin.close()
    try:
        process.wait(patience)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
