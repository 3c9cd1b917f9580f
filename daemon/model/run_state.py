"""States of a run in the ledger.

Separate from the records of runs (:mod:`daemon.model.status`), which take longer to load than the
dashboard's first screen.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Final


class RunState(StrEnum):
    """State of a run in the ledger; ``lost`` means no result after every attempt."""

    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"
    LOST = "lost"
    CANCELLED = "cancelled"


UNFINISHED_STATES: Final = (RunState.RUNNING, RunState.QUEUED)
"""States of runs that may still have a result."""
