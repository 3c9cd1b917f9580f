"""``python -m daemon.batch.acceptor FD PORT``: the process at the daemon's port."""

from __future__ import annotations

import json
import resource
import socket
import sys
from contextlib import suppress

from daemon.batch.acceptor._acceptor import Acceptor


def _raise_descriptor_limit() -> None:
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    with suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def _report_line(dropped: dict[str, int]) -> None:
    with suppress(OSError):
        sys.stdout.write(json.dumps(dropped) + "\n")
        sys.stdout.flush()


def main(descriptor: int, port: int) -> None:
    """Serve until standard input ends: then the daemon is gone."""
    _raise_descriptor_limit()
    acceptor = Acceptor(socket.socket(fileno=descriptor), port, _report_line)
    ended: list[bool] = []
    acceptor.watch(sys.stdin.fileno(), lambda: ended.append(True))
    while not ended:
        acceptor.step(0.25)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
