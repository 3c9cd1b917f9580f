"""Paths of the daemon: the state directory and the endpoint.

ledger.db  daemon.lock  daemon.json  daemon.log  worker.log  search.log
socket/daemon.sock
scenes/<digest>.json  files/<digest>
traces/<campaign>/<scenario>.<sut>.<repeat>.mcap
spool/<worker>/<run>/attempt-<k>.<token>/
aside/<name>.<8 hexadecimal digits>
incoming/<run>.<token>.<digest>.mcap|part  incoming/<digest>.part
marker.json

Heavy modules are imported when needed: shell completion looks up the ledger at every TAB.
"""

from __future__ import annotations

import fcntl
import hashlib
import ipaddress
import os
import re
import shutil
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

from daemon.model.ids import is_digest, is_id
from grammars.text.files import private_folder, user_folder, written_path

if TYPE_CHECKING:
    from daemon.model.status import DiskUsage

STATE_VARIABLE: Final = "SCENARIO_STATE"
INSECURE_VARIABLE: Final = "SCENARIO_INSECURE"
"""Set to allow plain TCP to other machines."""
_ENDPOINT: Final = re.compile(r"(?:tcp|tls)/(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+):([0-9]{1,5})\Z")
_SOCKET: Final = "unixsock-stream/"
_SOCKET_PATH: Final = re.compile(r"/[^?#\x00-\x1f]+\Z")
_LONGEST_SOCKET: Final = 100
"""Longest path of a socket [B]: systems take 103 or 107."""
_SPARE_SPACE: Final = 32 * 2**20
_SPARE_FILES: Final = 1000
"""Bytes and files that must be free before a run starts, for traces and the ledger's growth."""


def is_endpoint(text: str) -> bool:
    """Return whether ``text`` is a supported endpoint.

    ``tcp/<host>:<port>``, ``tls/<host>:<port>``, or ``unixsock-stream/<path>`` for the socket of a
    daemon on this machine.
    """
    if text.startswith(_SOCKET):
        return _SOCKET_PATH.match(text.removeprefix(_SOCKET)) is not None
    match = _ENDPOINT.match(text)
    return match is not None and int(match[2]) < 65536


def socket_path(endpoint: str) -> Path | None:
    """Return the path of a socket endpoint, ``None`` for others."""
    return Path(endpoint.removeprefix(_SOCKET)) if endpoint.startswith(_SOCKET) else None


def endpoint_text(endpoint: str) -> str:
    """Return an endpoint for people: a socket as its path alone."""
    return str(socket_path(endpoint) or endpoint)


def parse_endpoint(text: str) -> str:
    """Return the endpoint for a text of people, such as the path of a socket."""
    return f"{_SOCKET}{text}" if text.startswith("/") else text


def is_encrypted(endpoint: str) -> bool:
    """Return whether an endpoint is encrypted, with authentication of both sides."""
    return endpoint.startswith("tls/")


def is_local(endpoint: str) -> bool:
    """Return whether an endpoint is inside this machine: a socket, or loopback."""
    match = _ENDPOINT.match(endpoint)
    if match is None:
        return endpoint.startswith(_SOCKET)
    try:
        return ipaddress.ip_address(match[1].strip("[]")).is_loopback
    except ValueError:
        return match[1] == "localhost"


@dataclass(frozen=True, slots=True)
class DaemonContact:
    """Content of ``daemon.json``: the address of the daemon that keeps the state directory."""

    endpoint: str
    pid: int
    version: str
    started_at: float


class _Place:
    """Attribute of :class:`StatePaths`: the path with this name in the state directory."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, paths: StatePaths, _: type) -> Path:
        return paths.state / self._name


@dataclass(frozen=True, slots=True)
class StatePaths:
    """Paths in the state directory, one attribute for each."""

    state: Path

    ledger = _Place("ledger.db")
    """The SQLite file."""
    # A lock, not a process id in a file: it always ends with the process.
    lock = _Place("daemon.lock")
    """Locked by the daemon as long as it lives."""
    contact_file = _Place("daemon.json")
    """Endpoint and process id of the running daemon."""
    scenes = _Place("scenes")
    """Compiled scenes by digest."""
    traces = _Place("traces")
    """Traces by campaign."""
    spool = _Place("spool")
    """Attempts that run or are not yet acknowledged, by worker."""
    files = _Place("files")
    """Files of systems under test by digest."""
    incoming = _Place("incoming")
    """Incomplete uploads, and traces whose results are not in the ledger yet."""
    aside = _Place("aside")
    """Damaged inputs, and folders of attempts that cannot be removed."""
    marker = _Place("marker.json")
    """Marker, readable only by processes that share the daemon's file system."""
    log = _Place("daemon.log")
    """Log of the daemon, one JSON object per line."""
    worker_log = _Place("worker.log")
    """Standard error of the local worker, its children and a dying daemon."""
    search_log = _Place("search.log")
    """Output of detached searches."""

    @classmethod
    def find(cls, state: Path | None = None) -> StatePaths:
        """Choose the directory: the argument, ``SCENARIO_STATE`` or the user's state folder."""
        path = state or os.environ.get(STATE_VARIABLE) or user_folder("state")
        return cls(written_path(path))

    @property
    def socket(self) -> Path:
        """The daemon's socket for its owner's clients and workers on this machine.

        Its folder is for its owner alone, so the file system decides who may connect. Systems limit
        the length of its path; a long one moves to the folder of temporary files.
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

    def put_aside(self, path: Path) -> Path:
        """Move a file or folder out of the way; return its new path. Raises ``OSError``."""
        self.aside.mkdir(mode=0o700, exist_ok=True)
        return path.rename(self.aside / f"{path.name}.{os.urandom(4).hex()}")

    @property
    def folders(self) -> tuple[Path, ...]:
        """All folders with data, itself first."""
        return (self.state, self.scenes, self.files, self.traces, self.spool, self.incoming)

    def cache(self, identity: str) -> StatePaths:
        """Return the folder of a worker for the daemon of another state directory."""
        return StatePaths(self.state / "work" / identity)

    @property
    def caches(self) -> tuple[StatePaths, ...]:
        """The folders of workers of other daemons, with copies of these daemons' inputs."""
        return tuple(StatePaths(folder) for folder in sorted(self.state.glob("work/*/")))

    def make_folders(self) -> None:
        """Create the folders, readable by their owner only; raises ``OSError``."""
        for folder in self.folders:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)

    def make_socket_folder(self) -> None:
        """Create the folder of the socket; raises ``OSError`` if it is not ours alone."""
        # The owner of the folder can put another socket there.
        private_folder(self.socket.parent)

    def disk_shortage(self) -> str:
        """Return a message if the disk is too full for a run, otherwise an empty text.

        The message has no amount, so that it stays the same trouble while the amount changes.
        """
        try:
            disk = os.statvfs(self.state)
        except OSError as error:
            return f"{self.state} cannot be used: {error.strerror}"
        missing = []
        if disk.f_bavail * disk.f_frsize < _SPARE_SPACE:
            missing.append(f"{_SPARE_SPACE // 2**20} MiB")
        # Some file systems have no limit of files, and report 0 of 0.
        if disk.f_files and disk.f_favail < _SPARE_FILES:
            missing.append(f"{_SPARE_FILES} files (inodes)")
        if not missing:
            return ""
        return f"the disk of {self.state} is full: runs wait until {' and '.join(missing)} are free"

    def disk(self) -> DiskUsage:
        """Measure the file system of the state directory; raises ``OSError``."""
        from daemon.model.status import DiskUsage

        usage = shutil.disk_usage(self.state)
        journal = self.ledger.with_name(f"{self.ledger.name}-wal")
        sizes = (path.stat().st_size for path in (self.ledger, journal) if path.exists())
        return DiskUsage(usage.total, usage.free, sum(sizes))

    def scene(self, digest: str) -> Path:
        """Return the path of a scene; raises ``ValueError`` for an invalid digest."""
        if not is_digest(digest):
            raise ValueError(f"{digest!r} is not a digest")
        return self.scenes / f"{digest}.json"

    def trace(self, name: str) -> Path:
        """Return the path of a trace by its name; raises ``ValueError`` for an invalid one."""
        campaign, _, file = name.partition("/")
        if not is_id(campaign) or not re.fullmatch(r"[A-Za-z0-9_~%-][A-Za-z0-9_~%.-]*", file):
            raise ValueError(f"{name!r} is not the name of a trace")
        return self.traces / campaign / file

    def uploaded_trace(self, run: str, token: int, sha256: str) -> Path:
        """Return the path of a complete trace that waits for the result under its lease."""
        return self.incoming / f"{run}.{token}.{sha256}.mcap"

    def trace_sizes(self, campaign: str) -> tuple[int, ...]:
        """Return the size of each trace of a campaign [B]; raises ``ValueError`` for a bad id."""
        if not is_id(campaign):
            raise ValueError(f"{campaign!r} is not a campaign id")
        try:
            with os.scandir(self.traces / campaign) as entries:
                return tuple(entry.stat(follow_symlinks=False).st_size for entry in entries)
        except FileNotFoundError:
            return ()

    def read_contact(self) -> DaemonContact | None:
        """Return the contact of this directory's daemon, or ``None`` without one."""
        from grammars.text import codec

        try:
            return codec.from_json(DaemonContact, self.contact_file.read_bytes())
        except (OSError, ValueError):
            return None

    def known_endpoint(self) -> str | None:
        """Return the endpoint of this directory's daemon, or ``None`` if unknown."""
        contact = self.read_contact()
        if contact is not None:
            return contact.endpoint
        # A daemon with a full disk cannot write its contact, but its socket has a fixed path.
        return self.endpoint if self.socket.is_socket() else None


def is_locked(path: Path) -> bool:
    """Return whether a process holds the lock file ``path``; a lock ends with its process.

    A missing file is not locked. Raises ``OSError`` for a path that cannot be a lock.
    """
    with suppress(FileNotFoundError, NotADirectoryError), path.open("rb") as lock:
        try:
            # Shared, so that two readers do not take each other for the holder, and released at
            # once, so that a starting daemon does not find it locked.
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def is_same_folder(one: Path, other: Path) -> bool:
    """Return whether two paths lead to the same folder."""
    return one == other or (one.is_dir() and other.is_dir() and one.samefile(other))


@dataclass(frozen=True, slots=True)
class Endpoint:
    """An endpoint and its origin."""

    address: str
    origin: Literal["--connect", "SCENARIO_CONNECT", "daemon.json", "default"]


def find_endpoint(connect: str = "", state: Path | None = None) -> Endpoint:
    """Choose the endpoint: ``connect``, ``SCENARIO_CONNECT``, ``daemon.json``, the default.

    The default is the socket of the state directory, so a client reaches another person's daemon
    only by name.
    """
    if connect:
        return Endpoint(connect, "--connect")
    if named := os.environ.get("SCENARIO_CONNECT"):
        return Endpoint(parse_endpoint(named), "SCENARIO_CONNECT")
    paths = StatePaths.find(state)
    endpoint = paths.known_endpoint()
    if endpoint is not None:
        return Endpoint(endpoint, "daemon.json")
    return Endpoint(paths.endpoint, "default")
