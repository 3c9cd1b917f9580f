"""The daemon's housekeeping: what nobody needs any more goes, now and then, by a thread."""

from __future__ import annotations

import threading
import time
from collections import Counter
from typing import Final

from daemon.batch.errors import DaemonError
from daemon.batch.ledger import remove_strays
from daemon.batch.paths import StatePaths
from daemon.batch.server._runtime import EventLog

_PERIOD: Final = 3600.0
# A look reads the folders and, of the ledger, what every run needs: a rest of at least so many
# times its length keeps it below 2 % of a core and of the disk.
_SHARE: Final = 50.0


class Housekeeping(threading.Thread):
    """Removes strays, at once and every hour, until closed."""

    def __init__(self, paths: StatePaths, log: EventLog) -> None:
        super().__init__(name="housekeeping", daemon=True)
        self._paths = paths
        self._log = log
        self._closing = threading.Event()

    def run(self) -> None:
        """Look now and then until closed."""
        while not self._closing.is_set():
            begun = time.monotonic()
            try:
                self._tidy()
            except (DaemonError, OSError) as error:
                self._log.write("strays not removed", problem=str(error))
            self._closing.wait(max(_PERIOD, _SHARE * (time.monotonic() - begun)))

    def _tidy(self) -> None:
        # By the wall clock, which is what files are dated by.
        gone = remove_strays(self._paths, time.time())
        if gone:
            kinds = Counter(stray.what for stray in gone)
            self._log.write("strays removed", bytes=sum(s.bytes for s in gone), files=dict(kinds))

    def close(self) -> None:
        """Finish what is under way."""
        self._closing.set()
        if self.is_alive():
            self.join()
