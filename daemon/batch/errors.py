"""Errors between a client, the daemon and its workers.

DaemonError
├── Unreachable       nobody answers at the endpoint
│   └── Unavailable   the daemon cannot do it now, for example with a full disk
│       ├── Failed    the daemon met an error of its own
│       └── OtherLedger   the daemon keeps another ledger than the one that granted the lease
├── Refused           the daemon refused; the message is its words
│   └── Rejected      a result is never accepted, for one of five named reasons
├── PlaceUnusable     a given state directory or address cannot be used
├── AlreadyRunning    another daemon keeps this state directory
├── TraceUnavailable  a trace cannot be read here: it is gone or out of reach
├── KeysUnusable      the keys for a connection are missing, damaged or of the wrong kind
├── LaunchFailed      a daemon was started and did not come up
└── WorkerBroken      a worker cannot execute runs at all

Callers decide by the class, never by the message: retry after :class:`Unreachable`, not after
:class:`Refused`. A worker keeps a finished run after every error except :class:`Rejected`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from grammars.text.diagnostics import ScenarioError

if TYPE_CHECKING:  # completion imports this module at every TAB
    from daemon.model.messages import Rejection

EXIT_FAILED: Final = 3
EXIT_ALREADY_RUNNING: Final = 4
EXIT_BROKEN: Final = 5
"""Exit codes of ``python -m daemon`` after one of these errors."""


class DaemonError(ScenarioError):
    """Root of the errors that the daemon's client side raises on purpose."""


class Unreachable(DaemonError):  # noqa: N818  (reads as a sentence where it is raised)
    """Nobody answers at the endpoint."""


class Unavailable(Unreachable):
    """The daemon cannot do it now; asking again later may help."""


class Failed(Unavailable):
    """The daemon met an error of its own; the request may be valid."""


class OtherLedger(Unavailable):
    """The daemon keeps another ledger than the one that granted the lease; that one may return."""


class Refused(DaemonError):  # noqa: N818  (reads as a sentence where it is raised)
    """The daemon refused the request."""


class Rejected(Refused):
    """A result is never accepted; ``rejection`` is the reason."""

    def __init__(self, problem: str, rejection: Rejection) -> None:
        super().__init__(problem)
        self.rejection = rejection


class PlaceUnusable(DaemonError):  # noqa: N818  (reads as a sentence where it is raised)
    """A given place cannot be used: a folder without ledger, an address in use."""


class AlreadyRunning(DaemonError):  # noqa: N818  (reads as a sentence where it is raised)
    """Another daemon keeps this state directory."""


class TraceUnavailable(DaemonError):  # noqa: N818  (reads as a sentence where it is raised)
    """A trace cannot be read here: it is gone, damaged, or out of reach."""


class KeysUnusable(DaemonError):  # noqa: N818  (reads as a sentence where it is raised)
    """The keys for a connection are missing, damaged, or belong to somebody else."""


class LaunchFailed(DaemonError):  # noqa: N818  (reads as a sentence where it is raised)
    """A daemon was started and did not come up."""


class WorkerBroken(DaemonError):  # noqa: N818  (reads as a sentence where it is raised)
    """A worker cannot execute runs at all: a missing module, a version mismatch, no spool."""
