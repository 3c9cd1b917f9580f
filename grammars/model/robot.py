"""Robot descriptions: footprint, drive, lasers and odometry, as written in ``robots/*.yaml``."""

from __future__ import annotations

import operator
import re
from collections import Counter
from dataclasses import dataclass
from typing import Annotated, ClassVar, Final, Literal

from pydantic import ConfigDict, Field

from grammars.model.geometry import Pose2, Ring

LASER_NAME: Final = r"^[a-z][a-z0-9_]*$"
"""What a laser may be called: its name becomes part of those of topics and frames."""
LONGEST_LASER_NAME: Final = 40


@dataclass(frozen=True, slots=True)
class Drive:
    """What the base can do: speeds [m/s, rad/s], accelerations [m/s^2, rad/s^2], effort.

    After ``timeout`` seconds without a new command the base brakes (0: the last command holds).

    ``law`` says how a command becomes motion. ``motors``: within the accelerations, by motors
    that push with at most ``max_force`` [N] and ``max_torque`` [N m]. ``imposed``: the base has
    the commanded velocity from the next step on, as Gazebo's planar-move plugin does it; only
    what it runs into takes velocity away. Accelerations and efforts are infinite then, and so is
    a speed without limit. ``friction_loss`` [m/s] is taken from the speed along either axis of
    the world, ``turning_loss`` [rad/s] from that of turning: what friction on the ground leaves
    of a velocity that is imposed once a step.
    """

    kind: Literal["omnidirectional", "differential"]
    max_vx: float
    max_vy: float
    max_wz: float
    max_ax: float
    max_ay: float
    max_az: float
    max_force: float
    max_torque: float
    timeout: float
    law: Literal["motors", "imposed"] = "motors"
    friction_loss: float = 0.0
    turning_loss: float = 0.0

    # JSON has no word for the infinite.
    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(ser_json_inf_nan="strings")


@dataclass(frozen=True, slots=True)
class Laser:
    """A planar laser scanner on the robot.

    ``mount`` in the base frame, scan plane at height ``z``. Ray ``i`` of ``rays`` looks at
    ``angle_min + i * (angle_max - angle_min) / (rays - 1)`` (both ends included). Ranges in
    metres with Gaussian noise ``noise`` [m]; a ray is lost with probability ``dropout``.
    ``too_near`` says what a return nearer than ``range_min`` reads: ``infinite`` is -inf as in
    REP 117, ``clamped`` is ``range_min`` (after the noise), as in Gazebo.

    ``name`` tells the lasers of a robot apart; the only laser of a robot need not have one.
    Raises ``ValueError`` for a name that is none, see :data:`LASER_NAME`.
    """

    mount: Pose2
    z: float
    angle_min: float
    angle_max: float
    rays: int
    range_min: float
    range_max: float
    rate: float
    noise: float
    dropout: float
    too_near: Literal["infinite", "clamped"] = "infinite"
    # Not written where it is empty: what was specified before lasers had names stays the same.
    name: Annotated[str, Field(exclude_if=operator.not_)] = ""

    def __post_init__(self) -> None:
        fits = re.fullmatch(LASER_NAME, self.name) and len(self.name) <= LONGEST_LASER_NAME
        if self.name and not fits:
            raise ValueError(f"{self.name!r} is no name of a laser: write a-z, 0-9 and _")

    @property
    def topic(self) -> str:
        """The usual name of the topic of its scans, relative: ``scan``, ``scan_front``."""
        return f"scan_{self.name}" if self.name else "scan"

    @property
    def frame(self) -> str:
        """The usual name of its frame: ``laser``, ``laser_front``."""
        return f"laser_{self.name}" if self.name else "laser"

    @property
    def label(self) -> str:
        """What it is called in a sentence: ``laser``, ``laser front``."""
        return f"laser {self.name}" if self.name else "laser"

    @property
    def angle_increment(self) -> float:
        """Angle between two neighbouring rays [rad]; the whole field of view for a single ray."""
        return (self.angle_max - self.angle_min) / max(1, self.rays - 1)


@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """Wheel odometry: when it is sampled, in which frame, and its error per update.

    Errors are standard deviations that grow with motion: ``translation`` [m per sqrt(m)],
    ``rotation`` [rad per sqrt(rad)], ``drift`` [rad per sqrt(m)]: turning error caused by driving
    straight. All 0: odometry equals ground truth.

    ``rate`` in Hz; samples are of the simulator's ticks. With ``period`` [s] above 0 (``rate`` is
    its inverse) sample k is of the instant k * ``period``, between ticks if need be, and handed
    over at the first tick not before it.
    ``twist``: ``instantaneous``, or the ``mean`` since the previous sample, the difference of
    the two poses over the time between them, in the later one's frame. ``origin`` of the odom
    frame: where the robot starts, or that of the map.
    """

    rate: float
    translation: float
    rotation: float
    drift: float
    period: float = 0.0
    twist: Literal["instantaneous", "mean"] = "instantaneous"
    origin: Literal["start", "map"] = "start"


@dataclass(frozen=True, slots=True)
class Robot:
    """A mobile base seen from above; ``footprint`` is a convex ring in the base frame.

    ``laser`` is the first of its ``lasers``: maps are drawn at its height. Raises ``ValueError``
    when several lasers are not told apart by their names.
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
        """All lasers, in the order in which they are written and take their scans."""
        return (self.laser, *self.other_lasers)
