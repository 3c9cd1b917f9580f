"""Robot descriptions: footprint, drive, laser and odometry, as written in ``robots/*.yaml``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from grammars.values import Pose2, Ring


@dataclass(frozen=True, slots=True)
class Drive:
    """What the base can do: speeds [m/s, rad/s], accelerations [m/s^2, rad/s^2], effort.

    ``max_force`` [N] and ``max_torque`` [N m] bound what the drive can push with. After
    ``timeout`` seconds without a new command the base brakes (0: the last command holds).
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


@dataclass(frozen=True, slots=True)
class Laser:
    """A planar laser scanner on the robot.

    ``mount`` in the base frame, scan plane at height ``z``. Ray ``i`` of ``rays`` looks at
    ``angle_min + i * (angle_max - angle_min) / (rays - 1)`` (both ends included). Ranges in
    metres with Gaussian noise ``noise`` [m]; a ray is lost with probability ``dropout``.
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


@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """Wheel odometry error per update: standard deviations that grow with motion.

    ``translation`` [m per sqrt(m)], ``rotation`` [rad per sqrt(rad)], ``drift`` [rad per
    sqrt(m)]: turning error caused by driving straight. All 0: odometry equals ground truth.
    ``rate`` in Hz.
    """

    rate: float
    translation: float
    rotation: float
    drift: float


@dataclass(frozen=True, slots=True)
class Robot:
    """A mobile base seen from above; ``footprint`` is a convex ring in the base frame."""

    name: str
    footprint: Ring
    height: float
    mass: float
    drive: Drive
    laser: Laser
    odometry: OdometryNoise
