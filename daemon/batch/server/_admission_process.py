"""The process that reads, checks and makes ready one large submission, or one search.

``python -m daemon.batch.server._admission_process REQUEST STAGED STATE VERB`` writes an
:class:`ErrorReply` to standard output when something is wrong, and nothing when all is well.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Final

from daemon.batch.errors import DaemonError, Unavailable
from daemon.batch.paths import StatePaths
from daemon.batch.server._searches import stage_search_here
from daemon.batch.server._submissions import stage_here
from daemon.model.messages import ErrorKind, ErrorReply
from daemon.model.verbs import SEARCH
from grammars.text import codec

_NICE: Final = 5
"""How far it stands back: what waits for the daemon meanwhile are leases and renewals."""


def main(request: str, staged: str, state: str, verb: str) -> None:
    """Admit a submission, or a search; says on standard output what is wrong with it."""
    os.nice(_NICE)
    try:
        payload = Path(request).read_bytes()
        if verb == str(SEARCH):
            stage_search_here(payload, Path(staged))
        else:
            stage_here(payload, Path(staged), StatePaths(Path(state)))
    except DaemonError as error:
        passing = isinstance(error, Unavailable)
        kind = ErrorKind.UNAVAILABLE if passing else ErrorKind.REFUSED
        sys.stdout.buffer.write(codec.to_json(ErrorReply(str(error), kind)))
    except OSError as error:
        words = f"the submission cannot be stored: {error}"
        sys.stdout.buffer.write(codec.to_json(ErrorReply(words, ErrorKind.UNAVAILABLE)))


if __name__ == "__main__":
    main(*sys.argv[1:])
