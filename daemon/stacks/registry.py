"""Systems under test by name, built in or from plug-ins.

Another package adds a stack by an entry point in the group ``scenario.suts``. Its name is the
``kind`` in SUT files. Its object is a function from parameters to a
:class:`daemon.model.sut.SystemUnderTest` that raises ``ValueError`` for parameters it refuses.
Files below ``files`` in a SUT file reach it as the parameter ``files``: paths by name.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from contextlib import redirect_stdout
from importlib.metadata import EntryPoint
from typing import Any, ClassVar, Final, Literal, TypeAlias

from daemon.model.attachments import SutMissing
from daemon.model.deadline import OutOfTime, interruptible, wall_clock_limit
from daemon.model.sut import TICK_RATE, SystemUnderTest
from daemon.stacks.findings import ParameterError, ParameterFindings
from daemon.stacks.kind import IDLE, StackKind
from daemon.stacks.pilot import PILOT
from daemon.stacks.ros1 import ROS
from daemon.stacks.ros2 import ROS2
from grammars.text import codec
from grammars.text.diagnostics import did_you_mean
from grammars.text.plugins import explain_plugin_error, installed, plugin_origin

Factory: TypeAlias = Callable[[Mapping[str, Any]], SystemUnderTest]
ENTRY_POINT_GROUP: Final = "scenario.suts"
CHECK_LIMIT: Final = 10.0
"""Wall clock in which a check makes a system from a plug-in [s]."""
_ROUNDING: Final = 1e-6
"""Tolerance of a period in ticks: 0.07 s is 7.000000000000001 of them."""
_BUILT_IN: Final[dict[str, StackKind[Any]]] = {kind.name: kind for kind in (IDLE, PILOT, ROS, ROS2)}


def sut_kinds() -> tuple[str, ...]:
    """Return the names of all installed kinds of systems under test."""
    return tuple(sorted({*installed(ENTRY_POINT_GROUP), *_BUILT_IN}))


def stack_kind(name: str) -> StackKind[Any]:
    """Return the kind of this name; raises :class:`SutMissing` if it is not installed."""
    if name in _BUILT_IN:
        return _BUILT_IN[name]
    entry = installed(ENTRY_POINT_GROUP).get(name)
    if entry is None:
        hint = did_you_mean(name, sut_kinds())
        raise SutMissing(f'no system under test of kind "{name}": {hint}')
    return PluggedKind(entry)


def make_sut(kind: str, parameters: Mapping[str, Any]) -> SystemUnderTest:
    """Make a fresh system under test.

    Raises ``ValueError`` for parameters it refuses, and for a plug-in that fails or makes no
    system under test. Raises its subclass :class:`daemon.model.attachments.SutMissing` for a kind
    that this machine lacks or cannot load.
    """
    system_kind = stack_kind(kind)
    return system_kind.make(system_kind.read(parameters))


def check_parameters(kind: str, parameters: Mapping[str, Any]) -> ParameterFindings:
    """Return the warnings of a kind about parameters; raises ``ValueError`` if it refuses them."""
    system_kind = stack_kind(kind)
    return system_kind.findings(system_kind.read(parameters))


class PluggedKind(StackKind[Mapping[str, Any]]):
    """A kind from another package; only its factory knows the parameters."""

    files: ClassVar[Literal["attached"]] = "attached"

    def __init__(self, entry: EntryPoint) -> None:
        self.name = entry.name
        self._entry = entry

    def read(self, parameters: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return the parameters unchanged."""
        return parameters

    def make(self, settings: Mapping[str, Any]) -> SystemUnderTest:
        """Call the factory, which is foreign code and may raise anything."""
        # Another worker may be able to load the package. A factory that fails with these
        # parameters fails everywhere.
        try:
            factory: Factory = self._entry.load()
        except (Exception, SystemExit) as error:
            raise SutMissing(self._cannot("loaded", error)) from error
        try:
            system = factory(settings)
        except ValueError:
            raise
        except (Exception, SystemExit) as error:
            raise ValueError(self._cannot("made", error)) from error
        problem = _unlike_protocol(system)
        if problem:
            raise ValueError(
                f'the object that "{self.name}" makes {problem}, see scenario_tui/sut.py'
            )
        return system

    def findings(self, settings: Mapping[str, Any]) -> ParameterFindings:
        """Make the system once in this process, to see whether it refuses the parameters.

        The limit is :data:`CHECK_LIMIT`. Its output goes to standard error, so that it does not
        mix with the output of a command.
        """
        try:
            with (
                redirect_stdout(sys.stderr),
                wall_clock_limit(CHECK_LIMIT),
                interruptible("its factory"),
            ):
                self.make(settings)
        except OutOfTime as error:
            hint = "longer work belongs into start()"
            raise ValueError(f"{self._title()} was not made: {error}; {hint}") from error
        except (ParameterError, SutMissing):
            raise
        except ValueError as error:
            message = codec.reading_error(error) or "ValueError without a message"
            raise ValueError(message) from error
        return ParameterFindings()

    def _title(self) -> str:
        return f'the system under test "{self.name}" ({plugin_origin(self._entry)})'

    def _cannot(self, verb: str, error: BaseException) -> str:
        return explain_plugin_error(f"{self._title()} cannot be {verb}", error, __file__)


def _unlike_protocol(system: object) -> str:
    """Return the reason why an object is not a system under test, or an empty text."""
    for name in ("start", "update"):
        if not callable(getattr(system, name, None)):
            return f"has no method {name}()"
    if not isinstance(getattr(system, "needs_ground_truth", None), bool):
        return "does not say needs_ground_truth: True or False"
    period = getattr(system, "period", None)
    if isinstance(period, bool) or not isinstance(period, int | float):
        return "has no period in seconds"
    ticks = TICK_RATE * period
    if not math.isfinite(ticks) or ticks < 1.0 - _ROUNDING or abs(ticks - round(ticks)) > _ROUNDING:
        return f"has a period of {period!r} s, not a multiple of {1.0 / TICK_RATE:g} s"
    return ""
