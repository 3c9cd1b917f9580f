"""Remains of a stack or a run: processes, by descent or by an environment variable, and memory."""

from __future__ import annotations

import fcntl
import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

PROGRAM: Final = (
    "import sys; sys.path.append(sys.argv[1]);from supervision.supervisor import main; main()"
)
"""Program of a supervisor, without our packages; it also identifies supervisors in /proc."""
MARKER: Final = "SCENARIO_STACK"
"""Environment variable of all processes of a stack; its value is the stack's token."""
KILL_LIMIT: Final = 10.0
"""Longest wait for processes that survive SIGKILL in an uninterruptible wait [s]."""
POLL: Final = 0.05
"""Period of looks for remaining processes [s]: the end of a grandchild sends no signal."""
_FIRST_LOOK: Final = 0.001
_ENGINE_LIMIT: Final = 20.0
_MEMORY: Final = Path("/dev/shm")
_MEMORY_FILE: Final = re.compile(
    r"(?P<name>fast(?:dds|rtps)_(?:port(?P<port>\d+)|[0-9a-f]{16}))(?:_[es]l)?"
)
_FIRST_PORT: Final = 7400
_PORTS: Final = 250
"""Ports of domain d begin at 7400 + 250 d (DDSI-RTPS 2.5, 9.6.2)."""
_AGE: Final = 2.0
"""Age after which an unlocked file counts as abandoned [s]: its user creates it before locking."""


def marked_processes(token: str) -> set[int]:
    """Return the processes of a stack by their environment variable, without zombies."""
    # Processes of other users can neither be read nor ended.
    mark = f"{MARKER}={token}".encode()
    marked = set()
    for process in Path("/proc").iterdir():
        if process.name.isdecimal():
            with suppress(OSError):
                if mark in (process / "environ").read_bytes().split(b"\0"):
                    marked.add(int(process.name))
    return marked


def reap_children() -> Iterator[tuple[int, int]]:
    """Yield every child that has ended and its exit code, below 0 for a signal."""
    while True:
        try:
            process, status = os.waitpid(-1, os.WNOHANG)
        except ChildProcessError:
            return
        if not process:
            return
        yield process, os.waitstatus_to_exitcode(status)


def send_signal(processes: Iterable[int], number: int) -> None:
    """Send a signal to each of our processes that still exists."""
    for process in processes:
        with suppress(ProcessLookupError, PermissionError):
            os.kill(process, number)


def end_marked(token: str) -> None:
    """Kill a stack whose supervisor is gone, for :data:`KILL_LIMIT` at most."""
    deadline = time.monotonic() + KILL_LIMIT
    while (remaining := marked_processes(token)) and time.monotonic() < deadline:
        send_signal(remaining, signal.SIGKILL)
        time.sleep(POLL)


def end_container(engine: str, name: str) -> None:
    """End and remove a container by its name, if it exists."""
    for words in (["kill", name], ["rm", "-f", name]):
        # The exit code only says whether it existed.
        with suppress(OSError, subprocess.TimeoutExpired):
            subprocess.run(
                [engine, *words],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                timeout=_ENGINE_LIMIT,
                check=False,
            )


def _processes() -> dict[int, tuple[int, int]]:
    """Return parent and process group of every process that is not a zombie."""
    processes = {}
    for process in Path("/proc").iterdir():
        if process.name.isdecimal():
            with suppress(OSError):
                # The name of the program comes second, in brackets, and may contain anything.
                state, parent, group = (process / "stat").read_text().rpartition(")")[2].split()[:3]
                if state not in ("Z", "X"):
                    processes[int(process.name)] = int(parent), int(group)
    return processes


def descendants(ancestor: int) -> dict[int, int]:
    """Return the process group of every descendant that is not a zombie, by process."""
    processes = _processes()
    groups: dict[int, int] = {}
    newest = {ancestor}
    while newest:
        newest = {p for p, (parent, _) in processes.items() if parent in newest} - groups.keys()
        groups |= {process: processes[process][1] for process in newest}
    return groups


def parent_of(process: int) -> int:
    """Return the parent of a process, 0 if unknown, such as after its end."""
    with suppress(OSError):
        stat = Path(f"/proc/{process}/stat").read_text()
        return int(stat.rpartition(")")[2].split()[1])
    return 0


def children(process: int) -> set[int]:
    """Return the children of a process, including zombies."""
    result: set[int] = set()
    try:
        for thread in Path(f"/proc/{process}/task").iterdir():
            result |= {int(child) for child in (thread / "children").read_text().split()}
    except OSError:
        # The process has ended, or the kernel has no such file (CONFIG_PROC_CHILDREN); proc(5).
        with suppress(OSError):
            everybody = (int(one.name) for one in Path("/proc").iterdir() if one.name.isdecimal())
            return {one for one in everybody if parent_of(one) == process}
    return result


def is_supervisor(process: int) -> bool:
    """Return whether a process is the supervisor of a stack, which ends the stack itself."""
    with suppress(OSError):
        words = Path(f"/proc/{process}/cmdline").read_bytes().split(b"\0")
        return PROGRAM.encode() in words
    return False


def end_children(
    process: int,
    spared: Callable[[], Iterable[int]] = tuple,
    *,
    reap: Callable[[], object],
) -> None:
    """Kill all descendants of a subreaper, except ``spared`` children and supervisors.

    Orphans become the subreaper's children, and are next. ``reap`` is called before each look.
    Processes that survive :data:`KILL_LIMIT` stay.
    """
    deadline, pause = time.monotonic() + KILL_LIMIT, _FIRST_LOOK
    while True:
        reap()
        # With zombies: a child alive when the list was read may have left children since.
        # ``spared`` is called after that, so it covers every child in the list.
        listed = children(process)
        remaining = {child for child in listed - {*spared()} if not is_supervisor(child)}
        if not remaining or time.monotonic() > deadline:
            return
        send_signal(remaining, signal.SIGKILL)
        time.sleep(pause)
        pause = min(2 * pause, POLL)


def remove_shared_memory(domain: int) -> None:
    """Remove memory that killed processes of Fast DDS have left, half a MiB a segment.

    A participant has a segment ``fastdds_<id>``, or ``fastrtps_<id>`` in older releases, and ports
    ``fastdds_port<number>`` with a semaphore each. One in use has a file ``..._el`` or ``..._sl``
    that its user has locked with flock(2). Observed with the releases of Jazzy and Kilted. Unused
    segments go, and the ports of a ``domain`` without participants.
    """
    ports = range(_FIRST_PORT + _PORTS * domain, _FIRST_PORT + _PORTS * (domain + 1))
    names = set()
    for file in _MEMORY.glob("fast*"):
        match = _MEMORY_FILE.fullmatch(file.name)
        if match and (match["port"] is None or int(match["port"]) in ports):
            names.add(match["name"])
    for name in names:
        # Another process may remove them at the same time; other users' files stay.
        with suppress(OSError):
            if _is_abandoned(name):
                for part in (name, f"sem.{name}_mutex", f"{name}_sl", f"{name}_el"):
                    (_MEMORY / part).unlink(missing_ok=True)


def _is_abandoned(name: str) -> bool:
    files = [_MEMORY / part for part in (name, f"{name}_el", f"{name}_sl")]
    present = [file for file in files if file.exists()]
    states = [file.stat() for file in present]
    limit = time.time() - _AGE
    if any(state.st_uid != os.getuid() or state.st_mtime > limit for state in states):
        return False
    return all(map(_is_unlocked, present))


def _is_unlocked(file: Path) -> bool:
    with file.open("rb") as opened:
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True
