"""The tether: a pipe by which a process knows that whoever started it is still there."""

from __future__ import annotations

import os
import sys
import threading


def exit_when_stdin_closes() -> None:
    """End this process at once when standard input closes; its children follow by themselves.

    For a process whose parent may be killed, or is not the one it depends on: that of a worker
    started by ssh is sshd, which outlives the connection.
    """

    def watch() -> None:
        while os.read(sys.stdin.fileno(), 4096):
            pass
        os._exit(1)

    threading.Thread(target=watch, name="tether", daemon=True).start()
