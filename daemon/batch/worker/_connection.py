"""Connection of a worker to its daemon: requests, the shared folder, and inputs of runs."""

from __future__ import annotations

import os
import re
import secrets
import socket
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Final, TypeVar

import zenoh

from daemon.batch import bus
from daemon.batch.errors import Refused, WorkerBroken
from daemon.batch.paths import StatePaths
from daemon.batch.security import Credentials
from daemon.batch.stores import download, file_sha256, is_intact, read_marker, trim_cache
from daemon.batch.worker._attempts import Attempt
from daemon.model.ids import is_id
from daemon.model.messages import GetRequest, WelcomeReply, WorkerInfo
from daemon.model.spec import RunSpec
from daemon.model.verbs import COMPLETE, GET, PUT, WELCOME, Verb
from grammars.text.files import replacing

A = TypeVar("A")

_TIMEOUT: Final = 5.0
"""Timeout of a request [s]; a link that is silent for this long counts as cut."""
_TIMEOUT_OF_PART: Final = 12.0
"""Timeout of a request with a part of a file or a result [s], which a slow link delays.

A renewal waits for the answer to a result, and must come before its lease ends.
"""
_HOST_PART: Final = 40
"""Letters of the machine's name in a worker's id, whose length is limited."""


def describe_worker() -> WorkerInfo:
    """Return a description of this worker with a unique id, never used before."""
    host = socket.gethostname()
    safe = re.sub(r"[^A-Za-z0-9_-]", "-", host)[:_HOST_PART].lstrip("-_") or "host"
    name = f"{safe}-{os.getpid()}-{secrets.token_hex(2)}"
    return WorkerInfo(name, host, os.getpid(), version("scenario-tui"), 0, 0)


@dataclass(frozen=True, slots=True)
class WorkerPaths:
    """The folder of a worker; ``shared``: it is the daemon's state directory."""

    state: StatePaths
    shared: bool


def choose_paths(state: Path | None, welcome: WelcomeReply) -> WorkerPaths:
    """Choose the folder and make it usable.

    If this machine has the daemon's state directory, at the path ``state`` or the daemon's own
    path, the worker uses it. Otherwise it makes a folder ``work/<identity of the daemon's
    directory>`` in ``state`` or the user's state folder, with spool and scenes: each daemon has its
    own, so leases never reach another daemon.

    Raises :class:`WorkerBroken` without a usable folder.
    """
    paths = StatePaths.find(state or Path(welcome.state))
    if _is_shared(paths, welcome):
        return WorkerPaths(paths, shared=True)
    return WorkerPaths(_own_paths(state, welcome), shared=False)


def _is_shared(paths: StatePaths, welcome: WelcomeReply) -> bool:
    # The era is a secret in the daemon's own file system: the same path on another machine, or an
    # earlier copy of the directory, does not have it.
    marker = read_marker(paths)
    if marker is None or marker.era != welcome.era:
        return False
    folders = (paths.spool, paths.incoming, paths.scenes)
    return all(os.access(folder, os.W_OK | os.X_OK) for folder in folders)


def _own_paths(state: Path | None, welcome: WelcomeReply) -> StatePaths:
    if not is_id(welcome.identity):
        raise WorkerBroken("the daemon does not say which state directory it keeps")
    paths = StatePaths.find(state).cache(welcome.identity)
    try:
        for folder in (paths.state, paths.scenes, paths.files, paths.spool):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise WorkerBroken(
            f"this worker has no folder to work in: {error}; name one with --state"
        ) from error
    return paths


@dataclass(frozen=True, slots=True)
class DaemonConnection:
    """The connection to the daemon."""

    session: zenoh.Session
    endpoint: str
    holder: Credentials | None = None

    @property
    def name(self) -> str:
        """Name of this worker's key in keys of the bus."""
        return bus.key_name(self.holder)

    def ask(self, verb: Verb[..., A], request: object) -> A:
        """Ask the daemon; raises :class:`Unreachable` or :class:`Refused`."""
        timeout = _TIMEOUT_OF_PART if verb in (GET, PUT, COMPLETE) else _TIMEOUT
        return bus.ask(self.session, self.endpoint, verb, request, timeout, self.holder)

    def ask_welcome(self, me: WorkerInfo) -> WelcomeReply:
        """Register with the daemon; raises :class:`WorkerBroken` after a refusal."""
        try:
            return self.ask(WELCOME, me)
        except Refused as error:
            raise WorkerBroken(str(error)) from error


_LARGEST_CACHE: Final = 2 * 2**30
"""Most bytes of scenes, and of files, that stay here."""
_IN_USE: Final = 24 * 3600.0
"""Time for which they stay after their last use in any case [s]: no run takes longer."""


class InputDamaged(ValueError):  # noqa: N818  (reads as a sentence where it is raised)
    """A scene or file of the daemon is missing or does not match its ``digest``."""

    def __init__(self, problem: str, digest: str) -> None:
        super().__init__(problem)
        self.digest = digest


class InputCache:
    """The scenes and files on this machine. One thread fetches, another one queries.

    In a folder shared with the daemon they are the daemon's own, and never removed here. The daemon
    puts damaged ones aside after a report.
    """

    def __init__(self, daemon: DaemonConnection, paths: WorkerPaths) -> None:
        self._daemon = daemon
        self._paths = paths
        # Files verified by this process. Each is read only once: 100 000 runs share a few scenes.
        self._verified: set[str] = set()

    def scene(self, spec: RunSpec) -> Path:
        """Return the path of a run's scene."""
        return self._paths.state.scene(spec.scene)

    def lacks(self, spec: RunSpec) -> bool:
        """Return whether an input of a run must come from the daemon first."""
        paths = () if self._paths.shared else self._needed(spec)
        return any(path.stem not in self._verified or not path.exists() for path in paths)

    def _needed(self, spec: RunSpec) -> list[Path]:
        """Return the paths of a run's inputs, the scene first; digests are their names."""
        return [self.scene(spec), *(self._paths.state.files / digest for digest in spec.files)]

    def fetch(self, spec: RunSpec) -> None:
        """Fetch the inputs of a run; raises as :meth:`provide`."""
        for path in self._needed(spec):
            self._ensure(path)

    def provide(self, attempt: Attempt) -> Path:
        """Provide the files of an attempt; return the path of its scene.

        Raises :class:`InputDamaged` for a scene or file that does not match its digest,
        ``OSError``, and :class:`Unreachable`.
        """
        self.fetch(attempt.lease.spec)
        if attempt.lease.spec.files:
            attempt.link_files(self._paths.state.files)
        return self.scene(attempt.lease.spec)

    def _ensure(self, path: Path) -> None:
        if path.stem not in self._verified or not path.exists():
            try:
                if not is_intact(path):
                    self._bring(path)
            except (Refused, ValueError) as error:
                raise InputDamaged(str(error), path.stem) from error
            self._verified.add(path.stem)
        if not self._paths.shared:
            os.utime(path)  # the cache removes the least recently used files

    def _bring(self, path: Path) -> None:
        if self._paths.shared:
            raise ValueError(f"{path} is gone or damaged: submit its campaign again")
        digest = path.stem
        # Read-only: the system under test of one run must not change it for the next.
        with replacing(path, mode=0o400) as temporary:
            download(temporary, lambda offset: self._daemon.ask(GET, GetRequest(digest, offset)))
            if file_sha256(temporary) != digest:
                raise ValueError(f"the daemon sent another file for {digest[:12]}")
        trim_cache(path.parent.iterdir(), _LARGEST_CACHE, _IN_USE)
