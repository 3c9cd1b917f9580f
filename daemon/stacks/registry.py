"""Systems under test by name: the ones that ship here and those that plug in.

A package of one's own adds a stack by an entry point in the group ``scenario.suts``: its name is
the ``kind`` written in SUT files, its object a function from parameters to a
:class:`daemon.model.sut.SystemUnderTest`, with ``ValueError`` for parameters it does not take.
Files written below ``files`` in a SUT file reach it as the parameter ``files``: paths, by name.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from contextlib import redirect_stdout
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Final, TypeAlias

from daemon.model.attachments import SutMissing
from daemon.model.deadline import OutOfTime, interruptible, wall_clock_limit
from daemon.model.sut import TICK_RATE, SystemUnderTest
from daemon.stacks.findings import ParameterError, ParameterFindings
from daemon.stacks.pilot import make_idle, make_pilot
from daemon.stacks.ros1 import make_ros
from daemon.stacks.ros2.factory import make_ros2
from grammars.text import codec
from grammars.text.diagnostics import did_you_mean
from grammars.text.plugins import explain_plugin_error, plugin_origin

Factory: TypeAlias = Callable[[Mapping[str, Any]], SystemUnderTest]
ENTRY_POINT_GROUP: Final = "scenario.suts"
CHECK_LIMIT: Final = 10.0
"""Seconds of wall clock in which a check makes a system that plugs in."""
_ROUNDING: Final = 1e-6
"""How far a period may be off a whole number of ticks: 0.07 s is 7.000000000000001 of them."""

_BUILT_IN: Final[dict[str, Factory]] = {
    "idle": make_idle,
    "pilot": make_pilot,
    "ros": make_ros,
    "ros2": make_ros2,
}


def sut_kinds() -> tuple[str, ...]:
    """Names of every kind of system under test that is installed."""
    plugged = {entry.name for entry in entry_points(group=ENTRY_POINT_GROUP)}
    return tuple(sorted(plugged | set(_BUILT_IN)))


def is_built_in(kind: str) -> bool:
    """Whether a kind ships here, rather than plugs in."""
    return kind in _BUILT_IN


def make_sut(kind: str, parameters: Mapping[str, Any]) -> SystemUnderTest:
    """Make a fresh system under test.

    Raises ``ValueError`` for parameters it does not take, and for a plugged one that cannot be
    made or is no system under test; :class:`daemon.model.attachments.SutMissing`, a
    ``ValueError`` too, for a kind that is unknown on this machine or cannot be loaded.
    """
    factory = _BUILT_IN.get(kind)
    if factory is not None:
        return factory(parameters)
    made = _make_plugged(kind, parameters)
    problem = _unlike_protocol(made)
    if problem:
        raise ValueError(
            f'what the system under test "{kind}" makes {problem}, see scenario_tui/sut.py'
        )
    return made


def check_parameters(kind: str, parameters: Mapping[str, Any]) -> ParameterFindings:
    """Return what a kind has to say about parameters it takes.

    Raises ``ValueError`` for what it does not take; its subclass
    :class:`daemon.stacks.findings.ParameterError`, which plug-ins may raise as well,
    says where in the tree each problem stands. A system that plugs in is made once, in this
    process and within :data:`CHECK_LIMIT` seconds.
    """
    if kind == "ros":
        # Loads a compiler, which nobody needs who tests another stack.
        from daemon.stacks.ros1.configuration import read_ros

        return read_ros(parameters).findings
    if kind == "ros2":
        from daemon.stacks.ros2.advice import check_settings

        return check_settings(parameters)
    if is_built_in(kind):
        make_sut(kind, parameters)
    else:
        _check_plugged(kind, parameters)
    return ParameterFindings()


def _check_plugged(kind: str, parameters: Mapping[str, Any]) -> None:
    """Make a system that plugs in, for what it refuses; raises as :func:`check_parameters` does.

    What it prints goes to standard error, where it spoils no answer of a command.
    """
    name = _name(_find_entry(kind))
    try:
        with (
            redirect_stdout(sys.stderr),
            wall_clock_limit(CHECK_LIMIT),
            interruptible("its factory"),
        ):
            make_sut(kind, parameters)
    except OutOfTime as error:
        hint = "what takes longer belongs into start()"
        raise ValueError(f"{name} was not made: {error}; {hint}") from error
    except (ParameterError, SutMissing):
        raise
    except ValueError as error:
        raise ValueError(codec.reading_error(error) or "ValueError without a word") from error


def _make_plugged(kind: str, parameters: Mapping[str, Any]) -> SystemUnderTest:
    """Call the factory of a plug-in: code of other people, of which anything may come."""
    entry = _find_entry(kind)
    # What cannot be loaded is missing here and may be there on another worker; what cannot be made
    # of these parameters is wrong everywhere.
    try:
        factory: Factory = entry.load()
    except (Exception, SystemExit) as error:
        raise SutMissing(_cannot("loaded", entry, error)) from error
    try:
        return factory(parameters)
    except ValueError:
        raise
    except (Exception, SystemExit) as error:
        raise ValueError(_cannot("made", entry, error)) from error


def _find_entry(kind: str) -> EntryPoint:
    """Return the entry point of a kind; raises :class:`SutMissing` when there is none."""
    entry = next(iter(entry_points(group=ENTRY_POINT_GROUP, name=kind)), None)
    if entry is None:
        hint = did_you_mean(kind, sut_kinds())
        raise SutMissing(f'no system under test of kind "{kind}": {hint}')
    return entry


def _name(entry: EntryPoint) -> str:
    return f'the system under test "{entry.name}" ({plugin_origin(entry)})'


def _cannot(what: str, entry: EntryPoint, error: BaseException) -> str:
    return explain_plugin_error(f"{_name(entry)} cannot be {what}", error, __file__)


def _unlike_protocol(made: object) -> str:
    """Say what keeps an object from being a system under test, empty when nothing does."""
    for name in ("start", "update"):
        if not callable(getattr(made, name, None)):
            return f"has no method {name}()"
    if not isinstance(getattr(made, "needs_ground_truth", None), bool):
        return "does not say needs_ground_truth: True or False"
    period = getattr(made, "period", None)
    if isinstance(period, bool) or not isinstance(period, int | float):
        return "has no period in seconds"
    ticks = TICK_RATE * period
    if not math.isfinite(ticks) or ticks < 1.0 - _ROUNDING or abs(ticks - round(ticks)) > _ROUNDING:
        return f"has a period of {period!r} s, not a multiple of {1.0 / TICK_RATE:g} s"
    return ""
