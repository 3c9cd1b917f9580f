"""A running stack as its run sees it: started, watched, read, and ended or kept.

The work is done by a supervisor, a process of its own (:mod:`daemon.supervision`),
which ends the stack also when the run's process cannot ask for it any more.
"""

from __future__ import annotations

import os
import secrets
import shlex
import shutil
import signal
import socket
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Final

from daemon.model.sut import SutFailure
from daemon.stacks.ros2.container import (
    container_name,
    container_script,
    find_engine,
    image_command,
    run_command,
)
from daemon.stacks.ros2.control import ANSWER_LIMIT, ERRORS, SupervisorWire
from daemon.stacks.ros2.folders import (
    StackRecord,
    end_remains,
    end_stack,
    make_folder,
    recorded_stacks,
)
from daemon.stacks.ros2.isolation import (
    DomainLock,
    DomainTaken,
    environment_script,
    isolating_variables,
    lock_domain,
    runtime_folder,
    without_ours,
)
from daemon.stacks.ros2.placeholders import PlaceholderError
from daemon.stacks.ros2.settings import Ros2Settings, fill_settings
from daemon.supervision.guardian import holder
from daemon.supervision.output_file import OutputFile
from daemon.supervision.plan import (
    ENVIRONMENT,
    RELAY_OUTPUT,
    STACK_OUTPUT,
    StackPlan,
)
from daemon.supervision.remains import KILL_LIMIT, MARKER
from grammars.text.terminal_text import printable, without_escapes

SOCKET_VARIABLE: Final = "SCENARIO_SOCKET"
NONCE_VARIABLE: Final = "SCENARIO_NONCE"
"""Where the relay connects, and what it shows there."""
KEEP_VARIABLE: Final = "SCENARIO_KEEP"
"""Set to 1 the relay waits for the next run after one."""
_GRACE: Final = 5.0
_IDLE: Final = 60.0
_ENGINE_FAILED: Final = 125
"""Exit code of podman and docker when they failed themselves (podman-run(1))."""
_ENGINE_LIMIT: Final = 40.0
"""Seconds that the engine of a container is given to end and to remove it."""


class StackProcess:
    """The stack of one run, and the relay beside it; or one that an earlier run has left for it.

    ``values`` are those of placeholders; ``domain`` is added to them. ``key`` is the digest of all
    that must be equal for a stack to be used again. ``relay`` is the file that is run by the
    stack's Python. ``grace`` [s] is waited after SIGINT and again after SIGTERM, ``idle`` [s] for
    the next run.

    The folder is there from the beginning, the rest after :meth:`start`. Whoever makes one has to
    release it. Raises ``SutFailure`` when there is no place for the folder.
    """

    def __init__(
        self,
        settings: Ros2Settings,
        *,
        values: Mapping[str, str],
        key: str,
        relay: Path,
        grace: float = _GRACE,
        idle: float = _IDLE,
    ) -> None:
        self._settings, self._values, self._key = settings, values, key
        self._relay, self._grace, self._idle = relay, grace, idle
        self._wire: SupervisorWire | None = None
        self._lock: IO[str] | None = None
        self._domain_lock: socket.socket | None = None
        self._outputs: dict[str, bytes] | None = None
        self._ended = ""
        # A kept stack is for the next run that is forked from the same process.
        self._owner = holder() if settings.reuse else 0
        self.domain = -1
        root = runtime_folder()
        try:
            end_remains(root)
            self.reused = self._take_over(root)
            if not self.reused:
                self.folder, self._lock = make_folder(root)
                self.nonce = secrets.token_hex(16)
        except OSError as error:
            raise SutFailure(f"the folder of a stack cannot be made: {error}") from error

    @property
    def socket(self) -> Path:
        """Where the relay connects: the caller listens there."""
        return self.folder / "relay.sock"

    # Starting

    def start(self) -> None:
        """Start the stack, unless it runs already.

        Raises :class:`~daemon.stacks.ros2.isolation.DomainTaken` when another run has the ROS
        domain that was asked for, after which it may be called again; ``SutFailure`` when there is
        something that keeps the command from being started at all.
        """
        if self._wire is not None:
            return
        assert self._lock is not None
        try:
            self.domain, self._domain_lock = self._lock_domain()
            inherited = (self._lock.fileno(), self._domain_lock.fileno())
            plan = self._plan()
            self._wire = SupervisorWire.start(self.folder, without_ours(os.environ), inherited)
        except PlaceholderError as error:
            raise SutFailure(str(error)) from error
        except OSError as error:
            raise SutFailure(f"the stack cannot be started: {error}") from error
        self._wire.send_plan(plan)
        limit = self._settings.start_up + ANSWER_LIMIT
        answer = self._wire.wait_for("started", "failed", limit=limit)
        if answer is None:
            raise SutFailure(self.ended() or "the supervisor of the stack does not answer")
        if "failed" in answer:
            raise SutFailure(answer["failed"])

    def _plan(self) -> StackPlan:
        """Write what the supervisor needs into the folder; return what it is to do."""
        folder, token = self.folder, self.folder.name
        values = {**self._values, "domain": str(self.domain)}
        settings = fill_settings(self._settings, values)
        shell = shutil.which("bash") or shutil.which("sh")
        if shell is None:
            raise SutFailure("there is no shell on this machine: neither bash nor sh")
        relay = self._place_relay()
        relay_variables = {SOCKET_VARIABLE: str(self.socket), NONCE_VARIABLE: self.nonce}
        if self._owner:
            relay_variables[KEEP_VARIABLE] = "1"
        container = settings.container
        script = folder / "environment.sh"
        script.write_text(
            environment_script(
                settings.setup,
                settings.environment,
                isolating_variables(folder, None if container else Path.home()),
                {"ROS_DOMAIN_ID": str(self.domain), MARKER: token},
            )
        )
        prepare: list[str] = []
        engine = name = ""
        if container is None:
            dump = shlex.quote(str(folder / ENVIRONMENT))
            # No arguments: a setup file would take them for its own.
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
        StackRecord(self._key, self._owner, self.nonce, self.domain, engine, name).write(folder)
        return StackPlan(
            token=token,
            folder=str(folder),
            domain=self.domain,
            setup=prepare,
            stack=stack,
            relay=relay_command,
            relay_variables=relay_variables,
            engine=engine,
            name=name,
            owner=self._owner,
            grace=self._grace,
            idle=self._idle,
            setup_limit=self._settings.start_up,
        )

    def _place_relay(self) -> Path:
        """Copy the relay to where nothing else lies that its Python could import by mistake."""
        place = self.folder / "relay"
        place.mkdir(exist_ok=True)
        return Path(shutil.copyfile(self._relay, place / self._relay.name))

    def _take_over(self, root: Path) -> bool:
        """Become the holder of a stack of this key that an earlier run has left, if there is one.

        A supervisor gives it to one only, so two slots never share it.
        """
        if not self._settings.reuse:
            return False
        for folder, record in recorded_stacks(root):
            if (record.owner, record.key) != (self._owner, self._key):
                continue
            self._wire = SupervisorWire.take_over(folder)
            if self._wire is not None:
                self.folder, self.nonce, self.domain = folder, record.nonce, record.domain
                # Of the run before: whoever listens makes a new one.
                self.socket.unlink(missing_ok=True)
                return True
        return False

    def _lock_domain(self) -> DomainLock:
        wanted = self._settings.domain
        try:
            return lock_domain(wanted)
        except DomainTaken:
            if not self._end_idle(wanted):
                raise
            return lock_domain(wanted)

    def _end_idle(self, domain: int | None) -> bool:
        """End a stack in this domain that is kept for a run that may never come."""
        for folder, record in recorded_stacks(self.folder.parent):
            wire = SupervisorWire.take_over(folder) if record.domain == domain else None
            if wire is not None:
                _ask_to_end(wire, self._grace)
                wire.close(limit=ANSWER_LIMIT)
                return True
        return False

    # Watching

    def ended(self) -> str:
        """Return how stack or relay ended, empty while both live."""
        if self._wire is None or self._outputs is not None:
            return self._ended
        self._wire.listen()
        for event in self._wire.events:
            if event.get("ended") == "stack":
                if event["code"] == _ENGINE_FAILED and self._settings.container is not None:
                    return f"the container cannot be started{self._quote(STACK_OUTPUT)}"
                return f"the launch command {_end_in_words(event['code'])}"
            if event.get("ended") == "relay":
                return f"the relay {_end_in_words(event['code'])}{self._quote(RELAY_OUTPUT)}"
        if self._wire.lost:
            return f"the supervisor of the stack was ended{self._quote(ERRORS)}"
        return ""

    def _quote(self, name: str) -> str:
        last = _lines(self._read(name))[-1:]
        return f': "{last[0]}"' if last else ""

    def last_lines(self, count: int = 20) -> tuple[str, ...]:
        """Return the last lines the stack printed, without escapes for terminals."""
        return tuple(_lines(self._read(STACK_OUTPUT))[-count:])

    def outputs(self) -> Mapping[str, bytes]:
        """Return what stack and relay printed in this run, by name, at most a MiB each."""
        if self._outputs is not None:
            return self._outputs
        found = {"stack.txt": self._read(STACK_OUTPUT), "relay.txt": self._read(RELAY_OUTPUT)}
        return {name: data for name, data in found.items() if data or name == "stack.txt"}

    def _read(self, name: str) -> bytes:
        if self._outputs is not None:
            return self._outputs.get(name.replace(".output", ".txt"), b"")
        path = self.folder / name
        if name == ERRORS:
            return path.read_bytes() if path.exists() else b""
        return OutputFile.read(path)

    # The end

    def release(self, *, keep: bool) -> None:
        """Leave the stack for the next run of the same key, or end it, all of it.

        Kept is only what lives, for at most a minute, and if the SUT file says ``reuse``. After
        this, :meth:`outputs` returns what was printed until now. May be called again.
        """
        if self._outputs is not None:
            return
        self._ended = self.ended()
        wire = self._wire
        if wire is not None and keep and self._owner and not self._ended:
            printed = dict(self.outputs())
            wire.tell("keep")
            if wire.wait_for("kept", limit=ANSWER_LIMIT) is not None:
                self._outputs = printed
                wire.let_go()
                self._unlock()
                return
        gone = False
        if wire is not None:
            gone = _ask_to_end(wire, self._grace)
        self._outputs = dict(self.outputs())
        if wire is not None:
            gone = wire.close(limit=ANSWER_LIMIT) and gone
        if not gone or self.folder.exists():
            end_stack(self.folder)
        self._unlock()

    def _unlock(self) -> None:
        """Let go of what says to others that the stack is alive: a supervisor has it, too."""
        for lock in (self._lock, self._domain_lock):
            if lock is not None:
                lock.close()


def _ask_to_end(wire: SupervisorWire, grace: float) -> bool:
    """Have a stack ended; returns whether its supervisor says that nothing of it is left."""
    wire.tell("end")
    limit = 2.0 * grace + KILL_LIMIT + _ENGINE_LIMIT + ANSWER_LIMIT
    return wire.wait_for("gone", limit=limit) is not None


def _end_in_words(code: int) -> str:
    known = {int(number): number.name for number in signal.Signals}
    if code < 0:
        return f"was killed by {known.get(-code, f'signal {-code}')}"
    # A shell's codes for what it has started (bash(1), EXIT STATUS).
    special = {126: "what it names cannot be executed", 127: "command not found"}
    special |= {128 + number: f"{name} in a process it started" for number, name in known.items()}
    why = f" ({special[code]})" if code in special else ""
    return f"ended with exit code {code}{why}"


def _lines(data: bytes) -> list[str]:
    text = without_escapes(data.decode("utf-8", "replace"))
    return [printable(line).rstrip() for line in text.splitlines() if line.strip()]
