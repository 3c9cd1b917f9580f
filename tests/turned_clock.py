"""``python -m tests.turned_clock serve ORDER``: a daemon whose clock of leases is set.

Two files beside the state directory hold seconds that were added to it: ``later`` those that it
went on, ``held_up`` those that passed while the daemon stood still. Its local worker may take as
long as it needs to give its runs back.
"""

import json
import sys
from pathlib import Path

from daemon.__main__ import main
from daemon.batch.server import _serve
from daemon.batch.server._workers import LeaseClock, LeaseDeadlines
from grammars.text.files import write_atomically

TURNED = {"module": "tests.turned_clock"}
"""Settings of such a daemon."""
_MORE = 3600.0
"""Longer than leases in tests last [s]."""


def end_leases(daemon):
    """Have the leases end that the daemon knows of now."""
    _add(daemon.state.parent / "later")


def add_time(daemon):
    """Have a daemon that stands still do so for longer than a lease lasts."""
    _add(daemon.state.parent / "held_up")


def _add(file):
    write_atomically(file, str(_read(file) + _MORE).encode())


def _read(file):
    return float(file.read_text()) if file.exists() else 0.0


def turn(folder):
    """Have clocks go as files in a folder say."""
    advance, overdue, added = LeaseClock.advance, LeaseDeadlines.overdue, 0.0

    def advance_more(clock, steady):
        return advance(clock, steady + _read(folder / "held_up"))

    def overdue_later(deadlines, leases):
        nonlocal added
        before, added = added, _read(folder / "later")
        overdue(deadlines, leases)  # what was leased since the last look lasts from here
        deadlines._clock.now += added - before
        return overdue(deadlines, leases)

    _serve._LAST_MOMENT = _MORE
    LeaseClock.advance, LeaseDeadlines.overdue = advance_more, overdue_later


if __name__ == "__main__":
    turn(Path(json.loads(sys.argv[2])["state"]).parent)
    sys.exit(main())
