"""Opening a state directory, and what a daemon answers while it cannot: its disk is full, say."""

from __future__ import annotations

import errno
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from importlib.metadata import version as installed_version
from pathlib import Path
from typing import Any, Final

from daemon.batch import bus
from daemon.batch.errors import DaemonError, Unavailable
from daemon.batch.ledger import LedgerWriter, WalState, set_damaged_aside
from daemon.batch.paths import StatePaths
from daemon.batch.permissions import secure_state
from daemon.batch.server._dispatcher import RequestDispatcher, VerbHandler
from daemon.batch.server._request_limits import RequestLimits
from daemon.batch.server._runtime import DaemonSettings, EventLog, ListenSettings
from daemon.batch.server._stopping import StopRequest
from daemon.batch.server._threads import LedgerlessThread
from daemon.batch.stores import Marker, write_marker
from daemon.model.messages import ASK, Empty
from daemon.model.run_state import RunState
from daemon.model.status import DaemonOverview, DiskUsage
from daemon.model.verbs import VERBS

_AGAIN: Final = 1.0
"""Seconds until a state directory that cannot be opened is tried again."""
_NO_ROOM: Final = (errno.ENOSPC, errno.EDQUOT)


@dataclass(frozen=True, slots=True)
class OpenedState:
    """What a daemon works on; ``damage`` says what its ledger has lost, empty when nothing."""

    ledger: LedgerWriter
    marker: Marker
    damage: str


def open_state(
    stack: ExitStack, paths: StatePaths, settings: DaemonSettings, log: EventLog
) -> OpenedState:
    """Open a state directory once; ``stack`` closes the ledger.

    Raises :class:`Unavailable` while there is no room on its disk or somebody else holds the
    ledger, and :class:`DaemonError` for what waiting does not mend.
    """
    try:
        paths.make_folders()
        tightened = secure_state(paths)
        if tightened:
            log.write("closed to others", paths=tightened)
        marker = write_marker(paths)
        wal, copy = set_damaged_aside(paths.ledger, time.time())
    except OSError as error:
        where = error.filename or paths.state
        words = f"{where} cannot be written: {error.strerror}"
        raise (Unavailable if error.errno in _NO_ROOM else DaemonError)(words) from error
    damage = _damage_text(wal, copy)
    if damage:
        log.write("ledger damaged", problem=damage)
    ledger = stack.enter_context(
        LedgerWriter.open(paths, attempts=settings.attempts, lease=settings.lease)
    )
    return OpenedState(ledger, marker, damage)


def _damage_text(wal: WalState, copy: Path | None) -> str:
    if not wal.lost:
        return ""
    kept = f"; what is left of it is in {copy}" if copy else ""
    return (
        f"the ledger's WAL was damaged or removed: about {wal.lost} acknowledged changes are lost"
        f"{kept}: see `scenario doctor`, and submit again what is missing"
    )


def _for_anybody(method: Callable[[Any, Any], object]) -> Callable[[Any, Any, str], object]:
    """Make what is done about a verb whoever asks."""
    return lambda ledger, request, _: method(ledger, request)


class WaitingDaemon:
    """Answers as well as it can while the state directory cannot be opened."""

    def __init__(self, paths: StatePaths, stop: StopRequest, log: EventLog) -> None:
        self._paths = paths
        self._stop = stop
        self._log = log
        self._version = installed_version("scenario-tui")
        self._started_at = time.time()
        self.trouble = ""

    def wait(self, listening: ListenSettings, attempt: Callable[[], OpenedState]) -> OpenedState:
        """Answer until an attempt at opening succeeds.

        Raises :class:`Unavailable` when told to stop before, and whatever else ``attempt`` raises.
        """
        with ExitStack() as stack:
            session = stack.enter_context(bus.open_router(listening.endpoints, listening.keys))
            thread = LedgerlessThread("without-ledger")
            thread.start()
            stack.callback(thread.finish)
            handlers = {verb: VerbHandler(_for_anybody(self._refuse)) for verb in VERBS.values()}
            for name in ("overview", "workers", "disk", "shutdown"):
                handlers[VERBS[name]] = VerbHandler(_for_anybody(getattr(self, name)))
            threads = (thread,) * 5
            dispatcher = RequestDispatcher(
                handlers, self._log, *threads, limits=RequestLimits(self._log, listening.keys)
            )
            stack.enter_context(session.declare_queryable(f"{ASK}/**", dispatcher.on_query))
            while True:
                try:
                    return attempt()
                except Unavailable as error:
                    self._note(str(error))
                if self._stop.wait(_AGAIN):
                    raise Unavailable(self.trouble)

    def _note(self, words: str) -> None:
        shortage = self._paths.disk_shortage()
        trouble = f"{shortage} ({words})" if shortage else words
        if trouble != self.trouble:
            self.trouble = trouble
            self._log.write("waiting", trouble=trouble)

    def _refuse(self, _: object, __: object) -> object:
        raise Unavailable(self.trouble)

    def overview(self, _: object, __: object) -> DaemonOverview:
        """Nothing is known of the ledger; the trouble says so."""
        counts: dict[str, Any] = {state.value: 0 for state in RunState}
        return DaemonOverview(
            version=self._version,
            state=str(self._paths.state),
            started_at=self._started_at,
            now=time.time(),
            campaigns=0,
            workers=0,
            **counts,
            passed=0,
            failed=0,
            inconclusive=0,
            errors=0,
            rate=0.0,
            seconds_left=None,
            trouble=self.trouble,
            troubles=(self.trouble,) if self.trouble else (),
        )

    def workers(self, _: object, __: object) -> tuple[()]:
        """None: they have to wait."""
        return ()

    def disk(self, _: object, __: object) -> DiskUsage:
        """How full it is."""
        return self._paths.disk()

    def shutdown(self, _: object, __: object) -> Empty:
        """End without having begun."""
        self._log.write("shutdown requested")
        self._stop()
        return Empty()
