"""Where a worker keeps things: the daemon's state directory, or a folder of its own."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from daemon.errors import WorkerBroken
from daemon.messages import Welcome
from daemon.places import Places, is_id
from daemon.store import StoreUnusable, prove, read_marker


@dataclass(frozen=True, slots=True)
class Base:
    """The folder a worker works in; ``shared`` says that it is the daemon's state directory."""

    places: Places
    shared: bool


def settle(state: Path | None, welcome: Welcome) -> Base:
    """Choose the folder and make it usable.

    The daemon's state directory is used where this machine has it: under the path ``state``, or
    the one the daemon says. Otherwise, ``state`` or the user's state folder gets a folder
    ``work/<identity of the daemon's directory>`` with spool and scenes: what one daemon has
    leased is never handed to another one.

    Raises :class:`WorkerBroken` when there is no such folder to be had, or when the store that
    traces belong into cannot be written from here.
    """
    there = Places.find(state or Path(welcome.state))
    shared = _shares(there, welcome)
    places = there if shared else _own(state, welcome)
    if welcome.store:
        try:
            prove(welcome.store)
        except StoreUnusable as error:
            raise WorkerBroken(f"this worker cannot keep traces: {error}") from error
    return Base(places, shared)


def _shares(places: Places, welcome: Welcome) -> bool:
    marker = read_marker(places)
    if marker is None or not welcome.probe or marker.probe != welcome.probe:
        return False
    return all(
        os.access(folder, os.W_OK | os.X_OK)
        for folder in (places.spool, places.traces, places.scenes)
    )


def _own(state: Path | None, welcome: Welcome) -> Places:
    if not is_id(welcome.identity):
        raise WorkerBroken("the daemon does not say which state directory it keeps")
    places = Places(Places.find(state).state / "work" / welcome.identity)
    try:
        for folder in (places.state, places.scenes, places.files, places.spool):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise WorkerBroken(
            f"this worker has no folder to work in: {error}; name one with --state"
        ) from error
    return places
