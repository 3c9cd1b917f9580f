"""Remaining processes of a stack or a run, by descent or by a variable in their environment."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

from .plan import PROGRAM

MARKER: Final = "SCENARIO_STACK"
"""Environment variable of everything that belongs to a stack; its value is the stack's token."""
KILL_LIMIT: Final = 10.0
"""Seconds until what survives SIGKILL (in an uninterruptible wait) is left alone."""
POLL: Final = 0.05
"""Seconds between looks for what is left: the end of a grandchild tells nobody."""
_FIRST_LOOK: Final = 0.001
_ENGINE_LIMIT: Final = 20.0


def marked_processes(token: str) -> set[int]:
    """Return the processes of a stack by the variable in their environment, zombies left out."""
    # A process of another user cannot be looked into, nor could it be ended.
    mark = f"{MARKER}={token}".encode()
    found = set()
    for process in Path("/proc").iterdir():
        if process.name.isdecimal():
            with suppress(OSError):
                if mark in (process / "environ").read_bytes().split(b"\0"):
                    found.add(int(process.name))
    return found


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
    """Send a signal to each process that is still there and ours."""
    for process in processes:
        with suppress(ProcessLookupError, PermissionError):
            os.kill(process, number)


def end_marked(token: str) -> None:
    """Kill a stack whose supervisor is gone, as far as that works within :data:`KILL_LIMIT`."""
    deadline = time.monotonic() + KILL_LIMIT
    while (left := marked_processes(token)) and time.monotonic() < deadline:
        send_signal(left, signal.SIGKILL)
        time.sleep(POLL)


def end_container(engine: str, name: str) -> None:
    """End a container by its name, and remove it; nothing happens where there is none."""
    for words in (["kill", name], ["rm", "-f", name]):
        # Its exit code says whether there was one, which nobody has to know.
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
    found = {}
    for process in Path("/proc").iterdir():
        if process.name.isdecimal():
            with suppress(OSError):
                # The name of the program comes second, in brackets, and may contain anything.
                state, parent, group = (process / "stat").read_text().rpartition(")")[2].split()[:3]
                if state not in ("Z", "X"):
                    found[int(process.name)] = int(parent), int(group)
    return found


def descendants(ancestor: int) -> dict[int, int]:
    """Return the process group of every descendant that is not a zombie, by process."""
    processes = _processes()
    found: dict[int, int] = {}
    newest = {ancestor}
    while newest:
        newest = {p for p, (parent, _) in processes.items() if parent in newest} - found.keys()
        found |= {process: processes[process][1] for process in newest}
    return found


def parent_of(process: int) -> int:
    """Return the parent of a process, 0 where that is not known: it has ended, say."""
    with suppress(OSError):
        stat = Path(f"/proc/{process}/stat").read_text()
        return int(stat.rpartition(")")[2].split()[1])
    return 0


def children(process: int) -> set[int]:
    """Return the children of a process, zombies among them."""
    found: set[int] = set()
    try:
        for thread in Path(f"/proc/{process}/task").iterdir():
            found |= {int(child) for child in (thread / "children").read_text().split()}
    except OSError:
        # It has ended, or the kernel has no such file (CONFIG_PROC_CHILDREN); proc(5).
        with suppress(OSError):
            everybody = (int(one.name) for one in Path("/proc").iterdir() if one.name.isdecimal())
            return {one for one in everybody if parent_of(one) == process}
    return found


def is_supervisor(process: int) -> bool:
    """Return whether a process is the supervisor of a stack, which ends all of it in time."""
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
    """Kill all that descends from a subreaper, except ``spared`` children and supervisors.

    Whose parent is killed becomes the subreaper's child, and is next. ``reap`` is called before
    each look. What cannot be killed within :data:`KILL_LIMIT` stays.
    """
    deadline, pause = time.monotonic() + KILL_LIMIT, _FIRST_LOOK
    while True:
        reap()
        # With zombies: one that was alive when the list was read may have left children since.
        # Spared ones are asked for after that: what has been started since is not in it.
        found = children(process)
        left = {child for child in found - {*spared()} if not is_supervisor(child)}
        if not left or time.monotonic() > deadline:
            return
        send_signal(left, signal.SIGKILL)
        time.sleep(pause)
        pause = min(2 * pause, POLL)
