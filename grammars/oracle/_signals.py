"""Signals of oracles: built-in ones and plug-ins.

Names of object signals begin with the object: ``<object>.angle`` for an object with one joint,
``<object>.<joint>.angle`` for any joint.

Packages add signals and oracles by entry points. The name of the entry point is the name in oracle
lines; its object is a :class:`CustomSignal` (group ``scenario.signals``) or a
:class:`CustomOracle` (group ``scenario.oracles``). Plug-ins cannot replace built-in names. Their
foreign code is loaded only when a line uses it, and its errors become messages.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Literal, TypeAlias, TypeVar

from grammars.text.plugins import load_plugin, plugin_names
from grammars.text.quantity import read_quantity
from grammars.text.units import (
    ANGLE,
    ANGULAR_SPEED,
    DIMENSIONS,
    LENGTH,
    RATIO,
    SPEED,
    TIME,
    Dimension,
)

SIGNAL_GROUP: Final = "scenario.signals"
ORACLE_GROUP: Final = "scenario.oracles"


@dataclass(frozen=True, slots=True)
class CustomSignal:
    """A plug-in signal.

    ``sample(trace, time, *arguments)`` takes a :class:`daemon.trace.Trace` (read-only), the time
    base (n,) [s] and the SI values of its arguments, and returns the signal at those times: (n,)
    numbers in ``unit``, NaN if unknown. Values must not depend on later records, otherwise verdicts
    on a running run may contradict the final ones.

    ``unit`` is an SI unit such as ``m/s``, ``1`` for a plain number, or ``bool``; ``arguments`` are
    the units of its arguments.
    """

    sample: Callable[..., Any]
    unit: str
    doc: str = ""
    arguments: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class CustomOracle:
    """A plug-in oracle, for requirements that the language cannot express.

    ``judge(trace, *arguments)`` takes a :class:`daemon.trace.Trace` (read-only) and the SI values
    of its arguments, and returns the interval of the signed margin ``(lower, upper)`` in ``unit``,
    or ``(lower, upper, daemon.model.verdicts.Evidence(...))``. Its result on an incomplete trace
    counts only with ``judges_prefixes``, which promises to treat missing records as unknown.
    """

    judge: Callable[..., Any]
    unit: str
    doc: str = ""
    arguments: tuple[str, ...] = ()
    judges_prefixes: bool = False


_P = TypeVar("_P", CustomSignal, CustomOracle)


def custom_signal_names() -> tuple[str, ...]:
    """Return the names of plug-in signals, without loading them."""
    return plugin_names(SIGNAL_GROUP)


def custom_oracle_names() -> tuple[str, ...]:
    """Return the names of plug-in oracles, without loading them."""
    return plugin_names(ORACLE_GROUP)


def custom_signal(name: str) -> CustomSignal | None:
    """Return the plug-in signal ``name``, if any.

    Raises ``ValueError`` unless it loads as a valid :class:`CustomSignal`.
    """
    return _plugin(SIGNAL_GROUP, "signal", name, CustomSignal)


def custom_oracle(name: str) -> CustomOracle | None:
    """Return the plug-in oracle ``name``, if any.

    Raises ``ValueError`` unless it loads as a valid :class:`CustomOracle`.
    """
    return _plugin(ORACLE_GROUP, "oracle", name, CustomOracle)


def _plugin(group: str, kind: str, name: str, expected: type[_P]) -> _P | None:
    """Return a plug-in of a valid type and declaration; raises ``ValueError``."""
    loaded = load_plugin(group, name, kind)
    if loaded is None:
        return None
    if not isinstance(loaded, expected):
        message = f'the {kind} "{name}" must be a grammars.oracle.{expected.__name__}'
        raise ValueError(f"{message}, not {type(loaded).__name__}")
    function = loaded.sample if isinstance(loaded, CustomSignal) else loaded.judge
    _check_declaration(kind, name, function, loaded.unit, loaded.arguments)
    return loaded


def _check_declaration(
    kind: str, name: str, function: object, unit: object, arguments: object
) -> None:
    if not callable(function):
        raise ValueError(f'the {kind} "{name}" has no function to call')
    if not isinstance(arguments, tuple) or "bool" in arguments:
        raise ValueError(f'the {kind} "{name}" must declare its arguments as a tuple of units')
    for declared in (unit, *arguments):
        try:
            dimension_of(str(declared))
        except ValueError as error:
            raise ValueError(f'the {kind} "{name}" declares {declared!r}: {error}') from error


def dimension_of(unit: str) -> Dimension | None:
    """Return the dimension of an SI unit, ``None`` for ``bool``; ``ValueError`` for others."""
    if unit == "bool":
        return None
    quantity = read_quantity("1" if unit == "1" else f"1 {unit}")
    if quantity.value != 1.0:
        raise ValueError(f'"{unit}" is not an SI unit: use {quantity.unit}')
    return DIMENSIONS[quantity.dimension]


Sort: TypeAlias = Literal["object", "space"]
"""Sorts of things in relations to the robot: obstacles (objects, their links, walls), or parts of
the floor (spaces, doorways)."""


@dataclass(frozen=True, slots=True)
class SignalDeclaration:
    """A declared signal; ``dimension`` is ``None`` for Boolean signals.

    ``arguments`` are the dimensions of its arguments, which are optional as a whole unless
    ``required``. With ``takes_object``, an optional thing in the scene precedes them. With
    ``relates``, the arguments are the robot and a thing of one of these sorts:
    ``distance(robot, door_17)``. With ``takes_node``, the argument is a node of a behaviour tree.
    ``report`` is the word under ``record`` of a SUT file that the signal requires.
    """

    name: str
    dimension: Dimension | None
    doc: str
    arguments: tuple[Dimension, ...] = ()
    takes_object: bool = False
    required: bool = False
    relates: tuple[Sort, ...] = ()
    takes_node: bool = False
    report: str = ""

    @property
    def unit(self) -> str:
        """SI unit, or ``bool``."""
        return "bool" if self.dimension is None else self.dimension.unit


_TREE: Final = "behavior tree"

_DECLARATIONS: Final = (
    SignalDeclaration("loc.error", LENGTH, "distance from estimated to true position"),
    SignalDeclaration("loc.error.x", LENGTH, "estimated minus true x, map frame"),
    SignalDeclaration("loc.error.y", LENGTH, "estimated minus true y, map frame"),
    SignalDeclaration("loc.error.yaw", ANGLE, "estimated minus true heading, wrapped to (-pi, pi]"),
    SignalDeclaration(
        "loc.inside_2sigma",
        None,
        "true position within mean +- 2 sigma of the particle cloud, on x and on y (Eq. 1)",
    ),
    SignalDeclaration("loc.sigma.x", LENGTH, "standard deviation of the position estimate along x"),
    SignalDeclaration("loc.sigma.y", LENGTH, "standard deviation of the position estimate along y"),
    SignalDeclaration("loc.sigma.yaw", ANGLE, "standard deviation of the heading estimate"),
    SignalDeclaration("loc.age", TIME, "time since the latest estimate was taken"),
    SignalDeclaration("estimate.x", LENGTH, "estimated position, map frame"),
    SignalDeclaration("estimate.y", LENGTH, "estimated position, map frame"),
    SignalDeclaration("estimate.yaw", ANGLE, "estimated heading, in (-pi, pi]"),
    SignalDeclaration("estimate.particles", RATIO, "particles in the cloud of the estimate"),
    SignalDeclaration("pose.x", LENGTH, "true position of the robot's base, map frame"),
    SignalDeclaration("pose.y", LENGTH, "true position of the robot's base, map frame"),
    SignalDeclaration("pose.yaw", ANGLE, "true heading of the robot, in (-pi, pi]"),
    SignalDeclaration(
        "clearance",
        LENGTH,
        "min over obstacle points of max(|x| - hx, |y| - hy) in the base frame: negative when an "
        "obstacle is inside the box; without hx, hy, the box around the robot's footprint; with "
        "the name of an object, of that one alone: clearance(door_17, 0.35 m, 0.2 m)",
        (LENGTH, LENGTH),
        takes_object=True,
    ),
    SignalDeclaration(
        "contact",
        None,
        "the robot's body touched something, or the object named, since the previous sample",
        takes_object=True,
    ),
    SignalDeclaration(
        "contact.depth",
        LENGTH,
        "deepest recorded overlap with the robot, 0 without",
        takes_object=True,
    ),
    SignalDeclaration(
        "distance",
        LENGTH,
        "from the robot's footprint to the nearest point of a thing as high as the robot, or of a "
        "space or doorway; 0 when they touch or overlap: distance(robot, door_17)",
        relates=("object", "space"),
    ),
    SignalDeclaration(
        "in",
        None,
        "the middle of the robot's base is in a space or doorway: in(robot, kitchen)",
        relates=("space",),
    ),
    SignalDeclaration("speed", SPEED, "true speed of the robot's base"),
    SignalDeclaration("speed.forward", SPEED, "true speed ahead, negative when driving backwards"),
    SignalDeclaration("speed.sideways", SPEED, "true speed to the left"),
    SignalDeclaration(
        "speed.angular", ANGULAR_SPEED, "true turning speed of the robot, without sign"
    ),
    SignalDeclaration("command.forward", SPEED, "latest command: speed ahead"),
    SignalDeclaration("command.sideways", SPEED, "latest command: speed to the left"),
    SignalDeclaration(
        "command.angular", ANGULAR_SPEED, "latest command: turning speed, to the left"
    ),
    SignalDeclaration("path.length", LENGTH, "length of the true path so far"),
    SignalDeclaration("elapsed", TIME, "time since the start of the run"),
    SignalDeclaration(
        "mission.leg", RATIO, "waypoint being approached, from 1, as the system reports"
    ),
    SignalDeclaration("mission.leg.elapsed", TIME, "time since that waypoint was first approached"),
    SignalDeclaration("mission.reached", RATIO, "waypoints done, as the system under test reports"),
    SignalDeclaration(
        "mission.remaining", RATIO, "waypoints not yet done, as the system under test reports"
    ),
    SignalDeclaration("mission.distance", LENGTH, "true distance to the waypoint being approached"),
    SignalDeclaration(
        "latency",
        TIME,
        "wall time an external system took to answer, the longest since the previous sample",
    ),
    SignalDeclaration(
        "bt.recoveries",
        RATIO,
        "recoveries of Nav2 begun so far: nodes of its behaviour tree called Spin, BackUp, Wait, "
        "DriveOnHeading, AssistedTeleop (also with a suffix, Spin-2) or Clear...Costmap... that "
        "left IDLE",
        report=_TREE,
    ),
    SignalDeclaration(
        "bt.node",
        None,
        "the node of Nav2's behaviour tree was RUNNING since the previous sample: bt.node(Spin)",
        takes_node=True,
        report=_TREE,
    ),
)

SIGNALS: Final = {kind.name: kind for kind in _DECLARATIONS}
"""Built-in signals of every run, by name."""

OBJECT_SIGNALS: Final = {
    kind.name: kind
    for kind in (
        SignalDeclaration("angle", ANGLE, "position of a revolute joint, 0 as drawn"),
        SignalDeclaration("position", LENGTH, "position of a prismatic joint, 0 as drawn"),
        SignalDeclaration(
            "distance", LENGTH, "from the robot's base frame to the foot of the joint"
        ),
    )
}
"""Signals of a scenery object or joint, by the last part of their name."""


def mover_hint(name: str) -> str:
    """Return a hint with the signals of a mover."""
    return (
        f"signals of a mover: distance(robot, {name}); {name}.x.position, {name}.y.position and "
        f"{name}.yaw.angle, relative to its placement"
    )


def signal_declaration(name: str) -> SignalDeclaration | None:
    """Return the declaration of a signal by name (object signals by their ending), if any.

    Built-in signals have priority over plug-ins, so that no plug-in changes existing oracles.
    Raises ``ValueError`` for unusable plug-ins.
    """
    declared = SIGNALS.get(name) or _custom_declaration(name)
    if declared is None and "." in name:
        return OBJECT_SIGNALS.get(name.rpartition(".")[2])
    return declared


def signal_names() -> tuple[str, ...]:
    """Return the names of all built-in and plug-in signals, without those of objects."""
    return (*SIGNALS, *custom_signal_names())


def _custom_declaration(name: str) -> SignalDeclaration | None:
    custom = custom_signal(name)
    if custom is None:
        return None
    arguments = tuple(d for unit in custom.arguments if (d := dimension_of(unit)) is not None)
    return SignalDeclaration(name, dimension_of(custom.unit), custom.doc, arguments, required=True)
