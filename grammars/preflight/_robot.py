"""Checks of a robot's values that were probably meant otherwise: units, mounts, rates."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Final, TypeAlias

from grammars.model.free_space import circumscribed_radius
from grammars.model.robot import Laser, Robot
from grammars.model.scene import Scene
from grammars.text.diagnostics import Finding, Findings, Where

_SIZES: Final = (0.05, 10.0)
"""Usual lengths of robots [m]."""
_SLOW: Final = 60.0
"""Longest usual time [s] for half a turn, or for a metre."""
_SPIN_UP: Final = 10.0
"""Longest usual time [s] to reach the top speed."""
_COMMANDS: Final = 0.05
"""Time between two commands of a fast stack [s]."""
_ODOMETRY: Final = 1.0
"""Longest usual time between two messages of the odometry [s]."""
_VIEW: Final = math.radians(15.0)
"""Smallest usual field of view [rad]."""
_NOISE: Final = 0.2
"""Largest usual noise of a range [m]."""
_BEYOND: Final = 0.5
"""Largest usual distance of a laser outside of the footprint [m]."""

_Path: TypeAlias = tuple[str | int, ...]
_Doubt: TypeAlias = tuple[_Path, str, str]
"""The path of a value in the robot's file, a message and a remedy."""


def check_robot(robot: Robot, scene: Scene, place: Callable[[_Path], Where]) -> tuple[Finding, ...]:
    """Return warnings about a robot in a scene; ``place`` finds its keys in its file."""
    findings = Findings()
    for path, message, hint in (*_of_body(robot), *_of_drive(robot), *_of_lasers(robot, scene)):
        findings.warning(place(path), message, hint)
    return findings.all


def _of_body(robot: Robot) -> Iterator[_Doubt]:
    least, most = _SIZES
    size = max(math.dist(a, b) for a in robot.footprint for b in robot.footprint)
    if not least <= size <= most:
        message = f"the footprint of {robot.name} is {size:.3g} m long"
        yield ("footprint",), message, "check the unit"
    odometry = robot.odometry
    key = "period" if odometry.period else "rate"
    seconds = odometry.period or (1.0 / odometry.rate if odometry.rate else 0.0)
    if seconds > _ODOMETRY:
        message = f"the odometry of {robot.name} comes every {seconds:g} s"
        yield ("odometry", key), message, "stacks need it several times a second"


def _of_drive(robot: Robot) -> Iterator[_Doubt]:
    drive = robot.drive
    if math.pi > _SLOW * drive.max_wz:
        seconds = math.pi / drive.max_wz
        message = f"half a turn takes {robot.name} {seconds:.0f} s with this max_wz"
        yield ("drive", "max_wz"), message, "write rad/s if radians are meant"
    if _SLOW * drive.max_vx < 1.0:
        message = f"one metre takes {robot.name} {1.0 / drive.max_vx:.0f} s with this max_vx"
        yield ("drive", "max_vx"), message, "check the unit"
    if drive.kind == "differential" and 0.0 < drive.max_vy < math.inf:
        message = f"{robot.name} has max_vy, but a differential drive cannot drive sideways"
        yield ("drive", "max_vy"), message, "remove it, or write kind: omnidirectional"
    top = min(drive.max_vx, 1.0)
    if robot.mass * top > _SPIN_UP * drive.max_force:
        seconds = robot.mass * top / drive.max_force
        message = (
            f"{robot.name} takes {seconds:.0f} s to reach {top:g} m/s with its mass of "
            f"{robot.mass:g} kg and its max_force"
        )
        yield ("mass",), message, "check the units of both"
    if 0.0 < drive.timeout < _COMMANDS:
        message = (
            f"the base of {robot.name} brakes {drive.timeout:g} s after a command: its timeout is "
            "shorter than the time to the next one"
        )
        yield ("drive", "timeout"), message, "write 0.5 s, or 0 s to hold the last command"


def _of_lasers(robot: Robot, scene: Scene) -> Iterator[_Doubt]:
    heights = [(solid.z_min, solid.z_max) for solid in scene.solids]
    heights += [(link.z_min, link.z_max) for body in scene.objects for link in body.links]
    for number, laser in enumerate(robot.lasers):
        path: _Path = ("lasers", number) if laser.name else ("laser",)
        for key, problem, hint in _of_laser(laser, robot, heights):
            message = f"the {laser.label} of {robot.name} {problem}"
            yield (*path, key), message, hint
    if not any(map(_sees_ahead, robot.lasers)):
        path = ("lasers",) if robot.laser.name else ("laser", "mount")
        message = f"no laser of {robot.name} sees straight ahead"
        yield path, message, "check its mount and its angles"


def _of_laser(
    laser: Laser, robot: Robot, heights: Sequence[tuple[float, float]]
) -> Iterator[tuple[str, str, str]]:
    """Yield the key, the rest of a message and a remedy; all things stand at ``heights`` [m]."""
    if not any(low <= laser.z <= high for low, high in heights):
        top = max((high for _, high in heights), default=0.0)
        yield "z", f"sees nothing at {laser.z:g} m", f"walls and objects end at {top:g} m: lower it"
    view = laser.angle_max - laser.angle_min
    if view < _VIEW:
        hint = "write rad if radians are meant"
        yield "angle_min", f"sees only {math.degrees(view):.3g} deg", hint
    away, reach = math.hypot(laser.mount.x, laser.mount.y), circumscribed_radius(robot.footprint)
    if away > reach + _BEYOND:
        problem = f"has its mount {away:g} m from the centre, the robot reaches {reach:.2f} m"
        yield "mount", problem, "check the unit"
    if laser.noise > _NOISE:
        yield "noise", f"has a noise of {laser.noise:g} m", "check the unit"
    if laser.range_max <= reach:
        yield "range_max", f"measures only {laser.range_max:g} m", "check the unit"


def _sees_ahead(laser: Laser) -> bool:
    low, high = laser.mount.yaw + laser.angle_min, laser.mount.yaw + laser.angle_max
    return math.floor(high / math.tau) * math.tau >= low
