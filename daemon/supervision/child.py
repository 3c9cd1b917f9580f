"""Preparation of a supervisor and of the processes below it."""

from __future__ import annotations

import ctypes
import os
import resource
import select
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final

# prctl.h of Linux
_PR_SET_PDEATHSIG: Final = 1
_PR_SET_CHILD_SUBREAPER: Final = 36
_LIBC: Final = ctypes.CDLL(None, use_errno=True)
_AUTOGROUP: Final = Path("/proc/self/autogroup")
# malloc.h of glibc
_M_MMAP_THRESHOLD: Final = -3


def become_supervisor() -> None:
    """Adopt orphaned descendants, and undo settings that only the process of a run needs."""
    reset_signals()
    # Writing to a dead holder, or beyond a limit, is an error and does not end the process.
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    # The address space of a run is limited; C++ and DDS reserve far more than they touch.
    _, hard_limit = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (hard_limit, hard_limit))
    adopt_orphans()


def adopt_orphans() -> None:
    """Become the parent of orphaned descendants."""
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)


def die_with_parent(parent: int) -> None:
    """Let the kernel kill this process when the thread that forked it ends; end if it has ended."""
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)  # killed in between


def prepare_child(supervisor: int) -> None:
    """Give a new process the signals and priority of one in a terminal; between fork and exec."""
    # Only people, and the kernel short of memory, kill a supervisor.
    die_with_parent(supervisor)
    # A session has an autogroup of its own (sched(7)), which does not inherit a run's niceness.
    with suppress(OSError):
        _AUTOGROUP.write_text(str(os.getpriority(os.PRIO_PROCESS, 0)))
    reset_signals()


def lower_session(niceness: int) -> None:
    """Lower the priority of this process's session, if it leads one.

    With autogroups (sched(7)) sessions share processors evenly; the niceness of a process counts
    only inside its session.
    """
    if os.getsid(0) == os.getpid():
        with suppress(OSError):  # a kernel without autogroups
            _AUTOGROUP.write_text(str(niceness))


def return_freed_memory(large: int) -> None:
    """Return the memory of freed arrays of ``large`` bytes and more to the system."""
    # By default the threshold rises when a grid of megabytes is freed; later grids then come from
    # the heap, which returns nothing to the system (mallopt(3), M_MMAP_THRESHOLD).
    with suppress(AttributeError):  # of glibc alone
        _LIBC.mallopt(_M_MMAP_THRESHOLD, large)


def reset_signals() -> None:
    """Restore the default action of every signal and unblock all."""
    # The process of a run ignores SIGINT, and ignored signals stay ignored across fork and exec.
    for number in signal.valid_signals() - {signal.SIGKILL, signal.SIGSTOP}:
        with suppress(OSError, ValueError):  # reserved by the C library
            signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())


def _prctl(option: int, value: int) -> None:
    if _LIBC.prctl(option, value, 0, 0, 0):
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code))


def when_stdin_ends(react: Callable[[], object]) -> None:
    """Call ``react`` in a thread when the other end of standard input is closed.

    This tells a process that its starter is gone, or has released it.
    """

    def watch() -> None:
        descriptor = sys.stdin.fileno()
        # A terminal that hung up, or a socket whose peer was killed, ends by an error.
        with suppress(OSError):
            while True:
                try:
                    if not os.read(descriptor, 4096):
                        break
                except BlockingIOError:  # non-blocking input: nothing has ended
                    select.select([descriptor], [], [])
        react()

    threading.Thread(target=watch, name="tether", daemon=True).start()
