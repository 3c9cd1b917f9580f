"""Starts a stack and its relay, watches them, and ends all their processes.

A process of its own. Its standard input and output are one end of a socket pair; its holder, the
process of the run, has the other. A first line of JSON is the :class:`StackPlan`, a second one
the request to end the stack; lines in the other direction report events. It also ends the stack
when its holder is gone, however that died.

The processes of a stack are its descendants, including orphans, because it is their subreaper
(prctl(2)). An environment variable identifies the others.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from .child import become_supervisor, prepare_child
from .event_loop import EventLoop
from .output_file import OutputFile
from .remains import (
    KILL_LIMIT,
    MARKER,
    POLL,
    descendants,
    end_container,
    marked_processes,
    remove_shared_memory,
    send_signal,
)

STACK_OUTPUT: Final = "stack.output"
RELAY_OUTPUT: Final = "relay.output"
ENVIRONMENT: Final = "environment"
"""Environment of the stack as the setup command writes it, entries ended by a NUL."""
RELAY_EXIT: Final = "relay.exit"
"""Exit code of the relay in a container, as the script there writes it."""
ALARM: Final = "scenario: "
"""Prefix of the errors of our own shell scripts."""

_CONTAINER_POLL: Final = 0.5
_LONGEST_LINE: Final = 4096
_MOST_ALARMS: Final = 100
"""Alarms reported of a stack; this few never fill the wire to the holder."""


@dataclass(frozen=True)
class StackPlan:
    """Commands of a stack, and its time limits.

    ``setup`` is a command that writes the environment of the stack to :data:`ENVIRONMENT`, or
    empty. ``stack`` and ``relay`` are commands whose programs are searched in that environment;
    ``relay_variables`` are for the relay alone. ``domain`` is the stack's. Lines of the stack's
    output that contain one of ``alarms`` are reported. ``engine`` and ``name`` describe a
    container. The stack ends with the process ``holder``. ``grace`` [s] follows each of SIGINT and
    SIGTERM; ``setup_limit`` [s] is for the setup files.
    """

    token: str
    folder: str
    domain: int
    setup: list[str]
    stack: list[str]
    relay: list[str]
    relay_variables: dict[str, str]
    alarms: list[str]
    engine: str
    name: str
    holder: int
    grace: float
    setup_limit: float


class Supervisor(EventLoop):
    """Supervisor of one stack."""

    def __init__(self, wire: socket.socket, plan: StackPlan) -> None:
        super().__init__()
        self._plan = plan
        self._folder = Path(plan.folder)
        self._wire = wire
        self._held = True
        alarms = [alarm.encode() for alarm in plan.alarms]
        self._outputs = {
            STACK_OUTPUT: _WatchedOutput(
                self._folder / STACK_OUTPUT, alarms, lambda line: self._say({"alarm": line})
            ),
            RELAY_OUTPUT: OutputFile(self._folder / RELAY_OUTPUT),
        }
        self._children: dict[int, str] = {}
        self._groups: list[int] = []
        self._setup_until: float | None = None
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
            signal.signal(number, self.end)
        self.watch(wire.fileno(), self._hear_holder)
        # Watch the process too: others may have inherited its end of the wire.
        try:
            holder = os.pidfd_open(plan.holder)
        except ProcessLookupError:
            self._hang_up()
        else:
            self.watch(holder, lambda: self._holder_ended(holder))

    def run(self) -> None:
        """Run until the stack is to end, then end all of it and remove its folder."""
        try:
            if self._plan.setup:
                self._setup_until = time.monotonic() + self._plan.setup_limit
                # Processes that setup files start belong to the stack too.
                environment = {**os.environ, MARKER: self._plan.token}
                self._start("setup", self._plan.setup, environment, STACK_OUTPUT)
            else:
                self._start_stack(dict(os.environ))
            while not self.ending:
                self.turn(self._next_deadline())
                self._look_at_deadlines()
        finally:
            self._end_everything()
            self._say({"gone": True})
            # The outputs are read before the folder goes: its holder hangs up when it has them.
            while self._held:
                self.turn(1.0)
            shutil.rmtree(self._folder, ignore_errors=True)

    # Starting

    def _start_stack(self, environment: dict[str, str]) -> None:
        plan = self._plan
        if self._start("stack", plan.stack, environment, STACK_OUTPUT) and (
            not plan.relay
            or self._start("relay", plan.relay, environment | plan.relay_variables, RELAY_OUTPUT)
        ):
            self._say({"started": True})

    def _start(self, role: str, words: list[str], environment: dict[str, str], output: str) -> bool:
        program = shutil.which(words[0], path=environment.get("PATH", os.defpath))
        if program is None:
            self._refuse(f"the {role} cannot be started: its PATH has no program {words[0]}")
            return False
        supervisor = os.getpid()
        reading, writing = os.pipe()
        try:
            # Without a context manager: the loop reaps it, as it does orphans.
            child = subprocess.Popen(
                [program, *words[1:]],
                env=environment,
                cwd=self._folder,
                stdin=subprocess.DEVNULL,
                stdout=writing,
                stderr=writing,
                start_new_session=True,
                preexec_fn=lambda: prepare_child(supervisor),  # this process has one thread
            )
        except (OSError, subprocess.SubprocessError) as error:
            os.close(reading)
            self._refuse(f"the {role} cannot be started: {error}")
            return False
        finally:
            os.close(writing)
        self._children[child.pid] = role
        self._groups.append(child.pid)
        child.returncode = 0  # avoids a ResourceWarning: the loop reaps it
        self.take_output(reading, self._outputs[output])
        return True

    def _refuse(self, why: str) -> None:
        self._say({"failed": why})
        self.ending = True

    def _setup_ended(self, code: int) -> None:
        self._setup_until = None
        try:
            if code:
                raise OSError(f"the setup files failed with {_in_words(code)}")
            file = self._folder / ENVIRONMENT
            data = file.read_bytes()
            file.unlink()  # variables may hold secrets
        except OSError as error:
            text = OutputFile.read(self._folder / STACK_OUTPUT).decode("utf-8", "replace")
            errors = [line for line in text.splitlines() if line.startswith(ALARM)]
            self._refuse(errors[-1].removeprefix(ALARM) if errors else str(error))
            return
        entries = (os.fsdecode(entry).partition("=") for entry in data.split(b"\0") if entry)
        self._start_stack({name: value for name, _, value in entries if name})

    # Events

    def child_ended(self, process: int, code: int) -> None:
        """React to the end of the setup, the stack, its relay or an orphan."""
        role = self._children.pop(process, "")
        if role == "setup" and not self.ending:
            self.drain()
            self._setup_ended(code)
        elif role:
            self._report_end(role, code)

    def _report_end(self, role: str, code: int) -> None:
        self.drain()
        self._say({"ended": role, "code": code})

    def _next_deadline(self) -> float | None:
        until = self._setup_until
        wait = None if until is None else max(0.0, until - time.monotonic())
        if self._plan.engine:
            # No event arrives from inside a container.
            wait = min(_CONTAINER_POLL, wait) if wait is not None else _CONTAINER_POLL
        return wait

    def _look_at_deadlines(self) -> None:
        if self._setup_until is not None and time.monotonic() > self._setup_until:
            self._refuse(f"the setup files did not end within {self._plan.setup_limit:g} s")
        exit_code = self._folder / RELAY_EXIT
        if self._plan.engine and not self.ending and exit_code.exists():
            text = exit_code.read_text().strip()
            exit_code.unlink()
            self._report_end("relay", int(text) if text.isdecimal() else 1)

    # The holder

    def _hear_holder(self) -> None:
        try:
            data = self._wire.recv(4096)
        except OSError:
            data = b""
        self.ending = True  # the only request there is
        if not data:
            self._hang_up()

    def _holder_ended(self, descriptor: int) -> None:
        self.forget(descriptor)
        self._hang_up()

    def _hang_up(self) -> None:
        self.ending = True
        if self._held:
            self._held = False
            self.forget(self._wire.fileno())

    def _say(self, event: dict[str, object]) -> None:
        if self._held:
            try:
                self._wire.sendall(json.dumps(event).encode() + b"\n")
            except OSError:
                self._hang_up()

    # Ending

    def _end_everything(self) -> None:
        """Send SIGINT, SIGTERM, SIGKILL, each only if processes survived the one before."""
        self.ending = True
        for group in set(self._group_members().values()):
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(group, signal.SIGINT)
        # As from a terminal: processes that have left the group get no SIGINT.
        self._wait_until(lambda: not self._group_members(), self._plan.grace)
        if remains := self._remains():
            send_signal(remains, signal.SIGTERM)
            self._wait_until(lambda: not self._remains(), self._plan.grace)
        if self._plan.engine:
            end_container(self._plan.engine, self._plan.name)
        self._wait_until(self._kill_remains, KILL_LIMIT)
        if not self._plan.engine:  # a container has its own shared memory
            remove_shared_memory(self._plan.domain)

    def _kill_remains(self) -> bool:
        send_signal(remains := self._remains(), signal.SIGKILL)
        return not remains

    def _wait_until(self, condition: Callable[[], bool], seconds: float) -> None:
        deadline = time.monotonic() + seconds
        self.reap()
        while not condition() and time.monotonic() < deadline:
            # Limit the looks at all processes while one of them keeps printing.
            next_look = time.monotonic() + POLL / 5
            self.turn(POLL)
            while (rest := next_look - time.monotonic()) > 0:
                self.turn(rest)

    def _remains(self) -> set[int]:
        """Return all living processes of the stack."""
        # An engine's own processes outlast a container and must not be ended.
        ours = self._group_members() if self._plan.engine else descendants(os.getpid())
        return {*ours, *marked_processes(self._plan.token)} - {os.getpid()}

    def _group_members(self) -> dict[int, int]:
        """Return the group of each descendant in a group of ours, without reused numbers."""
        return {p: group for p, group in descendants(os.getpid()).items() if group in self._groups}


class _WatchedOutput(OutputFile):
    """An output that reports each line with one of ``alarms`` at once."""

    def __init__(self, path: Path, alarms: list[bytes], report: Callable[[str], object]) -> None:
        super().__init__(path)
        self._alarms, self._report = alarms, report
        self._reports_left = _MOST_ALARMS
        self._line = b""

    def write(self, data: bytes) -> None:
        """Add output and report its alarms."""
        super().write(data)
        *lines, rest = (self._line + data).split(b"\n")
        self._line = rest[:_LONGEST_LINE]
        for line in lines:
            if self._reports_left and any(alarm in line for alarm in self._alarms):
                self._reports_left -= 1
                self._report(line[:_LONGEST_LINE].decode("utf-8", "replace"))


def _in_words(code: int) -> str:
    return f"exit code {code}" if code >= 0 else f"signal {-code}"


def main() -> None:
    """Supervise a stack until it is gone."""
    become_supervisor()
    wire = socket.socket(fileno=os.dup(0))
    received = b""
    while not received.endswith(b"\n"):
        data = wire.recv(1 << 16)
        if not data:
            return  # its holder died at once
        received += data
    Supervisor(wire, StackPlan(**json.loads(received))).run()
