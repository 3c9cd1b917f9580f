"""The signals an oracle can speak of: name, what it is measured in, what it means.

Signals of scenery objects are built from the object's name: ``<object>.angle`` for an object with
one joint, ``<object>.<joint>.angle`` for any joint. Packages add signals of their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from grammars.oracle._dimension import (
    ANGLE,
    ANGULAR_SPEED,
    LENGTH,
    RATIO,
    SPEED,
    TIME,
    Dimension,
)
from grammars.oracle._plugins import custom_signal, custom_signal_names, dimension_of


@dataclass(frozen=True, slots=True)
class SignalKind:
    """A declared signal; ``dimension`` is ``None`` when it is true or false.

    ``arguments`` are the dimensions of its arguments, which may be left out altogether unless
    ``required``. A signal that ``takes_object`` may name a thing in the scene before them.
    """

    name: str
    dimension: Dimension | None
    doc: str
    arguments: tuple[Dimension, ...] = ()
    takes_object: bool = False
    required: bool = False

    @property
    def unit(self) -> str:
        """SI unit, or ``bool``."""
        return "bool" if self.dimension is None else self.dimension.unit


_KINDS: Final = (
    SignalKind("loc.error", LENGTH, "distance from estimated to true position"),
    SignalKind("loc.error.x", LENGTH, "estimated minus true x, map frame"),
    SignalKind("loc.error.y", LENGTH, "estimated minus true y, map frame"),
    SignalKind("loc.error.yaw", ANGLE, "estimated minus true heading, wrapped to (-pi, pi]"),
    SignalKind(
        "loc.inside_2sigma",
        None,
        "true position within mean +- 2 sigma of the particle cloud, on x and on y (Eq. 1)",
    ),
    SignalKind("loc.sigma.x", LENGTH, "standard deviation of the position estimate along x"),
    SignalKind("loc.sigma.y", LENGTH, "standard deviation of the position estimate along y"),
    SignalKind("loc.sigma.yaw", ANGLE, "standard deviation of the heading estimate"),
    SignalKind("loc.age", TIME, "time since the latest estimate was taken"),
    SignalKind("estimate.x", LENGTH, "estimated position, map frame"),
    SignalKind("estimate.y", LENGTH, "estimated position, map frame"),
    SignalKind("estimate.yaw", ANGLE, "estimated heading, in (-pi, pi]"),
    SignalKind("estimate.particles", RATIO, "particles in the cloud of the estimate"),
    SignalKind("pose.x", LENGTH, "true position of the robot's base, map frame"),
    SignalKind("pose.y", LENGTH, "true position of the robot's base, map frame"),
    SignalKind("pose.yaw", ANGLE, "true heading of the robot, in (-pi, pi]"),
    SignalKind(
        "clearance",
        LENGTH,
        "min over obstacle points of max(|x| - hx, |y| - hy) in the base frame: negative when an "
        "obstacle is inside the box; without hx, hy, the box around the robot's footprint; with "
        "the name of an object, of that one alone: clearance(door-17, 0.35 m, 0.2 m)",
        (LENGTH, LENGTH),
        takes_object=True,
    ),
    SignalKind(
        "contact",
        None,
        "the robot's body touched something, or the object named, since the previous sample",
        takes_object=True,
    ),
    SignalKind(
        "contact.depth",
        LENGTH,
        "deepest recorded overlap with the robot, 0 without",
        takes_object=True,
    ),
    SignalKind("speed", SPEED, "true speed of the robot's base"),
    SignalKind("speed.forward", SPEED, "true speed ahead, negative when driving backwards"),
    SignalKind("speed.sideways", SPEED, "true speed to the left"),
    SignalKind("speed.angular", ANGULAR_SPEED, "true turning speed of the robot, without sign"),
    SignalKind("command.forward", SPEED, "latest command: speed ahead"),
    SignalKind("command.sideways", SPEED, "latest command: speed to the left"),
    SignalKind("command.angular", ANGULAR_SPEED, "latest command: turning speed, to the left"),
    SignalKind("path.length", LENGTH, "length of the true path so far"),
    SignalKind("elapsed", TIME, "time since the start of the run"),
    SignalKind("mission.leg", RATIO, "waypoint being approached, from 1, as the system reports"),
    SignalKind("mission.leg.elapsed", TIME, "time since that waypoint was first approached"),
    SignalKind("mission.reached", RATIO, "waypoints done, as the system under test reports"),
    SignalKind("mission.distance", LENGTH, "true distance to the waypoint being approached"),
)

SIGNALS: Final = {kind.name: kind for kind in _KINDS}
"""Signals every run has, by name."""

OBJECT_SIGNALS: Final = {
    kind.name: kind
    for kind in (
        SignalKind("angle", ANGLE, "position of a revolute joint, 0 as drawn"),
        SignalKind("position", LENGTH, "position of a prismatic joint, 0 as drawn"),
        SignalKind("distance", LENGTH, "from the robot's base frame to the foot of the joint"),
    )
}
"""Signals of a scenery object or joint, by the last part of their name."""


def signal_kind(name: str) -> SignalKind | None:
    """Return the declaration of a signal by name (object signals by their ending), or ``None``.

    Signals that ship here come first, then those that plug in, then those of objects. Raises
    ``ValueError`` when the name is that of a plug-in that cannot be used.
    """
    declared = SIGNALS.get(name) or _custom_kind(name)
    if declared is None and "." in name:
        return OBJECT_SIGNALS.get(name.rpartition(".")[2])
    return declared


def known_names() -> tuple[str, ...]:
    """Names of every signal that needs no scene: those that ship here and those that plug in."""
    return (*SIGNALS, *custom_signal_names())


def _custom_kind(name: str) -> SignalKind | None:
    custom = custom_signal(name)
    if custom is None:
        return None
    arguments = tuple(d for unit in custom.arguments if (d := dimension_of(unit)) is not None)
    return SignalKind(name, dimension_of(custom.unit), custom.doc, arguments, required=True)
