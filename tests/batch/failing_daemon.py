"""``python -m daemon`` that fails at verbs, as files in a folder ``faults`` beside its state say.

Its clock is turned (:mod:`tests.turned_clock`).
A file has the name of a verb and contains the kind of fault, one of :data:`FAULTS`, ``garbles``
or ``slow``.
"""

import errno
import json
import os
import sys
import time
from pathlib import Path

from daemon.__main__ import main
from daemon.batch.errors import Refused
from daemon.batch.server import _dispatcher
from tests.turned_clock import turn

FAULTS = {
    "raises": RuntimeError("nobody thought of that"),
    "system": OSError(errno.EIO, os.strerror(errno.EIO)),
    "malformed": Refused("the request is malformed: versions differ"),
}
"""What a handler raises. With ``garbles`` no worker understands its answer, with ``slow`` it takes
a while.
"""


def _answer(verb, *args, **more):
    fault = Path(json.loads(sys.argv[2])["state"]).with_name("faults") / verb.name
    kind = fault.read_text() if fault.exists() else ""
    if kind in FAULTS:
        raise FAULTS[kind]
    if kind == "slow":
        time.sleep(0.2)
    answer = _original(verb, *args, **more)
    return b'{"no": "answer"}' if kind == "garbles" else answer


_original = _dispatcher._answer

if __name__ == "__main__":
    _dispatcher._answer = _answer
    turn(Path(json.loads(sys.argv[2])["state"]).parent)
    sys.exit(main())
