"""Opening of a state directory by the daemon that works on it."""

from __future__ import annotations

import errno
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Final

from daemon.batch.errors import DaemonError, Unavailable
from daemon.batch.ledger import LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.batch.permissions import secure_state
from daemon.batch.server._runtime import DaemonSettings, EventLog
from daemon.batch.stores import Marker, write_marker

_NO_ROOM: Final = (errno.ENOSPC, errno.EDQUOT)


@dataclass(frozen=True, slots=True)
class OpenedState:
    """The ledger of a state directory, its marker, and the era of the ledger that begins."""

    ledger: LedgerWriter
    marker: Marker
    era: str


def open_state(
    stack: ExitStack, paths: StatePaths, settings: DaemonSettings, log: EventLog
) -> OpenedState:
    """Open a state directory; ``stack`` closes the ledger.

    Raises :class:`Unavailable` while its disk has no room or another program holds the ledger,
    and :class:`DaemonError` for problems that waiting does not mend.
    """
    try:
        paths.make_folders()
        tightened = secure_state(paths)
        if tightened:
            log.write("closed to others", paths=tightened)
        marker = write_marker(paths)
    except OSError as error:
        where = error.filename or paths.state
        words = f"{where} cannot be written: {error.strerror}"
        if error.errno in _NO_ROOM:
            raise Unavailable(f"{words}: free some space and start the daemon again") from error
        raise DaemonError(words) from error
    ledger = stack.enter_context(LedgerWriter.open(paths, attempts=settings.attempts))
    era = ledger.begin_era()
    for why in ledger.holds():
        log.write("held", why=why)
    return OpenedState(ledger, marker, era)
