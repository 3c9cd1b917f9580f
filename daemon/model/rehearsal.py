"""Short run that compiles the kernels of a system before its first run.

Runs of the same system and robot call the same kernels, whatever the numbers in their parameters.
These are listed under one name (:func:`kernel_list`). The short run makes a missing list and
missing machine code.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from daemon.model.spec import RunSpec, SutReference
from grammars.model.robot import Robot
from grammars.text import codec

WITH_KERNELS: Final = ("pilot", "ros")
"""Kinds of systems with kernels of their own; the short run omits all others."""
SHORT: Final = 20.0
"""Length of the short run [s, simulated]: each system plans and avoids an obstacle in it."""
_IDLE: Final = SutReference("idle", "idle", {})


def short_run(spec: RunSpec) -> RunSpec:
    """Return the beginning of a run, without a system that is a plug-in or an outside process."""
    sut = spec.sut if spec.sut.kind in WITH_KERNELS else _IDLE
    return replace(spec, sut=sut, limit=min(SHORT, spec.limit))


def kernel_list(spec: RunSpec) -> str:
    """Return the name of the list of kernels that runs like ``spec`` call."""
    sut = short_run(spec).sut
    robot = codec.to_plain(spec.robot, Robot)
    choices = repr((_choices(sut.parameters), _choices(robot)))
    return f"{sut.kind}-{hashlib.sha256(choices.encode()).hexdigest()[:12]}"


def _choices(value: Any) -> Any:
    """Return a tree of parameters without its numbers, which choose no kernel."""
    if isinstance(value, Mapping):
        return sorted((name, _choices(each)) for name, each in value.items())
    if isinstance(value, list | tuple):
        return [_choices(each) for each in value]
    return value if isinstance(value, bool | str) else None
