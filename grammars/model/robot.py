"""Robot descriptions (``robots/*.yaml``): footprint, drive, lasers and odometry."""

from __future__ import annotations

import math
import operator
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Final, Literal

from pydantic import AfterValidator, ConfigDict, Field

from grammars.model.geometry import Pose2, Ring
from grammars.text.quantity import (
    Acceleration,
    Angle,
    AngularAcceleration,
    AngularSpeed,
    Duration,
    Force,
    Frequency,
    Length,
    QuantityField,
    Ratio,
    Speed,
    Torque,
)

LASER_NAME: Final = r"^[a-z][a-z0-9_]*$"
"""Pattern of names of lasers, which become part of the names of topics and frames."""


@dataclass(frozen=True, slots=True)
class Drive:
    """Limits of the base, which the simulator enforces."""

    kind: Literal["omnidirectional", "differential"]
    """Omnidirectional bases drive sideways, too."""
    max_vx: Annotated[Speed, Field(gt=0)] = math.inf
    """Largest speed ahead and back."""
    max_vy: Annotated[Speed, Field(ge=0)] = math.inf
    """Largest sideways speed (omnidirectional)."""
    max_wz: Annotated[AngularSpeed, Field(gt=0)] = math.inf
    """Largest turning speed."""
    max_ax: Annotated[Acceleration, Field(gt=0)] = math.inf
    """Largest acceleration ahead and back."""
    max_ay: Annotated[Acceleration, Field(ge=0)] = math.inf
    """Largest sideways acceleration (omnidirectional)."""
    max_az: Annotated[AngularAcceleration, Field(gt=0)] = math.inf
    """Largest angular acceleration."""
    max_force: Annotated[Force, Field(gt=0)] = math.inf
    """Largest force of the motors."""
    max_torque: Annotated[Torque, Field(gt=0)] = math.inf
    """Largest torque of the motors about the vertical axis."""
    timeout: Annotated[Duration, Field(ge=0)] = 0.0
    """Without a command for this long the base brakes; 0 s: the last command holds."""
    law: Literal["motors", "imposed"] = "motors"
    """Motion after a command. motors: within the limits, pushing with at most force and torque.
    imposed: at once, with any force, like Gazebo's planar-move."""
    friction_loss: Annotated[Speed, Field(ge=0)] = 0.0
    """Loss of an imposed velocity to the ground, along x and y of the world. In Gazebo: friction
    coefficient x gravity x time step."""
    turning_loss: Annotated[AngularSpeed, Field(ge=0)] = 0.0
    """Loss of an imposed turning speed to the ground."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(
        extra="forbid",
        ser_json_inf_nan="strings",  # JSON has no infinity.
        json_schema_extra={
            "anyOf": [
                {"properties": {"law": {"const": "imposed"}}, "required": ["law"]},
                {"required": ["max_vx", "max_wz", "max_ax", "max_az", "max_force", "max_torque"]},
            ],
        },
    )


@dataclass(frozen=True, slots=True)
class Mount(Pose2):
    """Pose of a sensor on the robot, in base_link."""

    x: Length
    """Ahead of the centre of the robot."""
    y: Length = 0.0
    """To the left of the centre of the robot."""
    yaw: Angle = 0.0
    """Viewing direction, counter-clockwise from straight ahead."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")


@dataclass(frozen=True, slots=True)
class Laser:
    """A planar laser scanner."""

    mount: Mount
    z: Annotated[Length, Field(ge=0)]
    """Height of the scan plane above the floor."""
    angle_min: Angle
    """Direction of the first ray, from the viewing direction of the laser."""
    angle_max: Angle
    """Direction of the last ray, at most one full turn beyond."""
    rays: Annotated[int, Field(ge=2, le=20_000)]
    """Rays of a scan, spread evenly."""
    range_min: Annotated[Length, Field(ge=0)]
    """Shortest measurable range."""
    range_max: Annotated[Length, Field(gt=0)]
    """Longest measurable range."""
    rate: Annotated[Frequency, Field(gt=0, le=100)]
    """Scans per second."""
    noise: Annotated[Length, Field(ge=0)] = 0.0
    """Standard deviation of each range."""
    dropout: Annotated[Ratio, Field(ge=0, lt=1)] = 0.0
    """Share of rays that return nothing."""
    too_near: Literal["infinite", "clamped"] = "infinite"
    """Reading for a return nearer than range_min. infinite: -inf, as REP 117 demands. clamped:
    range_min, like Gazebo's laser."""
    # Not in JSON if empty, so that specifications from before lasers had names stay the same.
    name: Annotated[str, Field(pattern=LASER_NAME, max_length=40, exclude_if=operator.not_)] = ""
    """Name of one of several lasers, whose scans come on /scan_NAME."""

    elsewhere: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("x", "y", "yaw"), 'it belongs in "mount:"'
    )
    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    @property
    def topic(self) -> str:
        """The usual relative name of its topic: ``scan``, ``scan_front``."""
        return f"scan_{self.name}" if self.name else "scan"

    @property
    def frame(self) -> str:
        """The usual name of its frame: ``laser``, ``laser_front``."""
        return f"laser_{self.name}" if self.name else "laser"

    @property
    def label(self) -> str:
        """The name of the laser in sentences: ``laser``, ``laser front``."""
        return f"laser {self.name}" if self.name else "laser"

    @property
    def angle_increment(self) -> float:
        """Angle between two neighbouring rays [rad]; the whole field of view for a single ray."""
        return (self.angle_max - self.angle_min) / max(1, self.rays - 1)


SHORTEST_PERIOD: Final = 0.01
"""Shortest time between two messages of the odometry [s]: a tick of the simulator."""


def _check_period(value: float) -> float:
    """Return a valid time between messages, or 0 for none; raises ``ValueError``."""
    if value != 0.0 and not value >= SHORTEST_PERIOD:
        raise ValueError(f"must be greater than or equal to {SHORTEST_PERIOD}")
    return value


@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """Wheel odometry."""

    rate: Annotated[Frequency, Field(gt=0, le=100)] = 0.0
    """Messages per second, each at a tick (every 10 ms)."""
    translation: Annotated[float, QuantityField("noise per root length"), Field(ge=0)] = 0.0
    """Error of the distance."""
    rotation: Annotated[float, QuantityField("noise per root angle"), Field(ge=0)] = 0.0
    """Error of the heading from turning."""
    drift: Annotated[float, QuantityField("drift per root length"), Field(ge=0)] = 0.0
    """Error of the heading from driving straight."""
    period: Annotated[
        Duration, AfterValidator(_check_period), Field(json_schema_extra={"ge": SHORTEST_PERIOD})
    ] = 0.0
    """Instead of a rate, the exact time between messages, such as 51 ms: each describes its own
    instant and arrives at the next tick."""
    twist: Literal["instantaneous", "mean"] = "instantaneous"
    """Velocity in a message: that of its instant, or the mean since the previous one, like Gazebo's
    planar-move."""
    origin: Literal["start", "map"] = "start"
    """Origin of the odom frame: the start pose of the robot, or that of the map."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")


@dataclass(frozen=True, slots=True)
class Robot:
    """A mobile base seen from above; ``footprint`` is a convex ring in the base frame.

    ``laser`` is the first of its ``lasers``; maps are drawn at its height. Raises ``ValueError`` if
    several lasers lack distinct names.
    """

    name: str
    footprint: Ring
    height: float
    mass: float
    drive: Drive
    laser: Laser
    odometry: OdometryNoise
    other_lasers: Annotated[tuple[Laser, ...], Field(exclude_if=operator.not_)] = ()

    def __post_init__(self) -> None:
        if self.other_lasers:
            twice = [name for name, n in Counter(x.name for x in self.lasers).items() if n > 1]
            if twice or not all(laser.name for laser in self.lasers):
                raise ValueError("each of several lasers needs a name of its own")

    @property
    def lasers(self) -> tuple[Laser, ...]:
        """All lasers, in the order of the file, which is also the order of their scans."""
        return (self.laser, *self.other_lasers)
