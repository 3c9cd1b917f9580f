"""The signals an oracle can speak of: name, what it is measured in, what it means.

Signals of scenery objects are built from the object's name: ``<object>.angle`` for an object with
one joint, ``<object>.<joint>.angle`` for any joint.
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


@dataclass(frozen=True, slots=True)
class SignalKind:
    """A declared signal; ``dimension`` is ``None`` when it is true or false.

    ``arguments`` are the dimensions of its arguments, which may be left out altogether.
    """

    name: str
    dimension: Dimension | None
    doc: str
    arguments: tuple[Dimension, ...] = ()

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
    SignalKind("loc.age", TIME, "time since the latest estimate was taken"),
    SignalKind(
        "clearance",
        LENGTH,
        "min over obstacle points of max(|x| - hx, |y| - hy) in the base frame: negative when an "
        "obstacle is inside the box; without arguments, the box around the robot's footprint",
        (LENGTH, LENGTH),
    ),
    SignalKind("contact", None, "the robot's body touched something since the previous sample"),
    SignalKind("contact.depth", LENGTH, "deepest recorded overlap with the robot, 0 without"),
    SignalKind("speed", SPEED, "true speed of the robot's base"),
    SignalKind("speed.angular", ANGULAR_SPEED, "true turning speed of the robot, without sign"),
    SignalKind("path.length", LENGTH, "length of the true path so far"),
    SignalKind("elapsed", TIME, "time since the start of the run"),
    SignalKind("mission.leg", RATIO, "waypoint being approached, from 1, as the system reports"),
    SignalKind("mission.reached", RATIO, "waypoints done, as the system under test reports"),
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
    """Return the declaration of a signal by name (object signals by their ending), or ``None``."""
    declared = SIGNALS.get(name)
    if declared is None and "." in name:
        return OBJECT_SIGNALS.get(name.rpartition(".")[2])
    return declared
