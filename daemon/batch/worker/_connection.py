"""Between a worker and its daemon: how it asks, the folder they may share, what runs need of it."""

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
from daemon.batch.stores import (
    download,
    file_sha256,
    is_intact,
    read_marker,
    trim_cache,
)
from daemon.batch.worker._attempts import Attempt
from daemon.model.ids import is_id
from daemon.model.messages import GetRequest, WelcomeReply, WorkerInfo
from daemon.model.spec import RunSpec
from daemon.model.verbs import COMPLETE, GET, PUT, WELCOME, Verb
from grammars.text.files import replacing

A = TypeVar("A")

_TIMEOUT: Final = 5.0
"""Seconds for an answer; a link that is silent so long is as good as cut, and asked again."""
_TIMEOUT_OF_PART: Final = 12.0
"""Seconds for an answer with or to a part of a file, or a result: large for a slow link.

A renewal waits for the answer to a result, and must not come later than its lease ends.
"""
_HOST_PART: Final = 40
"""Letters of the machine's name in a worker's, whose length is limited."""


def describe_worker() -> WorkerInfo:
    """Say who this worker is; no other has its name, nor has one of this machine had it before."""
    host = socket.gethostname()
    safe = re.sub(r"[^A-Za-z0-9_-]", "-", host)[:_HOST_PART].lstrip("-_") or "host"
    name = f"{safe}-{os.getpid()}-{secrets.token_hex(2)}"
    return WorkerInfo(name, host, os.getpid(), version("scenario-tui"), 0, 0)


@dataclass(frozen=True, slots=True)
class WorkerPaths:
    """The folder a worker works in; ``shared`` says that it is the daemon's state directory."""

    state: StatePaths
    shared: bool


def choose_paths(state: Path | None, welcome: WelcomeReply) -> WorkerPaths:
    """Choose the folder and make it usable.

    The daemon's state directory is used where this machine has it: under the path ``state``, or
    the one the daemon says. Otherwise, ``state`` or the user's state folder gets a folder
    ``work/<identity of the daemon's directory>`` with spool and scenes: what one daemon has
    leased is never handed to another one.

    Raises :class:`WorkerBroken` when there is no such folder to be had.
    """
    there = StatePaths.find(state or Path(welcome.state))
    shared = _is_shared(there, welcome)
    paths = there if shared else _own_paths(state, welcome)
    return WorkerPaths(paths, shared)


def _is_shared(paths: StatePaths, welcome: WelcomeReply) -> bool:
    # The era is a secret that only the daemon's own file system can tell: a path of the same
    # name on another machine, or a copy of the directory from before, does not have it.
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
        """What stands for this worker's key in keys of the bus."""
        return bus.key_name(self.holder)

    def ask(self, verb: Verb[..., A], request: object) -> A:
        """Ask the daemon; raises :class:`Unreachable` or :class:`Refused`."""
        timeout = _TIMEOUT_OF_PART if verb in (GET, PUT, COMPLETE) else _TIMEOUT
        return bus.ask(self.session, self.endpoint, verb, request, timeout, self.holder)

    def ask_welcome(self, me: WorkerInfo) -> WelcomeReply:
        """Ask for work to do; raises :class:`WorkerBroken` when the daemon does not want it."""
        try:
            return self.ask(WELCOME, me)
        except Refused as error:
            raise WorkerBroken(str(error)) from error


_LARGEST_CACHE: Final = 2 * 2**30
"""Bytes of scenes, and of files, that stay here."""
_IN_USE: Final = 24 * 3600.0
"""Seconds after its last use during which one stays all the same: no run takes longer."""


class InputDamaged(ValueError):  # noqa: N818  (reads as a sentence where it is raised)
    """A scene or file that the daemon has is not what its ``digest`` says, or it has none."""

    def __init__(self, problem: str, digest: str) -> None:
        super().__init__(problem)
        self.digest = digest


class InputCache:
    """The scenes and files that lie here. One thread fetches, another asks for what is here.

    In a folder shared with the daemon they are the daemon's own: nothing of them is removed here.
    What is damaged there the daemon is told of, and puts aside.
    """

    def __init__(self, daemon: DaemonConnection, paths: WorkerPaths) -> None:
        self._daemon = daemon
        self._paths = paths
        # Verified by this process. Each is read in full only once: a campaign of 100 000 runs
        # shares a few scenes.
        self._verified: set[str] = set()

    def scene(self, spec: RunSpec) -> Path:
        """Return the path of a run's scene."""
        return self._paths.state.scene(spec.scene)

    def lacks(self, spec: RunSpec) -> bool:
        """Whether something that a run needs has to come from the daemon first."""
        paths = () if self._paths.shared else self._needed(spec)
        return any(path.stem not in self._verified or not path.exists() for path in paths)

    def _needed(self, spec: RunSpec) -> list[Path]:
        """Return the paths of what a run needs, the scene first; each is named by its digest."""
        return [self.scene(spec), *(self._paths.state.files / digest for digest in spec.files)]

    def fetch(self, spec: RunSpec) -> None:
        """Bring what a run needs; raises as :meth:`provide` does."""
        for path in self._needed(spec):
            self._ensure(path)

    def provide(self, attempt: Attempt) -> Path:
        """Put the files that an attempt needs within its reach; returns the path of its scene.

        Raises :class:`InputDamaged` for a scene or file that is not the one its digest names,
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
            os.utime(path)  # the cache forgets what was not used for longest

    def _bring(self, path: Path) -> None:
        if self._paths.shared:
            raise ValueError(f"{path} is gone or damaged: submit its campaign again")
        digest = path.stem
        # Read only: the system under test of one run must not change it for the next.
        with replacing(path, mode=0o400) as temporary:
            download(temporary, lambda offset: self._daemon.ask(GET, GetRequest(digest, offset)))
            if file_sha256(temporary) != digest:
                raise ValueError(f"the daemon sent another file for {digest[:12]}")
        trim_cache(path.parent.iterdir(), _LARGEST_CACHE, _IN_USE)
