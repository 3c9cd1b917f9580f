"""The controller: follows a global plan by trying velocities."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from daemon.navigation.ros.dwa._check import LastCycle
from daemon.navigation.ros.dwa._decide import Room, cost_of, decide
from daemon.navigation.ros.dwa._distances import passable_cells
from daemon.navigation.ros.dwa._oscillation import Oscillation
from daemon.navigation.ros.dwa._parameters import DwaParameters
from daemon.navigation.ros.dwa._plan import near
from daemon.navigation.ros.dwa._rooms import build_field, build_room
from daemon.navigation.ros.dwa._score import Field
from daemon.navigation.ros.dwa._settings import Settings, longest, settings_of, sim_period
from daemon.navigation.ros.dwa._stop_rotate import StopRotate
from daemon.navigation.ros.grids import CostGrid
from daemon.navigation.ros.quirks import Quirks
from grammars.values import Floats, Pose2, Twist2, wrap_angle

NOWHERE: Final[Floats] = np.empty((0, 2))
_PRUNED_BEYOND: Final = 1.0
"""[m] What ``prune_plan`` forgets lies further away than this."""


@dataclass(frozen=True, slots=True, eq=False)
class DwaAnswer:
    """What one control cycle found.

    ``twist`` is zero unless ``ok``. ``local_plan`` has shape (points, 2): x, y in odom of the
    trajectory it belongs to, without points when the robot stops or turns at the goal.
    """

    ok: bool
    twist: Twist2
    local_plan: Floats


REFUSED: Final = DwaAnswer(False, Twist2(), NOWHERE)


class Dwa:
    """dwa_local_planner ``DWAPlannerROS`` of ROS Noetic.

    ``footprint`` is the padded outline, shape (corners, 2) [m]; ``control_period_default`` [s]
    that of move_base, for a configuration without ``controller_frequency`` of its own.
    ``latch_goal`` is ``latch_xy_goal_tolerance``, which the original reads in the namespace of
    move_base.
    """

    def __init__(
        self,
        parameters: DwaParameters,
        quirks: Quirks,
        footprint: Floats,
        control_period_default: float,
        *,
        latch_goal: bool = False,
    ) -> None:
        self._p, self._quirks = parameters, quirks
        self._outline = np.ascontiguousarray(footprint, dtype=np.float64)
        self._period_default = control_period_default
        self._oscillation = Oscillation(
            parameters.oscillation_reset_dist, parameters.oscillation_reset_angle
        )
        self._stop_rotate = StopRotate(
            parameters,
            sim_period(parameters, control_period_default),
            latch=latch_goal,
            raise_to_minimum=quirks.rotation_raised_to_minimum,
        )
        self._plan: Floats = np.empty((0, 3))
        self._start = 0
        self._window: Floats = np.empty((0, 2))
        self._front_end = np.zeros(2)
        self._state = np.zeros(6)
        self._settings: Settings | None = None
        self._seen: int | None = None
        self._last: LastCycle | None = None
        self._field: Field
        self._room: Room
        self._aligned = False

    def set_plan(self, plan: Floats) -> None:
        """Follow ``plan``, shape (poses, 3): x, y, yaw in the map frame, the goal last."""
        self._plan = np.ascontiguousarray(plan, dtype=np.float64)
        self._start = 0
        if self._window.shape[0] < plan.shape[0]:
            self._window = np.empty((plan.shape[0], 2))
        self._stop_rotate.reset_latch()
        if self._quirks.plans_reset_oscillation:
            self._oscillation.reset()

    def goal_reached(self, pose: Pose2, twist: Twist2, map_to_odom: Pose2) -> bool:
        """Whether the robot stands at the end of the plan; ``pose`` is in odom."""
        if self._start >= len(self._plan):
            return False
        return self._stop_rotate.goal_reached(pose, twist, self._goal(map_to_odom.inverse()))

    def command(self, pose: Pose2, twist: Twist2, map_to_odom: Pose2, local: CostGrid) -> DwaAnswer:
        """Return the next velocity; ``pose`` and ``local`` are in odom.

        ``map_to_odom`` is the pose of odom in the map. Not ok without a plan near the robot, or
        when every velocity is illegal (``DWAPlannerROS::computeVelocityCommands``).
        """
        settings = self._prepare(local)
        odom_to_map = map_to_odom.inverse()
        window = self._near(pose, map_to_odom, odom_to_map, local)
        if len(window) == 0:
            return REFUSED
        twist = Twist2(twist.vx, twist.vy, wrap_angle(twist.wz))
        self._take_state(pose, twist, settings, local)
        self._aim(window, settings)
        goal = self._goal(odom_to_map)
        if self._stop_rotate.position_reached(pose, goal):
            turn = self._stop_rotate.command(pose, twist, goal, self._is_legal)
            return REFUSED if turn is None else DwaAnswer(True, turn, NOWHERE)
        return self._sample(window, pose, settings)

    def _goal(self, odom_to_map: Pose2) -> Pose2:
        x, y, yaw = self._plan[-1].tolist()
        return odom_to_map @ Pose2(x, y, yaw)

    def _prepare(self, local: CostGrid) -> Settings:
        """Make room for the costmap when it has another shape, and note what is passable."""
        settings = self._settings
        if settings is None or self._field.cells.shape != local.cells.shape:
            settings = settings_of(self._p, self._quirks, local.resolution, self._period_default)
            self._settings = settings
            self._field = build_field(local, self._outline, self._oscillation.banned)
            self._room = build_room(local.cells.shape, settings, longest(settings, 0.0, 0.0, 0.0))
            self._last, self._seen = None, None
        elif self._field.cells is not local.cells:
            self._field, self._seen = self._field._replace(cells=local.cells), None
        if local.version != self._seen:
            passable_cells(local.cells, self._room.passable)
            self._seen = local.version
        frame = self._field.frame
        frame[0], frame[1], frame[2] = local.x, local.y, local.resolution
        return settings

    def _near(self, pose: Pose2, map_to_odom: Pose2, odom_to_map: Pose2, local: CostGrid) -> Floats:
        if self._start >= len(self._plan):
            return NOWHERE
        o, here = odom_to_map, map_to_odom.apply((pose.x, pose.y))
        transform = np.array((o.x, o.y, math.cos(o.yaw), math.sin(o.yaw)))
        reach = max(local.cells.shape) * local.resolution / 2.0
        robot = np.array(here)
        n = near(self._plan, self._start, transform, robot, reach, self._window)
        window = self._window[:n]
        return self._pruned(window, pose) if self._p.prune_plan else window

    def _pruned(self, window: Floats, pose: Pose2) -> Floats:
        """Forget as many poses of the plan as the window has before it comes near the robot."""
        square = (window[:, 0] - pose.x) ** 2 + (window[:, 1] - pose.y) ** 2
        kept = np.flatnonzero(square < _PRUNED_BEYOND**2)
        gone = int(kept[0]) if kept.size else len(window)
        self._start += gone
        return window[gone:]

    def _take_state(self, pose: Pose2, twist: Twist2, settings: Settings, local: CostGrid) -> None:
        row = (pose.x, pose.y, pose.yaw, twist.vx, twist.vy, twist.wz)
        self._state[:] = np.array(row, dtype=np.float32)
        needed = longest(settings, twist.vx, twist.vy, twist.wz)
        if needed > len(self._room.points):
            passable = self._room.passable
            self._room = build_room(local.cells.shape, settings, needed)
            self._room.passable[:] = passable

    def _aim(self, window: Floats, settings: Settings) -> None:
        """Push the end of the window ahead and see whether the nose counts."""
        x, y = window[-1].tolist()
        at_x, at_y = self._state[:2].tolist()
        forward = self._p.forward_point_distance
        angle = math.atan2(y - at_y, x - at_x)
        self._front_end[:] = x + forward * math.cos(angle), y + forward * math.sin(angle)
        square = (at_x - x) * (at_x - x) + (at_y - y) * (at_y - y)
        far = square > forward * forward * self._p.cheat_factor
        self._aligned = far and settings.path_scale != 0.0

    def _sample(self, window: Floats, pose: Pose2, settings: Settings) -> DwaAnswer:
        field, room = self._field, self._room
        n = decide(
            self._state, window, len(window), self._front_end, self._aligned, settings, field, room
        )
        self._last = LastCycle(window, field)
        if n == 0:
            return REFUSED
        vx, vy, wz = room.answer[:3].tolist()
        twist = Twist2(vx, vy, wrap_angle(wz))
        here = Pose2(*self._state[:3].tolist())
        self._oscillation.chosen(here, Twist2(vx, vy, wz), self._p.min_vel_trans)
        return DwaAnswer(True, twist, room.points[:n, :2].copy())

    def _is_legal(self, twist: Twist2) -> bool:
        """Whether a trajectory is legal now, by the distances of the last sampling cycle."""
        self._oscillation.reset()
        settings, room = self._settings, self._room
        assert settings is not None
        sample = np.array((twist.vx, twist.vy, twist.wz), dtype=np.float32).astype(np.float64)
        field = self._field if self._last is None else self._last.complete(self._field, room)
        return bool(cost_of(self._state, sample, self._aligned, settings, field, room) >= 0.0)
