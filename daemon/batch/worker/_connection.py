"""Between a worker and its daemon: how it asks, and the folder they may share.

The daemon's state directory where this machine has it, otherwise a folder of the worker's own.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TypeVar

import zenoh

from daemon.batch import bus
from daemon.batch.errors import WorkerBroken
from daemon.batch.paths import StatePaths
from daemon.batch.security import Credentials
from daemon.batch.stores import StoreUnusable, probe_store, read_marker
from daemon.model.ids import is_id
from daemon.model.messages import WelcomeReply
from daemon.model.verbs import Verb

A = TypeVar("A")

_TIMEOUT: Final = 5.0


@dataclass(frozen=True, slots=True)
class WorkerPaths:
    """The folder a worker works in; ``shared`` says that it is the daemon's state directory."""

    places: StatePaths
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
    places = there if shared else _own_paths(state, welcome)
    if welcome.store:
        try:
            probe_store(welcome.store)
        except StoreUnusable as error:
            raise WorkerBroken(f"this worker cannot keep traces: {error}") from error
    return WorkerPaths(places, shared)


def _is_shared(places: StatePaths, welcome: WelcomeReply) -> bool:
    marker = read_marker(places)
    if marker is None or not welcome.probe or marker.probe != welcome.probe:
        return False
    return all(
        os.access(folder, os.W_OK | os.X_OK)
        for folder in (places.spool, places.traces, places.scenes)
    )


def _own_paths(state: Path | None, welcome: WelcomeReply) -> StatePaths:
    if not is_id(welcome.identity):
        raise WorkerBroken("the daemon does not say which state directory it keeps")
    places = StatePaths(StatePaths.find(state).state / "work" / welcome.identity)
    try:
        for folder in (places.state, places.scenes, places.files, places.spool):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise WorkerBroken(
            f"this worker has no folder to work in: {error}; name one with --state"
        ) from error
    return places


@dataclass(frozen=True, slots=True)
class DaemonConnection:
    """The connection to the daemon."""

    session: zenoh.Session
    endpoint: str
    holder: Credentials | None = None

    def ask(self, verb: Verb[..., A], request: object) -> A:
        """Ask the daemon; raises :class:`Unreachable` or :class:`Refused`."""
        return bus.ask(self.session, self.endpoint, verb, request, _TIMEOUT, self.holder)
