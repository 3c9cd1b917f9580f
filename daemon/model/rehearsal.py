"""The short run that compiles what runs of a system call, before the first of them.

Runs of the same system and robot call the same kernels, whatever the numbers in their parameters
are. What they call is listed under one name (:func:`kernel_list`); where that list or some machine
code is missing, the short run makes both.
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
"""Kinds of systems that have kernels of their own: of all others the short run has none."""
SHORT: Final = 20.0
"""Simulated seconds: until then each of these systems has planned and driven around something."""
_IDLE: Final = SutReference("idle", "idle", {})


def short_run(spec: RunSpec) -> RunSpec:
    """Return the beginning of a run.

    A system that plugs in, or lives outside of this process, is left out.
    """
    sut = spec.sut if spec.sut.kind in WITH_KERNELS else _IDLE
    return replace(spec, sut=sut, limit=min(SHORT, spec.limit))


def kernel_list(spec: RunSpec) -> str:
    """Return the name of what lists the kernels that runs like ``spec`` call."""
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
