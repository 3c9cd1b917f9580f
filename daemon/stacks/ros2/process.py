"""Process of a stack for its run: start, watch, read output, and end.

A separate supervisor process does the work (:mod:`daemon.supervision`). It also ends the stack if
the run's process dies. Folders of running stacks have the locks of their holders:

    scenario-<uid>/stacks/lock              held while a folder is made or all are searched
    scenario-<uid>/stacks/<token>/lock      held as long as the stack's supervisor or holder lives
    scenario-<uid>/stacks/<token>/stack.json

A folder with a free lock belongs to a killed supervisor. The next stack that starts on this machine
ends it.
"""

from __future__ import annotations

import fcntl
import inspect
import json
import os
import secrets
import select
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any, Final

from daemon.model.sut import SutFailure
from daemon.stacks.ros2.causes import ALARMS, ProcessDeath
from daemon.stacks.ros2.container import (
    container_name,
    container_script,
    find_engine,
    image_command,
    run_command,
)
from daemon.stacks.ros2.isolation import (
    environment_script,
    isolating_variables,
    lock_domain,
    runtime_folder,
    without_ours,
)
from daemon.stacks.ros2.settings import PlaceholderError, Ros2Settings, fill_settings
from daemon.supervision.output_file import OutputFile
from daemon.supervision.remains import (
    KILL_LIMIT,
    MARKER,
    PROGRAM,
    end_container,
    end_marked,
    marked_processes,
    parent_of,
    remove_shared_memory,
)
from daemon.supervision.supervisor import ENVIRONMENT, RELAY_OUTPUT, STACK_OUTPUT, StackPlan
from grammars.text import codec
from grammars.text.files import write_atomically
from grammars.text.terminal_text import printable, without_escapes

SOCKET_VARIABLE: Final = "SCENARIO_SOCKET"
NONCE_VARIABLE: Final = "SCENARIO_NONCE"
"""Variables for the relay: the socket to connect to, and its password."""
_GRACE: Final = 5.0
_ENGINE_FAILED: Final = 125
"""Exit code of podman and docker for their own failures (podman-run(1))."""
_ENGINE_LIMIT: Final = 40.0
"""Time for the engine of a container to end and to remove it [s]."""

_LOCK: Final = "lock"
_RECORD: Final = "stack.json"
_ERRORS: Final = "supervisor.txt"
"""Error output of a supervisor that fails."""
_ANSWER_LIMIT: Final = 60.0
"""Time limit for a supervisor's answer [s], in addition to its own waits; it may share a processor
with many runs."""
_ROOM: Final = Path(inspect.getfile(StackPlan)).parent


class StackProcess:
    """Stack of one run, and its relay.

    ``values`` are those of placeholders, except ``domain``. The stack's Python runs the file
    ``relay``. The end waits ``grace`` [s] after SIGINT and again after SIGTERM.

    The folder exists from the beginning, the rest after :meth:`start`. The caller must call
    :meth:`release`. Raises ``SutFailure`` if the folder cannot be made.
    """

    def __init__(
        self,
        settings: Ros2Settings,
        *,
        values: Mapping[str, str],
        relay: Path,
        grace: float = _GRACE,
    ) -> None:
        self._settings, self._values = settings, values
        self._relay, self._grace = relay, grace
        self._supervisor: _Supervisor | None = None
        self._domain_lock: socket.socket | None = None
        self._outputs: dict[str, bytes] | None = None
        self._ended = ""
        self._nodes: dict[int, str] = {}
        """Names of the processes with nodes, by pidfd."""
        self.domain = -1
        root = runtime_folder()
        try:
            _end_remains(root)
            self.folder, self._lock = _make_folder(root)
        except OSError as error:
            raise SutFailure(f"the folder of a stack cannot be made: {error}") from error
        self.nonce = secrets.token_hex(16)

    @property
    def socket(self) -> Path:
        """Socket for the relay; the caller listens there."""
        return self.folder / "relay.sock"

    # Starting

    def start(self) -> None:
        """Start the stack.

        Raises :class:`~daemon.stacks.ros2.isolation.DomainTaken` if another run has the requested
        ROS domain; a later call may succeed. Raises ``SutFailure`` if the command cannot start.
        """
        domain = self._settings.environment.domain
        try:
            self.domain, self._domain_lock = lock_domain(None if domain == "own" else domain)
            inherited = (self._lock.fileno(), self._domain_lock.fileno())
            self._supervisor = _Supervisor(self._plan(), inherited)
        except PlaceholderError as error:
            raise SutFailure(str(error)) from error
        except OSError as error:
            raise SutFailure(f"the stack cannot be started: {error}") from error
        limit = self._settings.start_up + _ANSWER_LIMIT
        answer = self._supervisor.wait_for("started", "failed", limit=limit)
        if answer is None:
            raise SutFailure(self.ended() or "the supervisor of the stack does not answer")
        if "failed" in answer:
            raise SutFailure(answer["failed"])

    def _plan(self) -> StackPlan:
        """Write the supervisor's files into the folder; return its plan."""
        folder, token = self.folder, self.folder.name
        values = {**self._values, "domain": str(self.domain)}
        settings = fill_settings(self._settings, values)
        shell = shutil.which("bash") or shutil.which("sh")
        if shell is None:
            raise SutFailure("there is no shell on this machine: neither bash nor sh")
        relay = self._place_relay()
        relay_variables = {SOCKET_VARIABLE: str(self.socket), NONCE_VARIABLE: self.nonce}
        container = settings.container
        home = None
        with suppress(RuntimeError):
            home = None if container else Path.home()
        script = folder / "environment.sh"
        script.write_text(
            environment_script(
                settings.environment.setup,
                settings.environment.variables,
                isolating_variables(folder, home),
                {"ROS_DOMAIN_ID": str(self.domain), MARKER: token},
            )
        )
        prepare: list[str] = []
        engine = name = ""
        if container is None:
            dump = shlex.quote(str(folder / ENVIRONMENT))
            # No arguments, because a setup file would read them as its own.
            words = f". {shlex.quote(str(script))} && command cat /proc/self/environ > {dump}"
            prepare = [shell, "-c", words]
            stack = [shell, "-c", settings.launch]
            relay_command = [settings.python, str(relay)]
        else:
            engine, name = find_engine(container), container_name(token)
            launch = settings.launch or image_command(engine, container)
            inside = folder / "container.sh"
            inside.write_text(
                container_script(script, launch, settings.python, relay, relay_variables)
            )
            files = [path for path in map(Path, settings.files.values()) if path.is_file()]
            stack = run_command(engine, container, folder=folder, files=files, script=inside)
            relay_command = []
        _StackRecord(self.domain, engine, name).write(folder)
        return StackPlan(
            token=token,
            folder=str(folder),
            domain=self.domain,
            setup=prepare,
            stack=stack,
            relay=relay_command,
            relay_variables=relay_variables,
            alarms=list(ALARMS),
            engine=engine,
            name=name,
            holder=os.getpid(),
            grace=self._grace,
            setup_limit=self._settings.start_up,
        )

    def _place_relay(self) -> Path:
        """Copy the relay into a folder without other modules that its Python could import."""
        place = self.folder / "relay"
        place.mkdir(exist_ok=True)
        return Path(shutil.copyfile(self._relay, place / self._relay.name))

    # Watching

    def ended(self) -> str:
        """Return a description of the end of stack or relay, empty while both live."""
        if self._supervisor is None or self._outputs is not None:
            return self._ended
        self._supervisor.listen()
        for event in self._supervisor.events:
            if event.get("ended") == "stack":
                if event["code"] == _ENGINE_FAILED and self._settings.container is not None:
                    return f"the container cannot be started{self._quote(STACK_OUTPUT)}"
                return f"the launch command {_end_in_words(event['code'])}"
            if event.get("ended") == "relay":
                return f"the relay {_end_in_words(event['code'])}{self._quote(RELAY_OUTPUT)}"
        if self._supervisor.is_lost:
            return f"the supervisor of the stack was ended{self._quote(_ERRORS)}"
        return ""

    def watch_nodes(self, nodes: Sequence[str]) -> None:
        """Watch the processes whose command lines name ``nodes`` (absolute names)."""
        names: dict[int, str] = {}
        for process in marked_processes(self.folder.name):
            with suppress(OSError):
                words = Path(f"/proc/{process}/cmdline").read_text(errors="replace").split("\0")
                name = Path(words[0]).name
                if nodes and ProcessDeath(name, 0, " ".join(words)).is_of(nodes):
                    names[process] = name
        # Shells and ``ros2 run`` repeat the command line of the process that they wait for.
        for process in names.keys() - set(map(parent_of, names)):
            with suppress(OSError):
                self._nodes[os.pidfd_open(process)] = names[process]

    def dead_process(self) -> str:
        """Return the name of an ended process with nodes, empty while all live."""
        poller = select.poll()
        for descriptor in self._nodes:
            poller.register(descriptor, select.POLLIN)
        return min((self._nodes[descriptor] for descriptor, _ in poller.poll(0)), default="")

    def _quote(self, name: str) -> str:
        last = _lines(self._read(name))[-1:]
        return f': "{last[0]}"' if last else ""

    def alarms(self) -> list[str]:
        """Return the lines of the stack that contain an alarm, oldest first; at most 100."""
        if self._supervisor is None:
            return []
        if self._outputs is None:
            self._supervisor.listen()
        return [one["alarm"] for one in self._supervisor.events if "alarm" in one]

    def lines(self) -> list[str]:
        """Return the output lines of the stack without terminal escapes."""
        return _lines(self._read(STACK_OUTPUT))

    def outputs(self) -> Mapping[str, bytes]:
        """Return the output of stack and relay by name, at most a MiB each."""
        if self._outputs is not None:
            return self._outputs
        outputs = {"stack.txt": self._read(STACK_OUTPUT), "relay.txt": self._read(RELAY_OUTPUT)}
        return {name: data for name, data in outputs.items() if data or name == "stack.txt"}

    def _read(self, name: str) -> bytes:
        if self._outputs is not None:
            return self._outputs.get(name.replace(".output", ".txt"), b"")
        path = self.folder / name
        if name == _ERRORS:
            return path.read_bytes() if path.exists() else b""
        return OutputFile.read(path)

    # The end

    def release(self) -> None:
        """End the whole stack; further calls do nothing.

        :meth:`outputs` then returns the final output.
        """
        if self._outputs is not None:
            return
        self._ended = self.ended()
        is_gone = False
        if self._supervisor is not None:
            self._supervisor.ask_to_end()
            limit = 2.0 * self._grace + KILL_LIMIT + _ENGINE_LIMIT + _ANSWER_LIMIT
            is_gone = self._supervisor.wait_for("gone", limit=limit) is not None
        self._outputs = dict(self.outputs())
        if self._supervisor is not None:
            is_gone = self._supervisor.close(limit=_ANSWER_LIMIT) and is_gone
        if not is_gone or self.folder.exists():
            _end_stack(self.folder)
        for descriptor in self._nodes:
            os.close(descriptor)
        self._nodes.clear()
        # The stack counts as alive as long as a process has one of these open.
        for lock in (self._lock, self._domain_lock):
            if lock is not None:
                lock.close()


class _Supervisor:
    """Supervisor process of one stack, and the wire to it.

    It executes ``plan``, holds locks in the descriptors ``inherited``, and ends its stack when
    this end of the wire closes. ``events`` are its reports, oldest first; after ``is_lost`` no more
    will come. Raises ``OSError`` if it cannot start.
    """

    def __init__(self, plan: StackPlan, inherited: tuple[int, ...]) -> None:
        self.events: list[dict[str, Any]] = []
        self.is_lost = False
        self._received = b""
        self._wire, theirs = socket.socketpair()
        # Isolated, because Python's variables in the environment are for the stack.
        words = [sys.executable, "-I", "-S", "-c", PROGRAM, str(_ROOM.parent)]
        try:
            with theirs, Path(plan.folder, _ERRORS).open("wb") as errors:
                self._process = subprocess.Popen(
                    words,
                    env=without_ours(os.environ),
                    cwd=plan.folder,
                    stdin=theirs.fileno(),
                    stdout=theirs.fileno(),
                    stderr=errors,
                    start_new_session=True,
                    pass_fds=inherited,
                )
        except OSError:
            self._wire.close()
            raise
        self._send(asdict(plan))

    def ask_to_end(self) -> None:
        """Request the end of the stack; the event ``gone`` confirms that it is complete."""
        self._send({"end": True})

    def _send(self, request: dict[str, Any]) -> None:
        # The wait for the answer notices a dead supervisor.
        with suppress(OSError):
            self._wire.sendall(json.dumps(request).encode() + b"\n")

    def wait_for(self, *names: str, limit: float) -> dict[str, Any] | None:
        """Return the first event of one of these names, ``None`` after ``limit`` s without one."""
        deadline = time.monotonic() + limit
        while True:
            for event in self.events:
                if any(name in event for name in names):
                    return event
            rest = deadline - time.monotonic()
            if self.is_lost or rest <= 0:
                return None
            self.listen(rest)

    def listen(self, limit: float = 0.0) -> None:
        """Read new events; wait up to ``limit`` [s] for the first."""
        while not self.is_lost and select.select([self._wire], [], [], limit)[0]:
            limit = 0.0
            try:
                data = self._wire.recv(4096)
            except ConnectionError:
                data = b""
            self.is_lost = not data
            *lines, self._received = (self._received + data).split(b"\n")
            self.events += map(json.loads, lines)

    def close(self, *, limit: float) -> bool:
        """Close the wire and wait up to ``limit`` [s] for the supervisor's end, then kill it.

        Return whether it ended by itself.
        """
        self._wire.close()
        try:
            return self._process.wait(limit) == 0
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            return False


def _end_in_words(code: int) -> str:
    names = {int(number): number.name for number in signal.Signals}
    if code < 0:
        return f"was killed by {names.get(-code, f'signal {-code}')}"
    # Exit codes of a shell for its commands (bash(1), EXIT STATUS).
    special = {126: "the command cannot be executed", 127: "command not found"}
    special |= {128 + number: f"{name} in a process it started" for number, name in names.items()}
    why = f" ({special[code]})" if code in special else ""
    return f"ended with exit code {code}{why}"


def _lines(data: bytes) -> list[str]:
    text = without_escapes(data.decode("utf-8", "replace"))
    return [printable(line).rstrip() for line in text.splitlines() if line.strip()]


@dataclass(frozen=True, slots=True)
class _StackRecord:
    """Data for ending a stack from outside; ``engine`` and ``name`` are those of a container."""

    domain: int
    engine: str = ""
    name: str = ""

    def write(self, folder: Path) -> None:
        """Write it into the stack's folder; raises ``OSError``."""
        write_atomically(folder / _RECORD, codec.to_json(self), durable=False)

    @classmethod
    def read(cls, folder: Path) -> _StackRecord | None:
        """Return the record in a folder, ``None`` before the stack's start."""
        try:
            return codec.from_json(cls, (folder / _RECORD).read_bytes())
        except (OSError, ValueError):
            return None


def _make_folder(root: Path) -> tuple[Path, IO[str]]:
    """Make the folder of a new stack, named by its token; return it with its held lock.

    Raises ``OSError``.
    """
    with _alone(root):
        folder = root / secrets.token_hex(8)
        folder.mkdir(mode=0o700)
        lock = (folder / _LOCK).open("w")
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return folder, lock


def _end_remains(root: Path) -> None:
    """End the stacks of killed supervisors on this machine; raises ``OSError``."""
    with _alone(root):
        remains = [(folder, _try_lock(folder)) for folder in root.iterdir() if folder.is_dir()]
    for folder, lock in remains:
        if lock is not None:
            with lock:
                _end_stack(folder)


def _end_stack(folder: Path) -> None:
    """End a stack without a supervisor, and remove its folder."""
    end_marked(folder.name)
    record = _StackRecord.read(folder)
    if record is not None and record.engine:
        end_container(record.engine, record.name)
    elif record is not None:
        remove_shared_memory(record.domain)
    # Files that a container made as root stay, without harm.
    shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def _alone(root: Path) -> Iterator[None]:
    with (root / _LOCK).open("a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _try_lock(folder: Path) -> IO[str] | None:
    try:
        # It may be missing if a supervisor was killed while it removed its folder.
        lock = (folder / _LOCK).open("a")
    except FileNotFoundError:
        return None  # the folder is gone by now
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        lock.close()
        return None
    return lock
