"""The YAML files people write about robots, read into the values of this package.

Every measure has a unit. Apart from the values on purpose: whoever receives a run specification
needs those alone, and is spared the models that check YAML.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import ConfigDict, Field, model_validator

from grammars.model.geometry import Pose2, Ring, convex_ring, turn
from grammars.model.misplaced_keys import CAMPAIGN_KEYS, MISSION_KEYS
from grammars.model.robot import LASER_NAME, LONGEST_LASER_NAME, Drive, Laser, OdometryNoise, Robot
from grammars.text.diagnostics import InputError
from grammars.text.documents import (
    Acceleration,
    Angle,
    AngularAcceleration,
    AngularSpeed,
    Duration,
    Force,
    Frequency,
    Length,
    Mass,
    QuantityField,
    Ratio,
    Speed,
    StrictModel,
    Torque,
    YamlDocument,
    load_yaml,
    read_model,
)

_ID_PATTERN: Final = r"^[A-Za-z0-9][A-Za-z0-9._-]*$"


_ROUND: Final = 32
"""Corners of a round robot: the polygon lies within 0.5 % of the radius of the circle."""


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
    """Along x, the way the robot looks."""
    width: Length | None = None
    """Along y."""
    radius: Length | None = Field(default=None, gt=0)
    """Of a round robot; simulated as a regular polygon of 32 corners on the circle."""
    corners: list[tuple[Length, Length]] | None = Field(default=None, min_length=3, max_length=64)
    """The corners in order around the robot, each as [x, y]; the outline must be convex
    and contain [0 m, 0 m]."""

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
        """Return the outline as written."""
        if self.corners is not None:
            return tuple(self.corners)
        if self.radius is not None:
            angles = [math.tau * k / _ROUND for k in range(_ROUND)]
            return tuple((self.radius * math.cos(a), self.radius * math.sin(a)) for a in angles)
        hx, hy = (self.length or 0.0) / 2, (self.width or 0.0) / 2
        return ((hx, hy), (-hx, hy), (-hx, -hy), (hx, -hy))


class DriveText(StrictModel):
    """What the base can do; the simulator holds every command to it."""

    model_config = ConfigDict(
        json_schema_extra={
            "anyOf": [
                {"properties": {"law": {"const": "imposed"}}, "required": ["law"]},
                {"required": ["max_vx", "max_wz", "max_ax", "max_az", "max_force", "max_torque"]},
            ],
        }
    )

    kind: Literal["omnidirectional", "differential"]
    """An omnidirectional base drives sideways, a differential one only turns and drives ahead."""
    law: Literal["motors", "imposed"] = "motors"
    """How a command becomes motion. motors: the base speeds up within its accelerations and pushes
    with at most its force and torque. imposed: the commanded velocity is there at once and stays,
    whatever it takes, until something immovable is in the way; so does Gazebo's planar-move."""
    max_vx: Speed | None = Field(default=None, gt=0)
    """Largest speed ahead and back; with an imposed velocity it may be left out: no limit."""
    max_vy: Speed | None = Field(default=None, ge=0)
    """Largest speed sideways; of an omnidirectional base."""
    max_wz: AngularSpeed | None = Field(default=None, gt=0)
    """Largest turning speed; with an imposed velocity it may be left out: no limit."""
    max_ax: Acceleration | None = Field(default=None, gt=0)
    """Largest acceleration ahead and back; of motors."""
    max_ay: Acceleration | None = Field(default=None, ge=0)
    """Largest acceleration sideways; of motors of an omnidirectional base."""
    max_az: AngularAcceleration | None = Field(default=None, gt=0)
    """Largest angular acceleration; of motors."""
    max_force: Force | None = Field(default=None, gt=0)
    """What the motors can push with."""
    max_torque: Torque | None = Field(default=None, gt=0)
    """What the motors can turn the base with."""
    timeout: Duration = Field(default=0.0, ge=0)
    """Without a command for this long the base brakes; 0 s: the last command holds."""
    friction_loss: Speed = Field(default=0.0, ge=0)
    """What an imposed velocity loses to the ground along each axis of the world: its x and its y
    component are smaller by this (but never turned round). In Gazebo, with friction along axes:
    coefficient x gravity x time step, 0.0098 m/s for 1 x 9.8 m/s^2 x 1 ms."""
    turning_loss: AngularSpeed = Field(default=0.0, ge=0)
    """What an imposed turning speed loses to the ground."""

    @model_validator(mode="after")
    def _lawful(self) -> DriveText:
        motors = ("max_vx", "max_wz", "max_ax", "max_az", "max_force", "max_torque")
        missing = [name for name in motors if getattr(self, name) is None]
        if self.law == "motors" and missing:
            raise ValueError(f"a drive by motors needs {', '.join(missing)}")
        if self.law == "motors" and (self.friction_loss > 0.0 or self.turning_loss > 0.0):
            raise ValueError('friction_loss and turning_loss are for "law: imposed"')
        idle = [name for name in (*motors[2:], "max_ay") if getattr(self, name) is not None]
        if self.law == "imposed" and idle:
            raise ValueError(f"an imposed velocity has no {', '.join(sorted(idle))}: leave it out")
        return self

    def drive(self) -> Drive:
        """Return the drive; what has no limit is infinite, an unwritten sideways speed is 0."""
        unwritten = math.inf if self.law == "imposed" else 0.0
        values: dict[str, Any] = self.model_dump()
        values.update({name: unwritten for name, value in values.items() if value is None})
        return Drive(**values)


class MountText(StrictModel):
    """Where a sensor sits on the robot, in base_link."""

    x: Length
    """Ahead of the centre of the robot."""
    y: Length = 0.0
    """To the left of the centre of the robot."""
    yaw: Angle = 0.0
    """Which way it looks, counter-clockwise from straight ahead."""


class LaserText(StrictModel):
    """A planar laser scanner."""

    elsewhere = dict.fromkeys(("x", "y", "yaw"), 'it belongs in "mount:"')

    mount: MountText
    z: Length = Field(ge=0)
    """Height of the scan plane above the floor: walls and objects are cut there."""
    angle_min: Angle
    """Direction of the first ray, from where the laser looks."""
    angle_max: Angle
    """Direction of the last ray; at most one full turn beyond the first."""
    rays: int = Field(ge=2, le=20_000)
    """Number of rays of a scan, spread evenly from angle_min to angle_max."""
    range_min: Length = Field(ge=0)
    """Nothing nearer is seen."""
    range_max: Length = Field(gt=0)
    """Nothing farther is seen."""
    rate: Frequency = Field(gt=0, le=100)
    """Scans per second."""
    noise: Length = Field(default=0.0, ge=0)
    """Standard deviation of each range."""
    dropout: Ratio = Field(default=0.0, ge=0, lt=1)
    """Share of rays that return nothing."""
    too_near: Literal["infinite", "clamped"] = "infinite"
    """What a return nearer than range_min reads. infinite: -inf, as ROS asks of drivers (REP 117).
    clamped: range_min, as Gazebo's laser reports it."""

    @model_validator(mode="after")
    def _ordered(self) -> LaserText:
        if not 0 < self.angle_max - self.angle_min <= math.tau + 1e-9:
            raise ValueError("angle_max must be above angle_min by at most one full turn")
        if self.range_max <= self.range_min:
            raise ValueError("range_max must be above range_min")
        return self

    def laser(self) -> Laser:
        """Return the laser."""
        mount = Pose2(self.mount.x, self.mount.y, self.mount.yaw)
        return Laser(mount=mount, **self.model_dump(exclude={"mount"}))


class NamedLaserText(LaserText):
    """One of several planar laser scanners."""

    name: str = Field(pattern=LASER_NAME, max_length=LONGEST_LASER_NAME)
    """What it is called: its scans come on /scan_NAME, in the frame laser_NAME."""


_NoisePerRootLength = Annotated[float, QuantityField("noise per root length")]
_NoisePerRootAngle = Annotated[float, QuantityField("noise per root angle")]
_DriftPerRootLength = Annotated[float, QuantityField("drift per root length")]


class OdometryText(StrictModel):
    """Wheel odometry; its errors grow with the root of what was driven."""

    model_config = ConfigDict(
        json_schema_extra={"oneOf": [{"required": ["rate"]}, {"required": ["period"]}]}
    )

    rate: Frequency | None = Field(default=None, gt=0, le=100)
    """Messages per second, each of a tick of the simulator (every 10 ms)."""
    period: Duration | None = Field(default=None, ge=0.01)
    """Instead of a rate, the exact time between messages, such as 51 ms: each is of its own
    instant, between two ticks if need be, and arrives at the first tick after it."""
    twist: Literal["instantaneous", "mean"] = "instantaneous"
    """Velocity of a message: that of its instant, or the mean since the message before, from the
    difference of the two poses, as Gazebo's planar-move reports it."""
    origin: Literal["start", "map"] = "start"
    """Where the odom frame lies: where the robot starts, or on the frame of the map."""
    translation: _NoisePerRootLength = Field(default=0.0, ge=0)
    """Error of the distance: 0.01 m/m^0.5 is 1 cm after one metre, 10 cm after a hundred."""
    rotation: _NoisePerRootAngle = Field(default=0.0, ge=0)
    """Error of the heading from turning."""
    drift: _DriftPerRootLength = Field(default=0.0, ge=0)
    """Error of the heading from driving straight."""

    @model_validator(mode="after")
    def _timed(self) -> OdometryText:
        if (self.rate is None) == (self.period is None):
            raise ValueError('give "rate" or "period"')
        return self

    def odometry(self) -> OdometryNoise:
        """Return the odometry, with the rate that belongs to a period."""
        period = self.period or 0.0
        rate = self.rate if self.rate is not None else 1.0 / period
        written = self.model_dump(exclude={"rate", "period"})
        return OdometryNoise(rate=rate, period=period, **written)


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
    """The robot touches only what is lower than this."""
    mass: Mass = Field(gt=0)
    drive: DriveText
    laser: LaserText | None = None
    """The only laser."""
    lasers: list[NamedLaserText] | None = Field(default=None, min_length=1, max_length=_MOST_LASERS)
    """Instead of "laser": several, by name. Maps are drawn at the height of the first."""
    odometry: OdometryText

    @model_validator(mode="after")
    def _seeing(self) -> RobotText:
        if (self.laser is None) == (self.lasers is None):
            raise ValueError('give "laser" or, for several, "lasers"')
        return self


def load_robot(path: str | Path) -> Robot:
    """Read a robot description; raises :class:`InputError` with every problem of the file."""
    return read_robot(load_yaml(path))


def read_robot(document: YamlDocument) -> Robot:
    """Return what a robot file means; raises :class:`InputError` with every problem of it."""
    text = read_model(document, RobotText)
    ring = _outline(text.footprint, document)
    _check_names(text.lasers or (), document)
    written = [text.laser] if text.laser is not None else text.lasers or []
    first, *others = (laser.laser() for laser in written)
    return Robot(
        name=text.robot,
        footprint=ring,
        height=text.height,
        mass=text.mass,
        drive=text.drive.drive(),
        laser=first,
        odometry=text.odometry.odometry(),
        other_lasers=tuple(others),
    )


def _check_names(lasers: Sequence[NamedLaserText], document: YamlDocument) -> None:
    """Raise for a name that an earlier laser has."""
    for index, laser in enumerate(lasers):
        if laser.name in [earlier.name for earlier in lasers[:index]]:
            raise InputError.at(
                document.where(("lasers", index, "name")),
                f'there is a laser "{laser.name}" already',
                "give each laser a name of its own",
            )


def _outline(text: FootprintText, document: YamlDocument) -> Ring:
    """Return the footprint counter-clockwise; the simulator and the oracles need it convex."""
    where = document.where(("footprint", "corners"))
    ring = convex_ring(text.ring())
    if ring is None:
        raise InputError.at(
            where,
            "the footprint is not convex",
            "list the corners in order around the robot, without dents or repeats",
        )
    sides = zip(ring, (*ring[1:], ring[0]), strict=True)
    if any(turn((0.0, 0.0), a, b) < -_BESIDE for a, b in sides):
        raise InputError.at(
            where,
            "the footprint does not contain base_link, the point (0 m, 0 m) the robot turns about",
            "give the corners as they lie around that point",
        )
    return ring
