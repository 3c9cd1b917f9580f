"""Imported by the fork server alone: loads and warms what every run needs, once for all.

Children are forked from there and start with everything in memory, so that no run pays for
importing the simulator and loading its compiled kernels. The fork server swallows import errors,
so a failure is kept here and every child reports it.

Kernels are loaded when the worker lists their rooms, since nobody knows before which systems runs
will have. The only moment at which a fork server does something for others is a fork.
"""

from __future__ import annotations

import gc
import importlib
import os
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from daemon.model.execution import (
    DEFAULT_EXECUTOR,
    EXECUTOR_VARIABLE,
    KERNEL_LIST_VARIABLE,
    forget_safe_path,
)
from daemon.model.messages import Lease
from daemon.model.spec import RunResult, RunSpec
from daemon.model.status import LiveSnapshot
from daemon.supervision.child import adopt_orphans
from grammars.model.scene import Scene
from grammars.text import codec

execute: Callable[..., Any] | None = None
problem: str = ""
missing: list[str] = []
"""Rooms that are listed and have kernels that are not on the disk."""

_loaded: set[str] = set()
_listed = ""


def _load(name: str) -> Callable[..., Any]:
    module_name, _, function = name.partition(":")
    module = importlib.import_module(module_name)
    warm_up = getattr(module, "warm_up", None)
    if name == DEFAULT_EXECUTOR:
        # Both take locks of theirs around a fork: imported by a kernel's room in the middle of one,
        # they would release what they have not taken.
        importlib.import_module("logging")
        importlib.import_module("concurrent.futures.thread")
        module.warm_up(rooms=())
        os.register_at_fork(before=_load_kernels, after_in_child=_forget_list)
    elif warm_up is not None:
        warm_up()
    found: Callable[..., Any] = getattr(module, function)
    return found


def _prepare() -> None:
    global execute, problem
    forget_safe_path()
    # What a guardian that was killed leaves behind comes to this process, where a worker finds it.
    adopt_orphans()
    warnings.filterwarnings("ignore", "forkserver: waitpid returned unexpected")
    # Decoders are built once here, not once in every child; that of a specification, which its
    # digest asks for, takes 15 ms.
    codec.warm_up(Lease, RunSpec, Scene, RunResult, LiveSnapshot)
    try:
        execute = _load(os.environ[EXECUTOR_VARIABLE])
    except Exception:
        # Also of an executor that plugs in; the first child reports it in place of a run.
        problem = traceback.format_exc()
    _keep_for_good()


def _keep_for_good() -> None:
    # A collection writes to every object it visits, and so copies the pages that children share
    # with the server. Garbage goes now; what is left is never looked at again by any collector.
    gc.collect()
    gc.freeze()


def _load_kernels() -> None:
    """Load what has been listed since the last fork, as far as it is on the disk."""
    global _listed
    try:
        listed = Path(os.environ[KERNEL_LIST_VARIABLE]).read_text()
    except (KeyError, OSError):
        return
    if listed == _listed:
        return
    from daemon.model.kernels import loading_only

    _listed = listed
    missing.clear()
    for room in listed.split()[1:]:
        if room in _loaded:
            continue
        try:
            with loading_only():
                importlib.import_module(room).warm_up()
        except Exception:
            # Not on the disk; or something is wrong, and the child that compiles it says what.
            missing.append(room)
        else:
            _loaded.add(room)
    _keep_for_good()


def _forget_list() -> None:
    """A child loads nothing when it forks."""
    os.environ.pop(KERNEL_LIST_VARIABLE, None)


_prepare()
