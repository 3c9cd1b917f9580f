"""Where the daemon keeps things: the state directory and the endpoint.

ledger.db  daemon.lock  daemon.json  daemon.log  worker.log  search.log
socket/daemon.sock
scenes/<digest>.json  files/<digest>
traces/<campaign>/<scenario>.<sut>.<repeat>.mcap
spool/<worker>/<run>/attempt-<k>.<token>/
aside/<name>.<8 hexadecimal digits>
incoming/<run>.<token>.<digest>.mcap|part  incoming/<digest>.part
marker.json

Shell completion asks at every TAB where the ledger lies: what is heavy is imported when needed.
"""

from __future__ import annotations

import fcntl
import hashlib
import ipaddress
import os
import re
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import platformdirs

from daemon.model.ids import is_digest, is_id
from grammars.text.files import private_folder

if TYPE_CHECKING:
    from daemon.model.status import DiskUsage

STATE_VARIABLE: Final = "SCENARIO_STATE"
INSECURE_VARIABLE: Final = "SCENARIO_INSECURE"
"""Set to speak plain TCP to other machines all the same."""
_ENDPOINT: Final = re.compile(r"(?:tcp|tls)/(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+):([0-9]{1,5})\Z")
_SOCKET: Final = "unixsock-stream/"
_SOCKET_PATH: Final = re.compile(r"/[^?#\x00-\x1f]+\Z")
_LONGEST_SOCKET: Final = 100
"""Bytes of a socket's path: systems take 103 or 107."""
_SPARE_SPACE: Final = 32 * 2**20
_SPARE_FILES: Final = 1000
"""Bytes and files that must be free before a run starts: some long traces, the ledger's growth."""


def is_endpoint(text: str) -> bool:
    """Whether ``text`` is an endpoint we speak.

    ``tcp/<host>:<port>``, ``tls/<host>:<port>``, or ``unixsock-stream/<path>`` for the socket of a
    daemon of this machine.
    """
    if text.startswith(_SOCKET):
        return _SOCKET_PATH.match(text.removeprefix(_SOCKET)) is not None
    found = _ENDPOINT.match(text)
    return found is not None and int(found[2]) < 65536


def socket_path(endpoint: str) -> Path | None:
    """Return the path of an endpoint that is a socket, ``None`` for others."""
    return Path(endpoint.removeprefix(_SOCKET)) if endpoint.startswith(_SOCKET) else None


def endpoint_text(endpoint: str) -> str:
    """Return an endpoint as people know it: a socket by its path alone."""
    return str(socket_path(endpoint) or endpoint)


def parse_endpoint(text: str) -> str:
    """Return the endpoint people mean: the path of a socket stands for the socket."""
    return f"{_SOCKET}{text}" if text.startswith("/") else text


def is_encrypted(endpoint: str) -> bool:
    """Whether what travels there is encrypted and both sides prove who they are."""
    return endpoint.startswith("tls/")


def is_local(endpoint: str) -> bool:
    """Whether what travels there never leaves this machine: a socket, or its loopback."""
    found = _ENDPOINT.match(endpoint)
    if found is None:
        return endpoint.startswith(_SOCKET)
    try:
        return ipaddress.ip_address(found[1].strip("[]")).is_loopback
    except ValueError:
        return found[1] == "localhost"


@dataclass(frozen=True, slots=True)
class DaemonContact:
    """Content of ``daemon.json``: how to reach the daemon that keeps the state directory."""

    endpoint: str
    pid: int
    version: str
    started_at: float


@dataclass(frozen=True, slots=True)
class StatePaths:
    """The state directory and what lies in it.

    One property for each thing that lies there: a table, in spite of its many members.
    """

    state: Path

    @classmethod
    def find(cls, state: Path | None = None, environ: Mapping[str, str] = os.environ) -> StatePaths:
        """Choose the directory: the argument, ``SCENARIO_STATE``, else the user's state folder."""
        chosen = state or environ.get(STATE_VARIABLE)
        path = Path(chosen) if chosen else platformdirs.user_state_path("scenario")
        return cls(path.expanduser().absolute())

    @property
    def ledger(self) -> Path:
        """The SQLite file."""
        return self.state / "ledger.db"

    @property
    def lock(self) -> Path:
        """Locked by the daemon as long as it lives."""
        # A lock, not a process id in a file: it is gone with the process, however that ended.
        return self.state / "daemon.lock"

    @property
    def contact_file(self) -> Path:
        """Endpoint and process id of the running daemon."""
        return self.state / "daemon.json"

    @property
    def socket(self) -> Path:
        """The socket by which its owner's clients and workers on this machine reach the daemon.

        It lies in a folder for its owner alone: who may connect is for the file system to say.
        Systems limit the length of its path; for a long one the folder lies with the temporary
        files.
        """
        path = self.state / "socket" / "daemon.sock"
        if len(os.fsencode(path)) <= _LONGEST_SOCKET and _SOCKET_PATH.match(str(path)):
            return path
        import tempfile

        name = hashlib.sha256(os.fsencode(self.state)).hexdigest()[:16]
        return Path(tempfile.gettempdir()) / f"scenario-{os.getuid()}" / f"{name}.sock"

    @property
    def endpoint(self) -> str:
        """Endpoint of the socket."""
        return f"{_SOCKET}{self.socket}"

    @property
    def scenes(self) -> Path:
        """Compiled scenes by digest."""
        return self.state / "scenes"

    @property
    def traces(self) -> Path:
        """Traces by campaign."""
        return self.state / "traces"

    @property
    def spool(self) -> Path:
        """Attempts that are running or not yet acknowledged, by worker."""
        return self.state / "spool"

    @property
    def files(self) -> Path:
        """Files of systems under test by digest."""
        return self.state / "files"

    @property
    def incoming(self) -> Path:
        """Files on their way here, and traces whose results are not in the ledger yet."""
        return self.state / "incoming"

    @property
    def aside(self) -> Path:
        """Damaged inputs, and folders of attempts that cannot be removed."""
        return self.state / "aside"

    def put_aside(self, path: Path) -> Path:
        """Move a file or folder out of the way; returns its new path. Raises ``OSError``."""
        self.aside.mkdir(mode=0o700, exist_ok=True)
        return path.rename(self.aside / f"{path.name}.{os.urandom(4).hex()}")

    @property
    def marker(self) -> Path:
        """What only those can read who share the daemon's file system."""
        return self.state / "marker.json"

    @property
    def log(self) -> Path:
        """What the daemon did, one JSON object per line."""
        return self.state / "daemon.log"

    @property
    def worker_log(self) -> Path:
        """What the local worker, its children and a dying daemon wrote to standard error."""
        return self.state / "worker.log"

    @property
    def search_log(self) -> Path:
        """What detached searches write."""
        return self.state / "search.log"

    @property
    def folders(self) -> tuple[Path, ...]:
        """All folders in which something is kept, itself first."""
        kept = (self.scenes, self.files, self.traces, self.spool, self.incoming)
        return (self.state, *kept)

    def cache(self, identity: str) -> StatePaths:
        """Return the folder of a worker for the daemon of another state directory."""
        return StatePaths(self.state / "work" / identity)

    @property
    def caches(self) -> tuple[StatePaths, ...]:
        """The folders of workers that have another daemon, which copy its inputs."""
        return tuple(StatePaths(folder) for folder in sorted(self.state.glob("work/*/")))

    def make_folders(self) -> None:
        """Create the directories, readable by their owner only; raises ``OSError``."""
        for folder in self.folders:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)

    def make_socket_folder(self) -> None:
        """Create the folder of the socket; raises ``OSError`` when it is not ours alone."""
        # Whoever owns the folder of the socket can put another socket there.
        private_folder(self.socket.parent)

    def disk_shortage(self) -> str:
        """Say so when the disk is too full to keep what a run leaves, empty when it is not.

        The same words however much is left: another amount is no other trouble.
        """
        try:
            disk = os.statvfs(self.state)
        except OSError as error:
            return f"{self.state} cannot be used: {error.strerror}"
        wanted = []
        if disk.f_bavail * disk.f_frsize < _SPARE_SPACE:
            wanted.append(f"{_SPARE_SPACE // 2**20} MiB")
        # Some file systems have no table of files that could be full, and say 0 of 0.
        if disk.f_files and disk.f_favail < _SPARE_FILES:
            wanted.append(f"{_SPARE_FILES} files (inodes)")
        if not wanted:
            return ""
        return f"the disk of {self.state} is full: runs wait until {' and '.join(wanted)} are free"

    def disk(self) -> DiskUsage:
        """Measure the file system of the state directory; raises ``OSError``."""
        from daemon.model.status import DiskUsage

        usage = shutil.disk_usage(self.state)
        journal = self.ledger.with_name(f"{self.ledger.name}-wal")
        sizes = (path.stat().st_size for path in (self.ledger, journal) if path.exists())
        return DiskUsage(usage.total, usage.free, sum(sizes))

    def scene(self, digest: str) -> Path:
        """Path of a scene; raises ``ValueError`` when ``digest`` is none."""
        if not is_digest(digest):
            raise ValueError(f"{digest!r} is not a digest")
        return self.scenes / f"{digest}.json"

    def trace(self, name: str) -> Path:
        """Path of a trace named by :func:`trace_name`; raises ``ValueError`` for other names."""
        campaign, _, file = name.partition("/")
        if not is_id(campaign) or not re.fullmatch(r"[A-Za-z0-9_~%-][A-Za-z0-9_~%.-]*", file):
            raise ValueError(f"{name!r} is not the name of a trace")
        return self.traces / campaign / file

    def uploaded_trace(self, run: str, token: int, sha256: str) -> Path:
        """Path of a whole trace that waits for the result under its lease."""
        return self.incoming / f"{run}.{token}.{sha256}.mcap"

    def trace_sizes(self, campaign: str) -> tuple[int, ...]:
        """Bytes of each trace that lies here of a campaign; raises ``ValueError`` for no id."""
        if not is_id(campaign):
            raise ValueError(f"{campaign!r} is not a campaign id")
        try:
            with os.scandir(self.traces / campaign) as found:
                return tuple(entry.stat(follow_symlinks=False).st_size for entry in found)
        except FileNotFoundError:
            return ()

    def read_contact(self) -> DaemonContact | None:
        """Return who keeps this directory, or ``None`` when no daemon has said so."""
        from grammars.text import codec

        try:
            return codec.from_json(DaemonContact, self.contact_file.read_bytes())
        except (OSError, ValueError):
            return None

    def known_endpoint(self) -> str | None:
        """Return where the daemon of this directory listens, or ``None`` when there is no trace."""
        contact = self.read_contact()
        if contact is not None:
            return contact.endpoint
        # A daemon whose disk is full cannot say where it is; its socket is where it always is.
        return self.endpoint if self.socket.is_socket() else None


def is_locked(path: Path) -> bool:
    """Whether a process holds the lock that ``path`` is; its lock ends with the process.

    One that is not there is held by nobody. Raises ``OSError`` for what cannot be a lock.
    """
    with suppress(FileNotFoundError, NotADirectoryError), path.open("rb") as lock:
        try:
            # Shared, so that two who look do not take each other for its holder, and given back at
            # once: a daemon that starts meanwhile would be told that there is one already.
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def is_same_folder(one: Path, other: Path) -> bool:
    """Whether two paths lead to one folder, whatever they are called."""
    return one == other or (one.is_dir() and other.is_dir() and one.samefile(other))


@dataclass(frozen=True, slots=True)
class Endpoint:
    """An endpoint and where it was found."""

    address: str
    origin: Literal["--connect", "SCENARIO_CONNECT", "daemon.json", "default"]


def find_endpoint(
    connect: str = "", state: Path | None = None, environ: Mapping[str, str] = os.environ
) -> Endpoint:
    """Choose the endpoint: ``connect``, ``SCENARIO_CONNECT``, ``daemon.json``, the default.

    The default is the socket of the state directory, so nobody talks to a daemon of somebody else
    without having named it.
    """
    if connect:
        return Endpoint(connect, "--connect")
    if environ.get("SCENARIO_CONNECT"):
        return Endpoint(parse_endpoint(environ["SCENARIO_CONNECT"]), "SCENARIO_CONNECT")
    paths = StatePaths.find(state, environ)
    known = paths.known_endpoint()
    if known is not None:
        return Endpoint(known, "daemon.json")
    return Endpoint(paths.endpoint, "default")
