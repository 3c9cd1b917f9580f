"""``python -m daemon.search``: makes the proposals of a daemon's searches for as long as any runs.

The daemon starts it, holds its standard input, and starts it again when it dies.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Final

from daemon.batch.client import Client
from daemon.batch.errors import EXIT_FAILED, DaemonError, Unreachable
from daemon.batch.paths import StatePaths
from daemon.batch.tether import exit_when_stdin_closes
from daemon.model.execution import DEFAULT_SEARCHER
from daemon.search.coordinator import Coordinator, load_searcher
from grammars.text.terminal_text import printable_streams

_NICE: Final = 5
"""How far it stands back: before runs, which wait for proposals, and behind the daemon."""
_OOM_SCORE: Final = "500"
"""Where memory is short it goes before the daemon, which starts it again."""
_PATIENCE: Final = 30.0
"""Seconds to wait for an answer before the question is asked again."""
_AGAIN: Final = 0.5


def main() -> int:
    """Coordinate searches until none runs."""
    parser = argparse.ArgumentParser(prog="python -m daemon.search")
    parser.add_argument("--state", type=Path, required=True)
    parser.add_argument("--connect", default="")
    parser.add_argument("--searcher", default=DEFAULT_SEARCHER)
    options = parser.parse_args()
    _stand_back()
    exit_when_stdin_closes()
    paths = StatePaths.find(options.state)
    with printable_streams():
        searcher = load_searcher(options.searcher)
        try:
            with _connect(options.connect or paths.endpoint) as client:
                Coordinator(client, paths, searcher).run()
        except DaemonError as error:
            print(error, file=sys.stderr)
            return EXIT_FAILED
    return 0


def _connect(endpoint: str) -> Client:
    """Connect to the daemon, which may be busy: it ends this process when it ends."""
    while True:
        try:
            return Client.open(endpoint, timeout=_PATIENCE)
        except Unreachable:
            time.sleep(_AGAIN)


def _stand_back() -> None:
    os.nice(_NICE)
    with suppress(OSError):  # not on every system
        Path("/proc/self/oom_score_adj").write_text(_OOM_SCORE)


if __name__ == "__main__":
    sys.exit(main())
