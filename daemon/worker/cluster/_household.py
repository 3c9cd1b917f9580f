"""What a Dask worker keeps beside itself: the sitter, its folder, scenes and files in it."""

from __future__ import annotations

import hashlib
import shutil
import socket
import subprocess
import sys
import threading
import uuid
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Final

from daemon.attachments import attached
from daemon.child import FILES, GRANT, RESULT, TRACE
from daemon.errors import WorkerBroken
from daemon.executor import Limits
from daemon.messages import LARGEST_REQUEST, Grant
from daemon.places import Places
from daemon.spec import RunSpec
from daemon.worker._sitter import READY, Order, Told
from daemon.worker.cluster._job import LARGEST_TRACE
from grammars import codec

_WARM_UP_LIMIT: Final = 330.0
_TICK: Final = 0.2


@dataclass(frozen=True, slots=True)
class Leavings:
    """What an attempt left; without a result, why."""

    told: Told
    result: bytes = b""
    trace: bytes = b""


class Household:
    """One sitter with its folder; any thread may have it run an attempt."""

    def __init__(self, executor: str, directory: str) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            command = [sys.executable, "-m", "daemon.worker._sitter"]
            command += [str(theirs.fileno()), executor, directory]
            self._process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, pass_fds=(theirs.fileno(),)
            )
        self._wire = Connection(ours.detach())
        self._places = Places(Path(self._greet()))
        self._places.make()
        self._sending = threading.Lock()
        self._inboxes: dict[str, SimpleQueue[Told]] = {}
        self.gone = False
        threading.Thread(target=self._read, name="sitter", daemon=True).start()

    def _greet(self) -> str:
        hello = b""
        with suppress(EOFError, OSError):  # it died: there are no words
            hello = self._wire.recv_bytes() if self._wire.poll(_WARM_UP_LIMIT) else b""
        words = hello[1:].decode("utf-8", "replace")
        if hello[:1] != READY:
            self._wire.close()
            self._process.kill()
            self._process.wait()
            raise WorkerBroken(words or "the process that starts runs did not answer")
        return words

    def _read(self) -> None:
        with suppress(EOFError, OSError):  # the sitter is gone: everybody waiting is told
            while True:
                told = codec.from_json(Told, self._wire.recv_bytes())
                inbox = self._inboxes.get(told.key)
                if inbox is not None:
                    inbox.put(told)
        self.gone = True
        for key, inbox in tuple(self._inboxes.items()):
            inbox.put(Told(key, ended=True, why="the process that starts runs ended"))
        self._process.wait()

    def missing(self, spec: RunSpec) -> tuple[str, ...]:
        """The digests of what that run needs and is not kept here: scene, files of its SUT.

        Raises ``ValueError`` for what is no digest.
        """
        return tuple(digest for digest, path in self._needed(spec).items() if not path.exists())

    def keep(self, spec: RunSpec, given: Iterable[bytes]) -> None:
        """Keep what that run needs; raises ``ValueError`` for anything else."""
        needed = self._needed(spec)
        for data in given:
            path = needed.get(hashlib.sha256(data).hexdigest())
            if path is None:
                raise ValueError("something was damaged on its way to the cluster")
            temporary = path.with_name(f".{uuid.uuid4().hex}")
            temporary.write_bytes(data)
            temporary.replace(path)

    def _needed(self, spec: RunSpec) -> dict[str, Path]:
        paths = {spec.scene: self._places.scene(spec.scene)}
        for digest in attached(spec.sut.parameters).values():
            paths[digest] = self._places.files / digest
        return paths

    def run(
        self, grant: Grant, limits: Limits, wanted: Callable[[], bool], tell: Callable[[str], None]
    ) -> Leavings:
        """Run an attempt to its end, or stop it as soon as it is not ``wanted`` any more.

        ``tell`` is given what it tells about itself. Raises ``OSError`` when there is no room.
        """
        key = uuid.uuid4().hex
        folder = self._places.spool / key / f"attempt-{grant.attempt}"
        inbox = self._inboxes[key] = SimpleQueue()
        try:
            folder.mkdir(parents=True)
            (folder / GRANT).write_bytes(codec.to_json(grant))
            if attached(grant.spec.sut.parameters):
                (folder / FILES).symlink_to(self._places.files)
            scene = self._places.scene(grant.spec.scene)
            self._send(Order(key, str(folder), str(scene), limits))
            told = self._await(key, inbox, wanted, tell)
            return _leavings(told, folder)
        finally:
            del self._inboxes[key]
            shutil.rmtree(folder.parent, ignore_errors=True)

    def _await(
        self,
        key: str,
        inbox: SimpleQueue[Told],
        wanted: Callable[[], bool],
        tell: Callable[[str], None],
    ) -> Told:
        while True:
            try:
                told = inbox.get(timeout=_TICK)
            except Empty:
                if self.gone:
                    return Told(key, ended=True, why="the process that starts runs ended")
                if not wanted():
                    self._send(Order(key))
                continue
            if told.ended:
                return told
            tell(told.live)

    def _send(self, order: Order) -> None:
        with self._sending:
            self._wire.send_bytes(codec.to_json(order))


def _leavings(told: Told, folder: Path) -> Leavings:
    result, trace = folder / RESULT, folder / TRACE
    if not result.exists():
        return Leavings(told)
    for path, limit in ((result, LARGEST_REQUEST), (trace, LARGEST_TRACE)):
        size = path.stat().st_size
        if size > limit:
            words = f"its {path.name} has {size} bytes; at most {limit} travel from a cluster"
            return Leavings(Told(told.key, ended=True, blame=True, why=words))
    return Leavings(told, result.read_bytes(), trace.read_bytes())


_households: dict[str, Household] = {}
_founding: Final = threading.Lock()


def household(executor: str, directory: str) -> Household:
    """The household of this process for ``executor``, a new one when it is gone.

    Raises :class:`WorkerBroken` when runs cannot be executed here.
    """
    with _founding:
        found = _households.get(executor)
        if found is None or found.gone:
            found = _households[executor] = Household(executor, directory)
        return found
