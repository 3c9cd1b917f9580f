"""What whoever starts a daemon chooses: seconds and counts, and where it listens."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from daemon.batch.errors import DaemonError
from daemon.batch.paths import INSECURE_VARIABLE, StatePaths, is_encrypted, is_local
from daemon.batch.security import DaemonCredentials, find_daemon_credentials


@dataclass(frozen=True, slots=True)
class DaemonSettings:
    """Seconds and counts of the daemon.

    A ``lease`` lasts this long and is renewed every third of it; a worker that lost its
    connection keeps its runs for ``grace``; a run is lost after ``attempts`` bad endings; a
    daemon told to stop lets its local worker finish for ``patience``. Traces belong into the
    ``store``, a URL; into the state directory when it is empty, and take at most ``quota`` bytes
    there (0: as much as they like).
    """

    # Two renewals in a row may get lost. It is also what a run waits whose worker's machine is
    # unplugged; one that dies is noticed at once, by its connection.
    lease: float = 30.0
    # Sessions reconnect within half a second: a network that hiccups costs no run.
    grace: float = 5.0
    # A run may end badly because of its machine; one that does so three times on any of them is
    # taken for the cause, and is not to bring down every worker in turn.
    attempts: int = 3
    patience: float = 20.0
    store: str = ""
    quota: int = 0

    @property
    def renew(self) -> float:
        """Seconds between two renewals."""
        return self.lease / 3

    @property
    def tick(self) -> float:
        """Seconds between two looks at the clock for expired leases and gone workers.

        Small against both times, and not so small that an idle daemon keeps a core awake.
        """
        return min(0.5, self.lease / 10, max(self.grace / 4, 0.02))


@dataclass(frozen=True, slots=True)
class ListenSettings:
    """``socket`` is for the daemon's owner on this machine; ``address`` for others, or empty.

    ``keys`` say whom an encrypted address admits.
    """

    socket: str
    address: str = ""
    keys: DaemonCredentials | None = None

    @property
    def endpoints(self) -> tuple[str, ...]:
        """All endpoints."""
        return (self.socket, self.address) if self.address else (self.socket,)


def prepare_endpoints(
    paths: StatePaths, listen: str = "", keys: Path | None = None, *, insecure: bool = False
) -> ListenSettings:
    """Return where to listen, ready to do so.

    Raises :class:`DaemonError` for plain TCP that other machines could reach, unless ``insecure``,
    and :class:`daemon.batch.errors.KeysUnusable` when an encrypted address has no keys.
    """
    try:
        paths.make_socket_folder()
    except OSError as error:
        words = f"cannot listen at {paths.socket}: {error.filename}: {error.strerror}"
        raise DaemonError(words) from error
    if listen and is_encrypted(listen):
        return ListenSettings(paths.endpoint, listen, find_daemon_credentials(keys))
    if listen and not (is_local(listen) or insecure or os.environ.get(INSECURE_VARIABLE)):
        raise DaemonError(
            f"{listen} would be open to every machine of the network: listen at tls/ with keys "
            "(`scenario keys init`), or say --insecure"
        )
    # Said again, the daemon's own socket is still one.
    return ListenSettings(paths.endpoint, "" if listen == paths.endpoint else listen)


def exposure_warning(listen: str) -> str:
    """Say who can reach a daemon that listens at ``listen`` without a key; empty for nobody."""
    if not listen or is_encrypted(listen):
        return ""
    who = "everybody with an account on this machine"
    if not is_local(listen):
        who = "everybody in the network, unencrypted and unasked,"
    return f"INSECURE: {who} can look, submit, cancel and stop the daemon through {listen}"
