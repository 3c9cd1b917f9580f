"""Preparation of a new process for its life below another one, and of that other one."""

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
    """Adopt what descendants leave behind, and undo what is for the process of a run alone."""
    reset_signals()
    # To write to a holder that has died, or beyond a limit, is an error and not the end.
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    # A run may have but so much address space; C++ and DDS reserve far more than they touch.
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    adopt_orphans()


def adopt_orphans() -> None:
    """Become the parent of what descendants leave behind."""
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)


def die_with_parent(parent: int) -> None:
    """Have this process killed when the thread that forked it ends, now if ``parent`` has ended."""
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)  # killed in between


def prepare_child(supervisor: int) -> None:
    """Give a new process what one has that is started in a terminal; between fork and exec."""
    # Nobody kills a supervisor, except people and the kernel short of memory.
    die_with_parent(supervisor)
    # A session has an autogroup of its own (sched(7)), which does not inherit how far a run steps
    # back behind other processes.
    with suppress(OSError):
        _AUTOGROUP.write_text(str(os.getpriority(os.PRIO_PROCESS, 0)))
    reset_signals()


def lower_session(niceness: int) -> None:
    """Let this process's session step back behind others, if it leads one.

    With autogroups (sched(7)) sessions share processors evenly, whatever the niceness of their
    processes: that counts inside of a session only.
    """
    if os.getsid(0) == os.getpid():
        with suppress(OSError):  # a kernel without them
            _AUTOGROUP.write_text(str(niceness))


def return_freed_memory(large: int) -> None:
    """Have the memory of arrays of ``large`` bytes and more go back to the system when freed."""
    # Whoever frees a grid of megabytes has the next ones taken from the heap, which returns nothing
    # to the system (mallopt(3), M_MMAP_THRESHOLD, a limit that moves unless it is set).
    with suppress(AttributeError):  # of glibc alone
        _LIBC.mallopt(_M_MMAP_THRESHOLD, large)


def reset_signals() -> None:
    """Let every signal do what it does by default, and block none."""
    # The process of a run ignores SIGINT, and what is ignored stays so across fork and exec.
    for number in signal.valid_signals() - {signal.SIGKILL, signal.SIGSTOP}:
        with suppress(OSError, ValueError):  # reserved by the C library
            signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())


def _prctl(option: int, value: int) -> None:
    if _LIBC.prctl(option, value, 0, 0, 0):
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code))


def when_stdin_ends(react: Callable[[], object]) -> None:
    """Call ``react`` in a thread when nobody holds the other end of standard input any more.

    By that a process knows that whoever started it is gone, or has let go of it.
    """

    def watch() -> None:
        descriptor = sys.stdin.fileno()
        # A terminal that hung up, or a socket whose peer was killed, ends by an error.
        with suppress(OSError):
            while True:
                try:
                    if not os.read(descriptor, 4096):
                        break
                except BlockingIOError:  # whoever made it does not wait for it: nothing has ended
                    select.select([descriptor], [], [])
        react()

    threading.Thread(target=watch, name="tether", daemon=True).start()
