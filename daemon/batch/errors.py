"""What can go wrong between a client, the daemon and its workers.

DaemonError
├── Unreachable       nobody answers at the endpoint
│   └── Unavailable   the daemon answered that it cannot just now: its disk is full, say
│       ├── Failed    an error of the daemon's own kept it from doing what was asked
│       └── OtherLedger   another ledger is kept there than the one that granted the lease
├── Refused           the daemon answered and said no; the message is its words
│   └── Rejected      a result is never to be taken, for one of five named reasons
├── PlaceUnusable     a state directory or an address that was named cannot be used
├── AlreadyRunning    another daemon keeps this state directory
├── TraceUnavailable  a trace cannot be read here: it is gone, or where nobody reaches it
├── KeysUnusable      the keys for a connection are missing, damaged or of the wrong kind
├── LaunchFailed      a daemon was started and did not come up
└── WorkerBroken      a worker cannot execute runs at all

Who asks decides by the class, never by the message: :class:`Unreachable` is worth asking again,
:class:`Refused` is not. A worker keeps a finished run whatever is raised, unless it is
:class:`Rejected`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from grammars.text.diagnostics import ScenarioError

if TYPE_CHECKING:  # completion imports this module at every TAB
    from daemon.model.messages import Rejection

EXIT_FAILED: Final = 3
EXIT_ALREADY_RUNNING: Final = 4
EXIT_BROKEN: Final = 5
"""How ``python -m daemon`` ends when one of these errors ends it."""


class DaemonError(ScenarioError):
    """Root of everything the daemon's client side raises on purpose."""


class Unreachable(DaemonError):  # noqa: N818  (reads as a sentence where it is raised)
    """Nobody answers at the endpoint."""


class Unavailable(Unreachable):
    """The daemon answered that it cannot do it just now; asking again later may help."""


class Failed(Unavailable):
    """The daemon met an error of its own; the request may be as good as any."""


class OtherLedger(Unavailable):
    """The daemon keeps another ledger than the one that granted the lease; that one may return."""


class Refused(DaemonError):  # noqa: N818  (reads as a sentence where it is raised)
    """The daemon answered and said no."""


class Rejected(Refused):
    """A result is never to be taken; the ``rejection`` says why."""

    def __init__(self, problem: str, rejection: Rejection) -> None:
        super().__init__(problem)
        self.rejection = rejection


class PlaceUnusable(DaemonError):  # noqa: N818  (reads as a sentence where it is raised)
    """A place that was named cannot be used: a folder without ledger, an address that is taken."""


class AlreadyRunning(DaemonError):  # noqa: N818  (reads as a sentence where it is raised)
    """Another daemon keeps this state directory."""


class TraceUnavailable(DaemonError):  # noqa: N818  (reads as a sentence where it is raised)
    """A trace cannot be read here: it is gone, damaged, or where it cannot be reached."""


class KeysUnusable(DaemonError):  # noqa: N818  (reads as a sentence where it is raised)
    """The keys for a connection are missing, damaged, or those of somebody else."""


class LaunchFailed(DaemonError):  # noqa: N818  (reads as a sentence where it is raised)
    """A daemon was started and did not come up."""


class WorkerBroken(DaemonError):  # noqa: N818  (reads as a sentence where it is raised)
    """A worker cannot execute runs at all: a missing module, a version mismatch, no spool."""
