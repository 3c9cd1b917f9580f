"""The part of the global plan near the robot (base_local_planner ``goal_functions``)."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.ros1.base_local_planner.controller import NO_POINTS
from daemon.stacks.ros1.cost_grid import CostGrid
from grammars.model.geometry import Floats, Pose2

_PRUNED_BEYOND: Final = 1.0
"""Least distance of poses that ``prunePlan`` removes [m]."""


@kernel
def transform_plan_window(
    plan: Floats,
    start: int,
    transform: tuple[float, float, float, float],
    robot: tuple[float, float],
    base: tuple[float, float],
    reach: float,
    out: Floats,
) -> tuple[int, int, int]:
    """Write the poses of ``plan`` near the robot to ``out``; return the first index and the count.

    Skip the poses before the first one within ``reach`` [m] and stop behind the first one beyond
    it (base_local_planner ``transformGlobalPlan``). ``plan`` has rows x, y, yaw in the map frame,
    ``out`` x, y in odom. ``transform`` (x, y, cos, sin) is the map in odom. ``robot`` (x, y) is the
    robot in the map, ``base`` in odom. The third result is the number of poses in ``out`` before
    the first one near ``base`` (``prunePlan``).
    """
    limit = reach * reach
    first = start
    while first < plan.shape[0]:
        dx, dy = robot[0] - plan[first, 0], robot[1] - plan[first, 1]
        if dx * dx + dy * dy <= limit:
            break
        first += 1
    n, behind, passed = 0, 0, True
    square = 0.0
    while first + n < plan.shape[0] and square <= limit:
        x, y = plan[first + n, 0], plan[first + n, 1]
        out[n, 0] = transform[0] + transform[2] * x - transform[3] * y
        out[n, 1] = transform[1] + transform[3] * x + transform[2] * y
        dx, dy = out[n, 0] - base[0], out[n, 1] - base[1]
        passed = passed and not dx * dx + dy * dy < _PRUNED_BEYOND * _PRUNED_BEYOND
        dx, dy = robot[0] - x, robot[1] - y
        square = dx * dx + dy * dy
        n += 1
        behind += passed
    return first, n, behind


class FollowedPlan:
    """Global plan of a controller, and the part of it near the robot."""

    def __init__(self) -> None:
        self._poses: Floats = np.empty((0, 3))
        self._room: Floats = np.empty((0, 2))
        self._start = 0
        self._end = 0
        self._goal: Pose2 | None = None
        # The pose of odom in map behind the next two values; AMCL changes it.
        self._map_to_odom: Pose2 | None = None
        self._odom_to_map = Pose2()
        self._transform = (0.0, 0.0, 1.0, 0.0)

    def take(self, plan: Floats) -> None:
        """Follow ``plan``, shape (poses, 3): x, y, yaw in the map frame, the goal last."""
        self._poses = np.ascontiguousarray(plan, dtype=np.float64)
        self._start = 0
        self._goal = None
        if self._room.shape[0] < plan.shape[0]:
            self._room = np.empty((plan.shape[0], 2))

    @property
    def is_over(self) -> bool:
        """True if the plan has no remaining poses."""
        return self._start >= len(self._poses)

    def goal(self, map_to_odom: Pose2) -> Pose2:
        """Return the last pose of the plan in odom; ``map_to_odom`` is the pose of odom in map."""
        self._look_from(map_to_odom)
        if self._goal is None:
            self._goal = self._in_odom(len(self._poses))
        return self._goal

    def window_end(self, map_to_odom: Pose2) -> Pose2:
        """Return the last pose of the latest window in odom."""
        self._look_from(map_to_odom)
        return self._in_odom(self._end)

    def _look_from(self, map_to_odom: Pose2) -> None:
        """Set the transform and invert it once."""
        if map_to_odom is self._map_to_odom:
            return
        self._map_to_odom, self._goal = map_to_odom, None
        self._odom_to_map = o = map_to_odom.inverse()
        self._transform = (o.x, o.y, math.cos(o.yaw), math.sin(o.yaw))

    def _in_odom(self, end: int) -> Pose2:
        x, y, yaw = self._poses[end - 1].tolist()
        return self._odom_to_map @ Pose2(x, y, yaw)

    def window(self, pose: Pose2, map_to_odom: Pose2, local: CostGrid, *, prune: bool) -> Floats:
        """Return the poses of the plan near ``pose``, shape (poses, 2): x, y in odom.

        Near is within half the longer side of ``local``. The next call overwrites the result. With
        ``prune`` the poses behind the robot are removed for good.
        """
        if self.is_over:
            return NO_POINTS
        self._look_from(map_to_odom)
        here = (pose.x, pose.y)
        reach = max(local.cells.shape) * local.resolution / 2.0
        first, n, behind = transform_plan_window(
            self._poses, self._start, self._transform, map_to_odom.apply(here), here, reach,
            self._room,
        )  # fmt: skip
        self._end = first + n
        if not prune:
            return self._room[:n]
        # Remove as many poses from the start of the plan as the window has before it comes near.
        self._start += behind
        return self._room[behind:n]
