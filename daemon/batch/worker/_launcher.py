"""The process beside a Dask worker that starts its runs: ``python -m … WIRE EXECUTOR FOLDER``.

A Dask worker may not fork and takes seconds to import what a run needs; this one is warm and
forks. It lives as long as the other end of the socket ``WIRE`` is held, ends its runs when that
closes, and takes its temporary folder with it.
"""

from __future__ import annotations

import base64
import os
import signal
import sys
import tempfile
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, Final

from daemon.batch.errors import DaemonError, WorkerBroken
from daemon.batch.numba_cache import numba_cache_environment
from daemon.batch.paths import StatePaths
from daemon.batch.run_process import Wanted
from daemon.batch.worker._attempts import Attempt, AttemptEnd
from daemon.batch.worker._forkserver import ForkedExecution, ForkServerPool, prepare_environment
from daemon.model.execution import RunLimits
from grammars.text import codec

READY: Final = b"R"
BROKEN: Final = b"B"


@dataclass(frozen=True, slots=True)
class LaunchRequest:
    """Start the attempt in ``folder`` within ``limits``; without limits: stop it.

    With ``wanted`` only leave word for it of what those who watch it want.
    """

    key: str
    folder: str = ""
    scene: str = ""
    limits: RunLimits | None = None
    wanted: tuple[Wanted, ...] | None = None


@dataclass(frozen=True, slots=True)
class LaunchReport:
    """What an attempt said of itself, how it ended, or what is prepared before it can start.

    ``judged`` is in base64.
    """

    key: str
    live: str = ""
    judged: str = ""
    end: AttemptEnd | None = None
    preparing: str = ""


class Launcher:
    """Obeys signals until the wire closes."""

    def __init__(self, wire: Connection, pool: ForkServerPool) -> None:
        self._wire = wire
        self._pool = pool
        self._children: dict[str, ForkedExecution] = {}
        # Asked for, and not begun while what they need is compiled.
        self._waiting: dict[str, tuple[LaunchRequest, RunLimits]] = {}
        self._preparing = ""

    def run(self) -> None:
        """Work until nobody holds the other end any more; then nothing runs."""
        try:
            while True:
                self._wait()
                while self._wire.poll():
                    self._handle(codec.from_json(LaunchRequest, self._wire.recv_bytes()))
                self._pool.listen()
                self._start_waiting()
                self._tell_preparing()
                self._poll_children()
        except (EOFError, OSError):
            return  # the Dask worker is gone
        finally:
            for child in self._children.values():
                child.kill()

    def _wait(self) -> None:
        things: list[Any] = [self._wire, *self._pool.waitables]
        for child in self._children.values():
            things += child.waitables
        now = time.monotonic()
        moments = [child.deadline - now for child in self._children.values()]
        wait(things, max(0.001, min(moments)) if moments else None)

    def _handle(self, request: LaunchRequest) -> None:
        if request.wanted is not None:
            if request.key in self._children:
                self._children[request.key].watch(frozenset(request.wanted))
        elif request.limits is not None:
            self._waiting[request.key] = request, request.limits
        elif self._waiting.pop(request.key, None) is not None:
            self._report(LaunchReport(request.key, end=AttemptEnd("stopped")))
        elif request.key in self._children:
            self._children[request.key].kill("stopped")

    def _start_waiting(self) -> None:
        for key, (request, limits) in tuple(self._waiting.items()):
            try:
                started = self._start(request, limits)
            except (DaemonError, OSError, EOFError, ValueError) as error:
                self._report(LaunchReport(key, end=AttemptEnd(f"not started: {error}")))
            else:
                if not started:
                    continue
            del self._waiting[key]

    def _start(self, request: LaunchRequest, limits: RunLimits) -> bool:
        """Start an attempt; returns whether what it needs was there."""
        attempt = Attempt.read(Path(request.folder))
        if not self._pool.prepare(attempt.lease.spec.sut, limits):
            return False
        self._children[request.key] = self._pool.start(attempt, Path(request.scene), limits)
        return True

    def _tell_preparing(self) -> None:
        """Say what those that wait are waiting for, when that has changed."""
        words, before = self._pool.preparing, self._preparing
        self._preparing = words
        if words and words != before:
            for key in self._waiting:
                self._report(LaunchReport(key, preparing=words))

    def _poll_children(self) -> None:
        for key, child in tuple(self._children.items()):
            child.listen()
            if child.live or child.judged:
                judged = base64.b64encode(child.judged).decode()
                self._report(
                    LaunchReport(key, live=child.live.decode("utf-8", "replace"), judged=judged)
                )
                child.live = child.judged = b""
            if child.end is not None:
                child.listen()  # its last words may have come after the ones just read
                self._report(LaunchReport(key, end=child.end))
                del self._children[key]
                child.close()

    def _report(self, report: LaunchReport) -> None:
        self._wire.send_bytes(codec.to_json(report))


def main() -> None:
    """Say where the folder is once warm, or what is wrong; then run."""
    number, executor, directory = sys.argv[1:]
    # Ctrl-C is for the Dask worker, whose end closes the wire. SIGTERM must unwind the stack: by
    # default it would leave the temporary folder behind.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    with (
        Connection(int(number)) as wire,
        tempfile.TemporaryDirectory(prefix="scenario-", dir=directory) as folder,
    ):
        os.environ.update(numba_cache_environment(StatePaths(Path(folder))))
        prepare_environment(executor)
        pool = ForkServerPool(0)  # slots are for loops that lease: here Dask counts
        try:
            pool.warm_up()
        except WorkerBroken as error:
            wire.send_bytes(BROKEN + str(error).encode())
            return
        wire.send_bytes(READY + folder.encode())
        Launcher(wire, pool).run()


if __name__ == "__main__":
    main()
