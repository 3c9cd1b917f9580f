"""Imported by the fork server alone: loads and warms what every run needs, once for all.

Children are forked from there and start with everything in memory, so that no run pays for
importing the simulator and loading its compiled kernels. The fork server swallows import errors,
so a failure is kept here and every child reports it.

Kernels are loaded when the worker lists their rooms, since nobody knows before which systems runs
will have; and once a run has ended well, what it began with is done here for those like it. The
only moment at which a fork server does something for others is a fork.
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

from daemon.batch.freed_memory import return_freed_memory
from daemon.model.execution import (
    DEFAULT_EXECUTOR,
    EXECUTOR_VARIABLE,
    PREPARATION_VARIABLE,
    forget_safe_path,
)
from daemon.model.live_judgement import LiveJudgement
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
_prepared = {""}
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
        os.register_at_fork(before=_prepare_listed, after_in_child=_forget_list)
    elif warm_up is not None:
        warm_up()
    found: Callable[..., Any] = getattr(module, function)
    return found


def _prepare() -> None:
    global execute, problem
    forget_safe_path()
    return_freed_memory()
    # What a guardian that was killed leaves behind comes to this process, where a worker finds it.
    adopt_orphans()
    warnings.filterwarnings("ignore", "forkserver: waitpid returned unexpected")
    # Decoders are built once here, not once in every child; that of a specification, which its
    # digest asks for, takes 15 ms.
    codec.warm_up(Lease, RunSpec, Scene, RunResult, LiveSnapshot, LiveJudgement)
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


def _prepare_listed() -> None:
    """Do what has been listed since the last fork."""
    global _listed
    try:
        listed = Path(os.environ[PREPARATION_VARIABLE]).read_text()
    except (KeyError, OSError):
        return
    if listed == _listed:
        return
    _listed = listed
    rooms, _, example = listed.partition("\n")
    _load_kernels(rooms.split()[1:])
    if example not in _prepared:
        _prepared.add(example)
        _prepare_runs(*example.split("\n", 1))
    _keep_for_good()


def _load_kernels(rooms: list[str]) -> None:
    """Load the kernels of rooms, as far as they are on the disk."""
    from daemon.model.kernels import loading_only

    missing.clear()
    for room in rooms:
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


def _prepare_runs(file: str, specification: str) -> None:
    """Do what a run in the scene of a file begins with, for the children."""
    from daemon.model.kernels import loading_only
    from daemon.run import prepare

    try:
        spec = codec.from_json(RunSpec, specification.encode())
        with loading_only():
            prepare(spec, codec.from_json(Scene, Path(file).read_bytes()))
    except Exception:
        # The scene has been removed, or the disk is full: runs begin with it themselves, as before.
        traceback.print_exc()


def _forget_list() -> None:
    """A child loads nothing when it forks."""
    os.environ.pop(PREPARATION_VARIABLE, None)


_prepare()
