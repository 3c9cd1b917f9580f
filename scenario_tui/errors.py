"""Errors that the public functions raise.

ScenarioError                root of them all
├── InputError               a file, a name or a text cannot be used; ``findings`` says why
│   ├── TraceError           a trace is damaged, cut off or not to be trusted
│   └── MissingExtraError    an optional part of this project is not installed
└── DaemonError              a daemon did not answer a request
    ├── Refused              it refused: the campaign or run does not exist
    ├── Unreachable          no daemon answers
    │   └── Unavailable      it cannot do it now; its disk is full, for example
    ├── LaunchFailed         a daemon was started and did not come up
    ├── PlaceUnusable        a state directory or an address cannot be used
    ├── KeysUnusable         keys for a connection are missing, damaged or of the wrong kind
    └── TraceUnavailable     the trace of a run does not exist or cannot be reached

A finding of an :class:`InputError` has the file and the line (``where``), the problem
(``message``) and the remedy (``hint``). An interrupt is a ``KeyboardInterrupt``, as everywhere.
"""

from daemon.batch.errors import (
    DaemonError,
    KeysUnusable,
    LaunchFailed,
    PlaceUnusable,
    Refused,
    TraceUnavailable,
    Unavailable,
    Unreachable,
)
from daemon.trace import TraceError
from grammars.text.diagnostics import InputError, ScenarioError
from grammars.text.plugins import MissingExtraError

__all__ = [
    "DaemonError",
    "InputError",
    "KeysUnusable",
    "LaunchFailed",
    "MissingExtraError",
    "PlaceUnusable",
    "Refused",
    "ScenarioError",
    "TraceError",
    "TraceUnavailable",
    "Unavailable",
    "Unreachable",
]
