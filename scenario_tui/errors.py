"""Errors that the public functions raise, and nothing else on purpose.

ScenarioError                root of them all
├── InputError               a file, a name or a text cannot be used; ``findings`` says why
│   ├── TraceError           a trace is damaged, cut off or not to be trusted
│   └── MissingExtraError    an optional part of this project is not installed
└── DaemonError              a daemon did not do what it was asked to
    ├── Refused              it answered no: there is no such campaign or run
    ├── Unreachable          none answers where one was expected
    │   └── Unavailable      it cannot do it just now, its disk is full, say
    ├── LaunchFailed         one that was started did not come up
    ├── PlaceUnusable        a state directory or an address cannot be used
    ├── KeysUnusable         keys for a connection are missing, damaged or of the wrong kind
    └── TraceUnavailable     the trace of a run is nowhere to be had

The findings of an :class:`InputError` tell the file and the line (``where``), what is wrong
(``message``) and what to do (``hint``). An interrupt is a ``KeyboardInterrupt``, as everywhere.
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
