"""A worker meets its daemon: who it is, how it asks, and the folder they may share.

The daemon's state directory where this machine has it, otherwise a folder of the worker's own.
"""

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
from daemon.batch.stores import StoreUnusable, probe_store, read_marker
from daemon.model.ids import is_id
from daemon.model.messages import WelcomeReply, WorkerInfo
from daemon.model.verbs import WELCOME, Verb

A = TypeVar("A")

_TIMEOUT: Final = 5.0
"""Seconds for an answer; a link that is silent so long is as good as cut, and asked again."""
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

    Raises :class:`WorkerBroken` when there is no such folder to be had, or when the store that
    traces belong into cannot be written from here.
    """
    there = StatePaths.find(state or Path(welcome.state))
    shared = _is_shared(there, welcome)
    paths = there if shared else _own_paths(state, welcome)
    # Now, not after the first run: what cannot be kept need not be computed.
    if welcome.store:
        try:
            probe_store(welcome.store)
        except StoreUnusable as error:
            raise WorkerBroken(f"this worker cannot keep traces: {error}") from error
    return WorkerPaths(paths, shared)


def _is_shared(paths: StatePaths, welcome: WelcomeReply) -> bool:
    # The probe is a secret that only the daemon's own file system can tell: a path of the same
    # name on another machine, or a copy of the directory from before, does not have it.
    marker = read_marker(paths)
    if marker is None or not welcome.probe or marker.probe != welcome.probe:
        return False
    return all(
        os.access(folder, os.W_OK | os.X_OK) for folder in (paths.spool, paths.traces, paths.scenes)
    )


def _own_paths(state: Path | None, welcome: WelcomeReply) -> StatePaths:
    if not is_id(welcome.identity):
        raise WorkerBroken("the daemon does not say which state directory it keeps")
    paths = StatePaths(StatePaths.find(state).state / "work" / welcome.identity)
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

    def ask(self, verb: Verb[..., A], request: object) -> A:
        """Ask the daemon; raises :class:`Unreachable` or :class:`Refused`."""
        return bus.ask(self.session, self.endpoint, verb, request, _TIMEOUT, self.holder)

    def ask_welcome(self, me: WorkerInfo) -> WelcomeReply:
        """Ask for work to do; raises :class:`WorkerBroken` when the daemon does not want it."""
        try:
            return self.ask(WELCOME, me)
        except Refused as error:
            raise WorkerBroken(str(error)) from error
