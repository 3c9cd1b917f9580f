"""What the command line and the dashboard ask of a daemon: the client as they see it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Final, TypeAlias

if TYPE_CHECKING:
    from daemon.model.spec import Snapshot
    from daemon.model.status import LiveSnapshot, RunRow
    from daemon.model.verbs import DaemonClient

LIVE_PATIENCE: Final = 0.5
"""Seconds for a run to say how far it is: it does so several times a second while it is watched."""

ClientOpener: TypeAlias = "Callable[[], AbstractContextManager[DaemonClient]]"


def newer_runs(
    daemon: DaemonClient, campaign: str, known: tuple[RunRow, ...] = ()
) -> tuple[RunRow, ...]:
    """Return every run of a search in order; only those that may have changed are asked for."""
    settled = next((i for i, row in enumerate(known) if not row.settled), len(known))
    return (*known[:settled], *daemon.all_runs(campaign, offset=settled, results=True))


def latest_snapshot(
    daemon: DaemonClient, run: str, patience: float = LIVE_PATIENCE
) -> Snapshot | None:
    """Return how far a run is, ``None`` when it does not tell within ``patience`` seconds."""
    told: list[Snapshot] = []
    came = threading.Event()

    def take(message: LiveSnapshot) -> None:
        told.append(message.snapshot)
        came.set()

    watch = daemon.watch(run, take)
    try:
        came.wait(patience)
    finally:
        watch.close()
    return told[-1] if told else None
