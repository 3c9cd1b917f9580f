"""The daemon's housekeeping: traces stay below the quota, and strays go, by a thread."""

from __future__ import annotations

import threading
import time
from collections import Counter
from typing import Final

from daemon.batch.amounts import size_text
from daemon.batch.errors import DaemonError
from daemon.batch.ledger import RetentionPolicy, remove_strays, stored_bytes, sweep_traces
from daemon.batch.paths import StatePaths
from daemon.batch.server._runtime import EventLog

# Seconds between two looks at traces: regularly, and at least, when the quota is reached.
_PERIOD: Final = 60.0
_REST: Final = 1.0
_STRAYS_PERIOD: Final = 3600.0
# A look reads the folder of every campaign, and of the ledger what every run needs: a rest of at
# least so many times its length keeps it below 2 % of a core and of the disk.
_SHARE: Final = 50.0
# Part of the quota that is left after sweeping, so that not every trace makes us look again.
_LEAST: Final = 0.95


class Housekeeping(threading.Thread):
    """Keeps the traces below ``limit`` bytes (0: no limit) and removes strays, until closed.

    ``used`` is what traces take now, as far as is known; ``trouble`` says why no run may start.
    """

    def __init__(self, paths: StatePaths, log: EventLog, limit: int) -> None:
        super().__init__(name="housekeeping", daemon=True)
        self.limit = limit
        self.used = 0
        self.trouble = ""
        self._paths = paths
        self._log = log
        self._strays_due = 0.0
        self._wake = threading.Event()
        self._closing = threading.Event()

    def add_bytes(self, size: int) -> None:
        """A trace of ``size`` bytes came; looks soon if that was too much."""
        self.used += size
        if self.limit and self.used > self.limit:
            self._wake.set()

    def run(self) -> None:
        """Look now and then until closed."""
        while not self._closing.is_set():
            begun = time.monotonic()
            try:
                self._keep_quota()
                if begun >= self._strays_due:
                    self._strays_due = begun + _STRAYS_PERIOD
                    self._remove_strays()
            except (DaemonError, OSError) as error:
                self._log.write("housekeeping failed", problem=str(error))
            self._closing.wait(max(_REST, _SHARE * (time.monotonic() - begun)))
            # With no run allowed to start nothing will wake us: room is looked for again and again.
            if not self.trouble:
                self._wake.wait(_PERIOD)
            self._wake.clear()

    def close(self) -> None:
        """Finish what is under way."""
        self._closing.set()
        self._wake.set()
        if self.is_alive():
            self.join()

    def _keep_quota(self) -> None:
        self.used = stored_bytes(self._paths)
        if self.limit and self.used > self.limit:
            policy = RetentionPolicy(size=int(_LEAST * self.limit))
            swept = sweep_traces(self._paths, policy, time.time())
            self.used = swept.rest
            if swept.traces:
                campaigns = list(dict.fromkeys(trace.campaign for trace in swept.traces))
                self._log.write(
                    "traces removed", bytes=swept.freed, traces=len(swept.traces), of=campaigns[:20]
                )
        before, self.trouble = self.trouble, self._trouble_text()
        if bool(before) != bool(self.trouble):
            self._log.write("quota", trouble=self.trouble, bytes=self.used)

    def _trouble_text(self) -> str:
        if not self.limit or self.used <= self.limit:
            return ""
        return (
            f"traces of unfinished campaigns take {size_text(self.used)}, the quota is "
            f"{size_text(self.limit)}: no more runs start until there is room; start the daemon "
            "with a larger --quota, or cancel a campaign"
        )

    def _remove_strays(self) -> None:
        # By the wall clock, which is what files are dated by.
        gone = remove_strays(self._paths, time.time())
        if gone:
            kinds = Counter(stray.what for stray in gone)
            self._log.write("strays removed", bytes=sum(s.bytes for s in gone), files=dict(kinds))
