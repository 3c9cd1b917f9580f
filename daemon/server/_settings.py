"""What whoever starts a daemon may choose."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Settings:
    """Seconds and counts of the daemon.

    A ``lease`` lasts this long and is renewed every third of it; a worker that lost its
    connection keeps its runs for ``grace``; a run is lost after ``attempts`` bad endings; a
    daemon told to stop lets its local worker finish for ``patience``. Traces belong into the
    ``store``, a URL; into the state directory when it is empty, and take at most ``quota`` bytes
    there (0: as much as they like).
    """

    lease: float = 30.0
    grace: float = 5.0
    attempts: int = 3
    patience: float = 20.0
    store: str = ""
    quota: int = 0

    @property
    def renew(self) -> float:
        """Seconds between two renewals."""
        return self.lease / 3

    @property
    def tick(self) -> float:
        """Seconds between two looks at the clock for lapsed leases and gone workers."""
        return min(0.5, self.lease / 10, max(self.grace / 4, 0.02))
