"""The process beside a Dask worker that starts its runs: ``python -m ... WIRE EXECUTOR FOLDER``.

A Dask worker may not fork and takes seconds to import what a run needs; this one is warm and
forks. It lives as long as the other end of the socket ``WIRE`` is held, ends its runs when that
closes, and takes its temporary folder with it.
"""

from __future__ import annotations

import os
import signal
import sys
import tempfile
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, Final

from daemon.batch.errors import WorkerBroken
from daemon.batch.numba_cache import numba_cache_environment
from daemon.batch.paths import StatePaths
from daemon.batch.run_process import GRANT
from daemon.batch.worker._attempts import Attempt
from daemon.batch.worker._forkserver import ForkedExecution, ForkServerPool, prepare_environment
from daemon.model.execution import RunLimits
from daemon.model.messages import Lease
from grammars.text import codec

READY: Final = b"R"
BROKEN: Final = b"B"


@dataclass(frozen=True, slots=True)
class LaunchRequest:
    """Start the attempt in ``folder`` within ``limits``; without limits: stop it."""

    key: str
    folder: str = ""
    scene: str = ""
    limits: RunLimits | None = None


@dataclass(frozen=True, slots=True)
class LaunchReport:
    """What an attempt told, or that it ended, and, if it left no result, why and whose fault."""

    key: str
    live: str = ""
    ended: bool = False
    blame: bool = False
    why: str = ""
    lacks: bool = False


class Launcher:
    """Obeys orders until the wire closes."""

    def __init__(self, wire: Connection, nursery: ForkServerPool) -> None:
        self._wire = wire
        self._nursery = nursery
        self._children: dict[str, ForkedExecution] = {}

    def sit(self) -> None:
        """Work until nobody holds the other end any more; then nothing runs."""
        try:
            while True:
                self._rest()
                while self._wire.poll():
                    self._obey(codec.from_json(LaunchRequest, self._wire.recv_bytes()))
                self._look()
        except (EOFError, OSError):
            return  # the Dask worker is gone
        finally:
            for child in self._children.values():
                child.kill()

    def _rest(self) -> None:
        things: list[Any] = [self._wire]
        for child in self._children.values():
            things += child.waitables
        now = time.monotonic()
        moments = [child.deadline - now for child in self._children.values()]
        wait(things, max(0.001, min(moments)) if moments else None)

    def _obey(self, order: LaunchRequest) -> None:
        if order.limits is None:
            if order.key in self._children:
                self._children[order.key].kill("stopped")
            return
        folder = Path(order.folder)
        try:
            grant = codec.from_json(Lease, (folder / GRANT).read_bytes())
            attempt, scene = Attempt(grant, folder), Path(order.scene)
            self._children[order.key] = self._nursery.start(attempt, scene, order.limits)
        except (OSError, EOFError, ValueError) as error:
            self._tell(LaunchReport(order.key, ended=True, why=f"not started: {error}"))

    def _look(self) -> None:
        for key, child in tuple(self._children.items()):
            child.listen()
            if child.live:
                self._tell(LaunchReport(key, live=child.live.decode()))
                child.live = b""
            if child.ended:
                child.listen()
                why = "" if child.attempt.finished else child.why()
                self._tell(
                    LaunchReport(key, ended=True, blame=child.blame, why=why, lacks=child.lacks)
                )
                del self._children[key]
                child.close()

    def _tell(self, told: LaunchReport) -> None:
        self._wire.send_bytes(codec.to_json(told))


def main() -> None:
    """Say where the folder is once warm, or what is wrong; then sit."""
    number, executor, directory = sys.argv[1:]
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    with (
        Connection(int(number)) as wire,
        tempfile.TemporaryDirectory(prefix="scenario-", dir=directory) as folder,
    ):
        os.environ.update(numba_cache_environment(StatePaths(Path(folder))))
        prepare_environment(executor)
        nursery = ForkServerPool(0)
        try:
            nursery.prove()
        except WorkerBroken as error:
            wire.send_bytes(BROKEN + str(error).encode())
            return
        wire.send_bytes(READY + folder.encode())
        Launcher(wire, nursery).sit()


if __name__ == "__main__":
    main()
