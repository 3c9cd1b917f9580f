"""Motion of the particles by odometry, and its noise (amcl ``AMCLOdom::UpdateAction``).

Models after Thrun, Burgard and Fox, Probabilistic Robotics, section 5.4 (``diff``), and the omni
model of amcl. N(s) below is zero-mean noise of standard deviation s, drawn for each particle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from daemon.model.kernels import kernel
from daemon.stacks.ros1.amcl._parameters import AmclParameters
from daemon.stacks.ros1.amcl.resampling import Particles
from grammars.model.geometry import Floats, Pose2, wrap_angle

_TURN_ON_THE_SPOT = 0.01
"""Least translation with a meaningful direction [m] (diff)."""


@dataclass(frozen=True, slots=True)
class OdometryMotion:
    """Motion by odometry since the last update: a translation at ``bearing`` [rad] and a turn.

    ``bearing`` is relative to the heading before the motion.
    """

    translation: float
    bearing: float
    turn: float


def motion_between(before: Pose2, after: Pose2) -> OdometryMotion:
    """Return the motion between two odometry poses."""
    dx, dy = after.x - before.x, after.y - before.y
    turn = wrap_angle(after.yaw - before.yaw)
    return OdometryMotion(math.hypot(dx, dy), wrap_angle(math.atan2(dy, dx) - before.yaw), turn)


def omni_spread(parameters: AmclParameters, motion: OdometryMotion) -> tuple[float, float, float]:
    """Return the standard deviations of translation, rotation and strafing [m, rad, m]."""
    p, trans, rot = parameters, motion.translation**2, motion.turn**2
    return _deviations(
        p,
        p.odom_alpha3 * trans + p.odom_alpha4 * rot,
        p.odom_alpha1 * rot + p.odom_alpha2 * trans,
        p.odom_alpha4 * rot + p.odom_alpha5 * trans,
    )


def diff_turns(motion: OdometryMotion) -> tuple[float, float]:
    """Return the turns before and after the translation [rad]."""
    first = 0.0 if motion.translation < _TURN_ON_THE_SPOT else motion.bearing
    return first, wrap_angle(motion.turn - first)


def diff_spread(parameters: AmclParameters, motion: OdometryMotion) -> tuple[float, float, float]:
    """Return the standard deviations of first turn, translation and second turn [rad, m, rad].

    Driving backwards is not a turn by pi: forwards and backwards have the same spread.
    """
    p, trans = parameters, motion.translation**2
    first, second = (
        min(abs(turn), abs(wrap_angle(turn - math.pi))) ** 2 for turn in diff_turns(motion)
    )
    return _deviations(
        p,
        p.odom_alpha1 * first + p.odom_alpha2 * trans,
        p.odom_alpha3 * trans + p.odom_alpha4 * (first + second),
        p.odom_alpha1 * second + p.odom_alpha2 * trans,
    )


def _deviations(
    parameters: AmclParameters, a: float, b: float, c: float
) -> tuple[float, float, float]:
    if parameters.odom_model_type.endswith("-corrected"):
        return math.sqrt(a), math.sqrt(b), math.sqrt(c)
    return a, b, c


def move_particles(
    parameters: AmclParameters,
    motion: OdometryMotion,
    cloud: Particles,
    count: int,
    normals: Floats,
    *,
    full_turns: bool = True,
) -> None:
    """Move the first ``count`` particles of ``cloud`` by ``motion``, each with its noise.

    ``normals`` (3 count,) are standard normal deviates. With ``full_turns`` driving backwards may
    add full turns to headings, as in the original (diff).
    """
    if parameters.odom_model_type.startswith("omni"):
        omni = motion.translation, motion.bearing, motion.turn
        _move_omni(cloud, count, normals, omni, omni_spread(parameters, motion))
    else:
        first, second = diff_turns(motion)
        diff = first, motion.translation, second
        _move_diff(cloud, count, normals, diff, diff_spread(parameters, motion), full_turns)


# Unlike grammars.model.geometry.wrap_angle, this one rounds, because machine code has no exact
# remainder. It changes the last bits of most angles, so traces depend on the choice.
@kernel
def wrap_angle_modulo(angle: float) -> float:
    """Map an angle [rad] to [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@kernel
def _move_omni(
    cloud: Particles,
    count: int,
    normals: Floats,
    motion: tuple[float, float, float],
    spread: tuple[float, float, float],
) -> None:
    """``t = translation + N, r = turn + N, s = N``; move t along and s across the bearing."""
    poses, directions = cloud.poses, cloud.directions
    translation, bearing, turn = motion
    translation_sigma, turn_sigma, strafe_sigma = spread
    cb, sb = math.cos(bearing), math.sin(bearing)
    for i in range(count):
        c = cb * directions[0, i] - sb * directions[1, i]
        s = sb * directions[0, i] + cb * directions[1, i]
        along = translation + translation_sigma * normals[i]
        across = strafe_sigma * normals[2 * count + i]
        yaw = poses[2, i] + (turn + turn_sigma * normals[count + i])
        poses[0, i] += along * c + across * s
        poses[1, i] += along * s - across * c
        poses[2, i] = yaw
        directions[0, i] = math.cos(yaw)
        directions[1, i] = math.sin(yaw)


@kernel
def _move_diff(
    cloud: Particles,
    count: int,
    normals: Floats,
    motion: tuple[float, float, float],
    spread: tuple[float, float, float],
    full_turns: bool,
) -> None:
    """Turn by ``first - N``, drive ``translation - N``, turn by ``second - N``.

    The turns are wrapped. With ``full_turns`` their sum is not: after driving backwards, which is
    two half turns, some headings are a full turn from others and fall into other bins.
    """
    poses, directions = cloud.poses, cloud.directions
    first, translation, second = motion
    first_sigma, translation_sigma, second_sigma = spread
    for i in range(count):
        before = wrap_angle_modulo(first - first_sigma * normals[i])
        along = translation - translation_sigma * normals[count + i]
        after = wrap_angle_modulo(second - second_sigma * normals[2 * count + i])
        heading = poses[2, i] + before
        turn = before + after if full_turns else wrap_angle_modulo(before + after)
        yaw = poses[2, i] + turn
        poses[0, i] += along * math.cos(heading)
        poses[1, i] += along * math.sin(heading)
        poses[2, i] = yaw
        directions[0, i] = math.cos(yaw)
        directions[1, i] = math.sin(yaw)
