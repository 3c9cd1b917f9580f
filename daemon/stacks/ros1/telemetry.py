"""What of the stack's inside goes into the trace, and how often.

* Every pose that AMCL publishes, stamped as the scan it is from, with the summary of the particles
  at that instant; in between, once a second, where the stack takes the robot to be (map <- odom of
  AMCL, odom <- base of the wheels) with the covariance last published.
* At most a hundred particles, at most once a second, evenly taken from the filter's.
* The global plan when it differs from the one recorded by more than what the robot has covered,
  at most once a second, a point every tenth of a metre counted from the goal.
* The trajectory DWA chose, five times a second.
* The local costmap at ``local_costmap/publish_frequency``, at most once a second; never with 0.
* State changes, recoveries and goals as sentences.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from daemon.model.kernels import kernel
from daemon.model.sut import Cloud, CostmapPicture, Estimate
from daemon.stacks.ros1.cost_grid import CostGrid
from grammars.model.geometry import Floats, Pose2

if TYPE_CHECKING:
    from daemon.stacks.ros1.amcl import AmclPose


@kernel
def thin_plan(plan: Floats, spacing: float, out: Floats) -> int:
    """Write points of ``plan`` (n, 3) to ``out`` (n, 2), from the goal to the start.

    Returns how many: one every ``spacing`` [m] of way from the goal, between two poses if need be,
    and the start. Two plans over the same ground so have the same points, wherever they begin.
    """
    last = plan.shape[0] - 1
    out[0, 0], out[0, 1] = plan[last, 0], plan[last, 1]
    count, way = 1, 0.0
    for k in range(last - 1, -1, -1):
        dx, dy = plan[k, 0] - plan[k + 1, 0], plan[k, 1] - plan[k + 1, 1]
        length = math.hypot(dx, dy)
        while way + length >= count * spacing and count < out.shape[0] - 1:
            share = (count * spacing - way) / length
            out[count, 0] = plan[k + 1, 0] + share * dx
            out[count, 1] = plan[k + 1, 1] + share * dy
            count += 1
        way += length
    if last > 0:
        out[count, 0], out[count, 1] = plan[0, 0], plan[0, 1]
        count += 1
    return count


@kernel
def largest_deviation(first: Floats, second: Floats) -> float:
    """Return the largest distance along x or y between points of the same index, (n, 2) each."""
    most = 0.0
    for k in range(min(first.shape[0], second.shape[0])):
        dx, dy = abs(first[k, 0] - second[k, 0]), abs(first[k, 1] - second[k, 1])
        most = max(most, dx, dy)
    return most


_BELIEF_PERIOD: Final = 1.0
_PARTICLES_PERIOD: Final = 1.0
_COSTMAP_RATE: Final = 1.0
_PARTICLES: Final = 100
_PLAN_PERIOD: Final = 1.0
_LOCAL_PLAN_PERIOD: Final = 0.2
_PLAN_SPACING: Final = 0.1
"""Between the points of a recorded global plan [m]."""
_PLAN_TOLERANCE: Final = 0.1
"""A plan that stays within this of the one recorded is the same one [m]."""
_TIME_TOLERANCE: Final = 1e-9


class PlanRecorder:
    """Decides which global plans are worth recording."""

    def __init__(self) -> None:
        self._due = 0.0
        self._last = np.empty((0, 2))
        self._seen: Floats | None = None

    def take(self, now: float, plan: Floats | None) -> Floats | None:
        """Return the points (n, 2) to record of ``plan`` (n, 3), from start to goal, or ``None``.

        Points are taken from the goal backwards, so that two plans along the same way have the
        same points but for those the robot has left behind.
        """
        if plan is None or plan is self._seen or now < self._due - _TIME_TOLERANCE:
            return None
        self._seen, self._due = plan, now + _PLAN_PERIOD
        room = np.empty((len(plan) + 1, 2))
        thin = room[: thin_plan(plan, _PLAN_SPACING, room)]
        # Its last point is the start, wherever that lies.
        longer = len(thin) > len(self._last)
        if not longer and largest_deviation(thin[:-1], self._last) <= _PLAN_TOLERANCE:
            return None
        self._last = thin
        return np.ascontiguousarray(thin[::-1])


class LocalPlanRecorder:
    """Brings the trajectories of DWA into the map frame, a few times a second."""

    def __init__(self) -> None:
        self._due = 0.0

    def take(self, now: float, points: Floats | None, map_to_odom: Pose2) -> Floats | None:
        """Return ``points`` (n, 2) of the odom frame in map when it is time to, or ``None``."""
        if points is None or len(points) == 0 or now < self._due - _TIME_TOLERANCE:
            return None
        self._due = now + _LOCAL_PLAN_PERIOD
        c, s = math.cos(map_to_odom.yaw), math.sin(map_to_odom.yaw)
        moved: Floats = points @ np.array(((c, s), (-s, c)))
        moved += (map_to_odom.x, map_to_odom.y)
        return moved


class CostmapRecorder:
    """Pictures of the local costmap, ``rate`` [Hz] of them, at most one a second; none with 0."""

    def __init__(self, rate: float) -> None:
        self._period = 1.0 / min(rate, _COSTMAP_RATE) if rate > 0.0 else math.inf
        self._due = 0.0 if rate > 0.0 else math.inf

    def take(self, now: float, grid: CostGrid) -> CostmapPicture | None:
        """Return a copy of ``grid`` when it is time to, or ``None``."""
        if now < self._due - _TIME_TOLERANCE:
            return None
        self._due = now + self._period
        return CostmapPicture(now, "odom", grid.resolution, grid.x, grid.y, grid.cells.copy())


class EstimateRecorder:
    """Estimates and particles for the trace; ``covariance`` (3, 3) is that of the start."""

    def __init__(self, covariance: Floats) -> None:
        self._covariance = covariance
        self._belief_due = self._particles_due = 0.0

    def published(self, found: AmclPose) -> tuple[Estimate, Cloud]:
        """Return what AMCL has just published, for the trace."""
        self._covariance = found.covariance
        self._belief_due = found.time + _BELIEF_PERIOD
        estimate = Estimate(found.time, found.pose, found.covariance)
        return estimate, Cloud(found.time, found.count, found.mean, found.covariance)

    def believed(self, time: float, odom: Pose2, base: Pose2) -> Estimate | None:
        """Return where the stack takes the robot to be, when nobody has said so for a while.

        ``odom`` is the latest pose of odom in map, ``base`` that of the base in odom.
        """
        if time < self._belief_due - _TIME_TOLERANCE:
            return None
        self._belief_due = time + _BELIEF_PERIOD
        return Estimate(time, odom @ base, self._covariance)

    def particles(self, now: float, poses: Floats) -> Floats | None:
        """Return at most a hundred of ``poses`` (n, 3) when it is time to, or ``None``."""
        if now < self._particles_due - _TIME_TOLERANCE:
            return None
        self._particles_due = now + _PARTICLES_PERIOD
        return poses[:: math.ceil(len(poses) / _PARTICLES)].copy()
