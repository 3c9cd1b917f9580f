"""Reader of robot files (YAML), in which every measure has a unit.

Receivers of run specifications import :mod:`grammars.model.robot` without these models.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import AfterValidator, ConfigDict, Field, model_validator

from grammars.model.geometry import Ring, convex_ring, turn
from grammars.model.robot import Drive, Laser, OdometryNoise, Robot
from grammars.text.diagnostics import Finding, raise_all
from grammars.text.documents import StrictModel, YamlDocument, load_yaml, read_model
from grammars.text.quantity import Length, Mass

_ID_PATTERN: Final = r"^[A-Za-z0-9][A-Za-z0-9._-]*$"
_IN_MISSIONS: Final = "it belongs in a mission file: NAME.mission.yaml"
_IN_ROBOTS: Final = "it belongs in a robot file: robots/NAME.yaml"
_IN_CAMPAIGNS: Final = "it belongs in the campaign file"
MISSION_KEYS: Final = dict.fromkeys(("start", "waypoints"), _IN_MISSIONS)
"""Keys of mission files."""
ROBOT_KEYS: Final = dict.fromkeys(
    ("footprint", "height", "mass", "drive", "laser", "lasers", "odometry"), _IN_ROBOTS
)
"""Keys of robot files."""
CAMPAIGN_KEYS: Final = dict.fromkeys(
    ("campaign", "repeats", "seed", "limit", "oracles", "scenarios", "floorplan", "objects",
     "behaviours", "matrix", "expect", "defaults", "robot", "mission", "sut"),
    _IN_CAMPAIGNS,
)  # fmt: skip
"""Keys of campaign files that people write in other files."""

_ROUND: Final = 32
"""Corners of a round robot: the polygon deviates by less than 0.5 % of the radius."""


class FootprintText(StrictModel):
    """The robot from above, in base_link: a centred box, a circle, or a convex outline."""

    model_config = ConfigDict(
        json_schema_extra={
            "oneOf": [
                {"required": ["length", "width"]},
                {"required": ["radius"]},
                {"required": ["corners"]},
            ],
        }
    )

    length: Length | None = None
    """Size along x, the direction the robot faces."""
    width: Length | None = None
    """Size along y."""
    radius: Length | None = Field(default=None, gt=0)
    """Radius of a round robot, simulated as a polygon of 32 corners."""
    corners: list[tuple[Length, Length]] | None = Field(default=None, min_length=3, max_length=64)
    """Corners in order, each as [x, y]; the outline must be convex and contain [0 m, 0 m]."""

    @model_validator(mode="after")
    def _either(self) -> FootprintText:
        box = self.length is not None and self.width is not None
        half_a_box = box != (self.length is not None or self.width is not None)
        if half_a_box or box + (self.radius is not None) + (self.corners is not None) != 1:
            raise ValueError('give "length" and "width", or "radius", or "corners"')
        if box and min(self.length or 0.0, self.width or 0.0) <= 0.0:
            raise ValueError("length and width must be greater than 0 m")
        return self

    def ring(self) -> Ring:
        """Return the outline, with corners in the order of the file."""
        if self.corners is not None:
            return tuple(self.corners)
        if self.radius is not None:
            angles = [math.tau * k / _ROUND for k in range(_ROUND)]
            return tuple((self.radius * math.cos(a), self.radius * math.sin(a)) for a in angles)
        hx, hy = (self.length or 0.0) / 2, (self.width or 0.0) / 2
        return ((hx, hy), (-hx, hy), (-hx, -hy), (hx, -hy))


_MOTORS: Final = ("max_vx", "max_wz", "max_ax", "max_az", "max_force", "max_torque")
_SIDEWAYS: Final = ("max_vy", "max_ay")


def _complete_drive(drive: Drive) -> Drive:
    """Return a drive completed by its law: the default sideways speed of motors is 0."""
    absent = [name for name in (*_MOTORS, *_SIDEWAYS) if math.isinf(getattr(drive, name))]
    if drive.law == "imposed":
        idle = {*_MOTORS[2:], "max_ay"}.difference(absent)
        if idle:
            raise ValueError(f"an imposed velocity has no {', '.join(sorted(idle))}: leave it out")
        return drive
    missing = [name for name in _MOTORS if name in absent]
    if missing:
        raise ValueError(f"a drive by motors needs {', '.join(missing)}")
    if drive.friction_loss > 0.0 or drive.turning_loss > 0.0:
        raise ValueError('friction_loss and turning_loss are for "law: imposed"')
    zeros: dict[str, Any] = dict.fromkeys(absent, 0.0)
    return replace(drive, **zeros)


def _check_laser(laser: Laser) -> Laser:
    """Return a laser with consistent angles and ranges; raises ``ValueError`` otherwise."""
    if not 0 < laser.angle_max - laser.angle_min <= math.tau + 1e-9:
        raise ValueError("angle_max must be above angle_min by at most one full turn")
    if laser.range_max <= laser.range_min:
        raise ValueError("range_max must be above range_min")
    return laser


def _with_rate(odometry: OdometryNoise) -> OdometryNoise:
    """Return the odometry with its rate, computed from a period if necessary."""
    if (odometry.rate > 0.0) == (odometry.period > 0.0):
        raise ValueError('give "rate" or "period"')
    return odometry if odometry.rate > 0.0 else replace(odometry, rate=1.0 / odometry.period)


_Laser = Annotated[Laser, AfterValidator(_check_laser)]
_MOST_LASERS: Final = 16
_BESIDE: Final = 1e-9


class RobotText(StrictModel):
    """The keys of a robot file; every measure has a unit."""

    elsewhere = (
        MISSION_KEYS
        | CAMPAIGN_KEYS
        | dict.fromkeys(
            ("kind", "max_vx", "max_vy", "max_wz", "max_ax", "max_az", "timeout"),
            'it belongs in "drive:"',
        )
        | dict.fromkeys(("length", "width", "radius", "corners"), 'it belongs in "footprint:"')
        | {"parameters": "systems under test have it: suts/NAME.yaml"}
    )

    model_config = ConfigDict(
        json_schema_extra={"oneOf": [{"required": ["laser"]}, {"required": ["lasers"]}]}
    )

    robot: str = Field(pattern=_ID_PATTERN, max_length=60)
    """Name of the robot."""
    about: str = ""
    """One line for people."""
    footprint: FootprintText = Field(examples=[{"length": "0.5 m", "width": "0.4 m"}])
    height: Length = Field(gt=0)
    """Height of the robot: it passes below everything higher."""
    mass: Mass = Field(gt=0)
    drive: Annotated[Drive, AfterValidator(_complete_drive)]
    laser: Annotated[_Laser, Field(json_schema_extra={"not": {"required": ["name"]}})] | None = None
    """The only laser."""
    lasers: list[Annotated[_Laser, Field(json_schema_extra={"required": ["name"]})]] | None = Field(
        default=None, min_length=1, max_length=_MOST_LASERS
    )
    """Several lasers by name, instead of "laser"."""
    odometry: Annotated[
        OdometryNoise,
        AfterValidator(_with_rate),
        Field(json_schema_extra={"oneOf": [{"required": ["rate"]}, {"required": ["period"]}]}),
    ]

    @model_validator(mode="after")
    def _has_laser(self) -> RobotText:
        if (self.laser is None) == (self.lasers is None):
            raise ValueError('give "laser" or, for several, "lasers"')
        return self


def load_robot(path: str | Path) -> Robot:
    """Read a robot description; raises :class:`InputError` with every problem of the file."""
    return read_robot(load_yaml(path))


def read_robot(document: YamlDocument) -> Robot:
    """Return the robot of a document; raises :class:`InputError` with all its problems."""
    text = read_model(document, RobotText)
    lasers = [text.laser] if text.laser is not None else text.lasers or []
    ring = convex_ring(text.footprint.ring())
    raise_all([*_outline_problems(ring, document), *_name_problems(text, document)])
    assert ring is not None
    return Robot(
        name=text.robot,
        footprint=ring,
        height=text.height,
        mass=text.mass,
        drive=text.drive,
        laser=lasers[0],
        odometry=text.odometry,
        other_lasers=tuple(lasers[1:]),
    )


def _name_problems(text: RobotText, document: YamlDocument) -> Iterator[Finding]:
    """Yield problems of the names of lasers: a single one has none, several need distinct ones."""
    if text.laser is not None and text.laser.name:
        where = document.where(("laser", "name"))
        yield Finding(where, 'unknown key "name"', 'only lasers under "lasers:" have names')
    lasers = text.lasers or ()
    for index, laser in enumerate(lasers):
        if not laser.name:
            yield Finding(document.where(("lasers", index)), 'key "name" is missing')
        elif laser.name in [earlier.name for earlier in lasers[:index]]:
            where = document.where(("lasers", index, "name"))
            message = f'the name "{laser.name}" is already used by another laser'
            yield Finding(where, message, "give each laser its own name")


def _outline_problems(ring: Ring | None, document: YamlDocument) -> Iterator[Finding]:
    """Yield problems of a footprint; the simulator and the oracles need a convex one."""
    where = document.where(("footprint", "corners"))
    if ring is None:
        hint = "list the corners in order around the robot, without dents or repeats"
        yield Finding(where, "the footprint is not convex", hint)
        return
    sides = zip(ring, (*ring[1:], ring[0]), strict=True)
    if any(turn((0.0, 0.0), a, b) < -_BESIDE for a, b in sides):
        message = (
            "the footprint does not contain base_link, the point (0 m, 0 m) the robot turns about"
        )
        yield Finding(where, message, "place the corners around that point")
