"""``python -m daemon serve|worker ORDER``: the processes behind the ``scenario`` command.

``ORDER`` is a JSON object with the parameters of :func:`daemon.batch.server.serve` or
:func:`daemon.batch.worker.work`.
"""

from __future__ import annotations

import json
import sys

from pydantic import validate_call

from daemon.batch.errors import (
    EXIT_ALREADY_RUNNING,
    EXIT_BROKEN,
    EXIT_FAILED,
    AlreadyRunning,
    DaemonError,
    WorkerBroken,
)
from grammars.text.terminal_text import printable_streams


def main() -> int:
    """Run the chosen process; return its exit code."""
    process, text = sys.argv[1:]
    order = json.loads(text)
    with printable_streams():
        try:
            if process == "serve":
                from daemon.batch.server import serve

                validate_call(serve)(**order)
            else:
                from daemon.batch.worker import work

                validate_call(work)(**order)
        except DaemonError as error:
            print(error, file=sys.stderr)
            if isinstance(error, AlreadyRunning):
                return EXIT_ALREADY_RUNNING
            return EXIT_BROKEN if isinstance(error, WorkerBroken) else EXIT_FAILED
    return 0


if __name__ == "__main__":
    sys.exit(main())
