"""Record of the stack's internal state for the trace.

* Every pose that AMCL publishes, with the stamp of its scan and the summary of the particles. In
  between, once a second, the stack's estimate (map <- odom of AMCL, odom <- base of the wheels)
  with the covariance last published.
* At most a hundred particles, at most once a second, evenly taken from the filter's.
* The global plan when it differs from the recorded one by more than the way already covered, at
  most once a second. It has a point every tenth of a metre, counted from the goal.
* The trajectory that DWA chose, five times a second.
* The local costmap at ``local_costmap/publish_frequency``, at most once a second; never with 0.
* State changes, recoveries and goals as sentences.
"""

from __future__ import annotations

import math
from typing import Final, Literal

import numpy as np

from daemon.model.sut import Cloud, CostmapPicture, Estimate
from daemon.stacks.ros1.amcl.node import AmclPose
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.timers import MinimumInterval
from grammars.model.geometry import Floats, Pose2


def thin_plan(plan: Floats, spacing: float) -> Floats:
    """Return points (m, 2) of ``plan`` (n, 3), from the goal to the start.

    There is one every ``spacing`` [m] of way from the goal, interpolated between poses, and the
    start. Two plans over the same ground therefore have the same points, wherever they begin.
    """
    points = plan[::-1, :2]
    steps = np.diff(points, axis=0)
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    way = np.concatenate(((0.0,), np.cumsum(lengths)))
    marks = np.arange(1, len(points)) * spacing
    marks = marks[marks <= way[-1]]
    step = np.searchsorted(way, marks) - 1
    shares = (marks - way[step]) / lengths[step]
    between = points[step] + shares[:, None] * steps[step]
    return np.concatenate((points[:1], between, points[1:][-1:]))


_PERIOD: Final = 1.0
"""Shortest time between two records of a kind [s]."""
_LOCAL_PLAN_PERIOD: Final = 0.2
_PARTICLES: Final = 100
_PLAN_SPACING: Final = 0.1
"""Distance between the points of a recorded global plan [m]."""
_PLAN_TOLERANCE: Final = 0.1
"""Largest deviation of a plan that counts as the recorded one [m]."""


class StackRecorder:
    """Recorder of a run; each method returns what is to be recorded now, or ``None``.

    ``covariance`` (3, 3) is that of the start. The ``rate`` [Hz] is that of the local costmap, 0
    for none, and ``frame`` its frame.
    """

    def __init__(self, covariance: Floats, rate: float, frame: Literal["map", "odom"]) -> None:
        self._covariance, self._frame = covariance, frame
        self._last_plan, self._seen_plan = np.empty((0, 2)), np.empty((0, 3))
        self._plans, self._local_plans = (
            MinimumInterval(_PERIOD),
            MinimumInterval(_LOCAL_PLAN_PERIOD),
        )
        self._estimates, self._particles = MinimumInterval(_PERIOD), MinimumInterval(_PERIOD)
        period = max(_PERIOD, 1.0 / rate) if rate > 0.0 else math.inf
        self._costmaps = MinimumInterval(period, due=0.0 if rate > 0.0 else math.inf)

    def plan(
        self, now: float, plan: Floats | None, frame_in_map: Pose2 | None = None
    ) -> Floats | None:
        """Return the points (n, 2) of ``plan`` (n, 3), from start to goal.

        ``frame_in_map`` is the pose in map of the plan's frame, if that is not map. Points run
        from the goal backwards, so two plans along the same way have the same points except for
        those behind the robot.
        """
        # At most one plan a second is compared, whether it turns out to be new or not.
        if plan is None or plan is self._seen_plan or not self._plans.begin(now):
            return None
        self._seen_plan = plan
        thin = thin_plan(plan, _PLAN_SPACING)
        if frame_in_map is not None:
            thin = _placed(thin, frame_in_map)
        # The last point is the start, which moves with the robot.
        way, last = thin[:-1], self._last_plan
        if len(way) < len(last):
            deviations = np.abs(way - last[: len(way)])
            if deviations.max(initial=0.0) <= _PLAN_TOLERANCE:
                return None
        self._last_plan = thin
        return np.ascontiguousarray(thin[::-1])

    def local_plan(self, now: float, points: Floats | None, frame_in_map: Pose2) -> Floats | None:
        """Return a trajectory (n, 2) of the controller in map; its frame has a pose in map."""
        if points is None or len(points) == 0 or not self._local_plans.begin(now):
            return None
        return _placed(points, frame_in_map)

    def costmap(self, now: float, grid: CostGrid) -> CostmapPicture | None:
        """Return a copy of the local costmap."""
        if not self._costmaps.begin(now):
            return None
        return CostmapPicture(now, self._frame, grid.resolution, grid.x, grid.y, grid.cells.copy())

    def published(self, latest: AmclPose) -> tuple[Estimate, Cloud]:
        """Return the estimate AMCL has just published, and the summary of its particles."""
        self._covariance = latest.covariance
        self._estimates.restart(latest.time)
        estimate = Estimate(latest.time, latest.pose, latest.covariance)
        return estimate, Cloud(latest.time, latest.count, latest.mean, latest.covariance)

    def dead_reckoned(self, time: float, odom: Pose2, base: Pose2) -> Estimate | None:
        """Return the stack's estimate of the pose if the latest record is a second old.

        ``odom`` is the latest pose of odom in map, ``base`` that of the base in odom.
        """
        if not self._estimates.begin(time):
            return None
        return Estimate(time, odom @ base, self._covariance)

    def particles(self, now: float, poses: Floats) -> Floats | None:
        """Return at most a hundred of ``poses`` (n, 3)."""
        if not self._particles.begin(now):
            return None
        return poses[:: math.ceil(len(poses) / _PARTICLES)].copy()


def _placed(points: Floats, frame: Pose2) -> Floats:
    """Transform ``points`` (n, 2) from a frame at the pose ``frame`` into its parent frame."""
    c, s = math.cos(frame.yaw), math.sin(frame.yaw)
    moved: Floats = points @ np.array(((c, s), (-s, c)))
    moved += (frame.x, frame.y)
    return moved
