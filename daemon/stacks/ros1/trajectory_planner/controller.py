"""Controller that follows a global plan by trying arcs, turns on the spot and ways out.

Its state besides the search: turns and strafes that oscillation forbids, whether the robot is
backing out of a dead end, and the phase within tolerance of the goal.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from daemon.model.kernels import machine_code
from daemon.stacks.kernels import Integers
from daemon.stacks.ros1.base_local_planner.controller import (
    NO_POINTS,
    NO_VELOCITY,
    ControllerAnswer,
    sim_period,
    slow_down,
    turn_towards,
)
from daemon.stacks.ros1.base_local_planner.followed_plan import FollowedPlan
from daemon.stacks.ros1.base_local_planner.map_grid import passable_cells
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.quirks import Quirks
from daemon.stacks.ros1.trajectory_planner._parameters import (
    TrajectoryPlannerParameters,
    in_range,
    slowest_turn_at_goal,
    strafe_speeds,
)
from daemon.stacks.ros1.trajectory_planner._rollout import (
    COLLIDES,
    LEADS_NOWHERE,
    LEGAL,
    RolloutGrid,
    RolloutSettings,
    longest_trajectory,
    normalize_angle,
    score_trajectory,
    settings_of,
    simulate_trajectory,
)
from daemon.stacks.ros1.trajectory_planner._search import (
    NO_BEST,
    NO_LEFT_STRAFE,
    NO_LEFT_TURN,
    NO_RIGHT_STRAFE,
    NO_RIGHT_TURN,
    RolloutBuffers,
    allocate_buffers,
    allocate_grid,
    fill_distances,
    find_best,
    find_best_arc,
)
from grammars.model.geometry import Floats, Pose2, Twist2, wrap_angle

_STOPPED: Final = 1e-2
"""[m/s] and [rad/s] The robot stands below this (``rot_stopped_velocity_``)."""


def _length(x: float, y: float) -> float:
    """Return the length of a vector, rounded as in C; Python's own hypot rounds differently."""
    return float(np.hypot(x, y))


class OscillationFlags:
    """Turns and strafes that are forbidden until the robot has moved ``distance`` [m].

    ``forbidden`` (4,) holds the flags for :mod:`._search`. The second turn in a row to one side
    forbids turns to the other; a strafe forbids strafing back to the previous side.
    """

    def __init__(self, distance: float) -> None:
        self.forbidden: Integers = np.zeros(4, dtype=np.int32)
        self._turned_left = self._turned_right = False
        self._strafed_left = self._strafed_right = False
        self._distance = distance
        self._at = (0.0, 0.0)

    def record(self, at: tuple[float, float], vx: float, vy: float, wz: float) -> None:
        """Record the velocity chosen at ``at``; driving ahead is not an oscillation."""
        if not vx > 0.0:
            if wz != 0.0:
                self._turn(wz)
            elif vy != 0.0:
                self._strafe(vy)
            self._at = at
        self.release(at)

    def release(self, at: tuple[float, float]) -> None:
        """Release all directions if the robot has moved far enough."""
        if _length(at[0] - self._at[0], at[1] - self._at[1]) <= self._distance:
            return
        self.forbidden[:] = 0
        self._turned_left = self._turned_right = False
        self._strafed_left = self._strafed_right = False

    def _turn(self, wz: float) -> None:
        if wz < 0.0:
            self.forbidden[NO_LEFT_TURN] |= self._turned_right
            self._turned_right = True
        else:
            self.forbidden[NO_RIGHT_TURN] |= self._turned_left
            self._turned_left = True

    def _strafe(self, vy: float) -> None:
        if vy > 0.0:
            self.forbidden[NO_RIGHT_STRAFE] |= self._strafed_right
            self._strafed_left = True
        else:
            self.forbidden[NO_LEFT_STRAFE] |= self._strafed_left
            self._strafed_right = True


class EscapeMode:
    """State of backing out of a place where no motion was legal.

    It is ``active`` until the robot is ``distance`` [m] or ``angle`` [rad] from its beginning.
    """

    def __init__(self, distance: float, angle: float) -> None:
        self.active = False
        self._distance, self._angle = distance, angle
        self._x = self._y = self._yaw = 0.0

    def begin(self, state: Floats) -> None:
        """Begin at the pose in ``state``, unless active."""
        if not self.active:
            self._x, self._y, self._yaw = state[:3].tolist()
            self.active = True

    def release(self, state: Floats) -> None:
        """End if the robot is far enough from the beginning."""
        x, y, yaw = state[:3].tolist()
        turned = abs(normalize_angle(yaw - self._yaw))
        if _length(x - self._x, y - self._y) > self._distance or turned > self._angle:
            self.active = False


class TrajectoryPlanner:
    """base_local_planner ``TrajectoryPlannerROS`` of ROS Noetic.

    ``footprint`` is the padded outline, shape (corners, 2) [m]. ``control_period_default`` [s] is
    that of move_base, for a configuration without its own ``controller_frequency``.
    """

    def __init__(
        self,
        parameters: TrajectoryPlannerParameters,
        quirks: Quirks,
        footprint: Floats,
        control_period_default: float,
    ) -> None:
        self._p, self._quirks = parameters, quirks
        self._outline = np.ascontiguousarray(footprint, dtype=np.float64)
        self._period = sim_period(parameters.controller_frequency, control_period_default)
        self._strafes: Floats = np.array(strafe_speeds(parameters))
        self._flags = OscillationFlags(in_range(parameters, "oscillation_reset_dist"))
        self._escape = EscapeMode(
            in_range(parameters, "escape_reset_dist"), in_range(parameters, "escape_reset_theta")
        )
        self._plan = FollowedPlan()
        self._latched = False
        self._rotating = False
        self._reached = False
        self._state = np.zeros(6)
        self._settings: RolloutSettings | None = None
        self._seen: int | None = None
        self._grid: RolloutGrid
        self._room: RolloutBuffers
        # Load it now, so that the process that prepares the first run compiles it.
        self._machine = self._load_machine_code()

    def _load_machine_code(self) -> tuple[Callable[..., Any], ...]:
        """Return the three kernels of a search, for a costmap of any shape."""
        grid = CostGrid(0.05, 0.0, 0.0, np.zeros((1, 1), dtype=np.uint8))
        s = settings_of(self._p, self._quirks, grid.resolution, self._period)
        field, room = allocate_grid(grid, s, self._outline), allocate_buffers((1, 1), s, 1)
        state, window, strafes = self._state, np.zeros((1, 2)), self._strafes
        forbidden = self._flags.forbidden
        return (
            machine_code(fill_distances, state, window, 0.0, strafes, s, field, room),
            machine_code(find_best_arc, state, window, s, field, room),
            machine_code(find_best, state, window, forbidden, strafes, s, field, room),
        )

    def set_plan(self, plan: Floats) -> None:
        """Follow ``plan``, shape (poses, 3): x, y, yaw in the map frame, the goal last."""
        self._plan.take(plan)
        self._latched = False
        self._reached = False

    def goal_reached(self, pose: Pose2, twist: Twist2, map_to_odom: Pose2) -> bool:
        """Tell whether the latest command was to stand at the goal (``isGoalReached``).

        The present pose and twist do not matter.
        """
        del pose, twist, map_to_odom
        return self._reached

    def command(
        self, pose: Pose2, twist: Twist2, map_to_odom: Pose2, local: CostGrid
    ) -> ControllerAnswer:
        """Return the next velocity; ``pose`` and ``local`` are in odom.

        ``map_to_odom`` is the pose of odom in the map. The answer is not ok without a plan near the
        robot, or if no motion is legal and backing up leads nowhere
        (``TrajectoryPlannerROS::computeVelocityCommands``).
        """
        window = self._plan.window(pose, map_to_odom, local, prune=self._p.prune_plan)
        if len(window) == 0:
            return NO_VELOCITY
        # The original keeps velocities in poses, whose "yaw" comes back normalised.
        moving = Twist2(twist.vx, twist.vy, wrap_angle(twist.wz))
        x, y = window[-1].tolist()
        near = _length(x - pose.x, y - pose.y) <= self._p.xy_goal_tolerance
        if not (self._latched or near):
            return self._search(window, pose, moving, local)
        self._latched = self._latched or self._p.latch_xy_goal_tolerance
        # The goal of this controller is the end of the window, not of the plan.
        error = normalize_angle(self._plan.window_end(map_to_odom).yaw - pose.yaw)
        if abs(error) <= self._p.yaw_goal_tolerance:
            self._rotating = self._latched = False
            self._reached = True
            return ControllerAnswer(True, Twist2(), NO_POINTS)
        # The result is not driven, but the search updates distances and state.
        self._search(window, pose, moving, local)
        fastest = max(abs(twist.vx), abs(twist.vy), abs(twist.wz))
        self._rotating = self._rotating or fastest <= _STOPPED
        sample = self._turn(error, moving.wz) if self._rotating else self._brake(moving)
        if not self._is_legal(pose, moving, sample, window):
            return NO_VELOCITY
        return ControllerAnswer(True, sample, NO_POINTS)

    def _search(
        self, window: Floats, pose: Pose2, twist: Twist2, local: CostGrid
    ) -> ControllerAnswer:
        """Choose a trajectory (``TrajectoryPlanner::findBestPath``)."""
        s = self._prepare(local, twist)
        row = (pose.x, pose.y, pose.yaw, twist.vx, twist.vy, twist.wz)
        state, grid, room, strafes = self._state, self._grid, self._room, self._strafes
        state[:] = np.array(row, dtype=np.float32)
        x, y, _, _, _, _ = state.tolist()
        at = (x, y)
        end_x, end_y = window[-1].tolist()
        fill, find_arc, find = self._machine
        fill(state, window, _length(end_x - x, end_y - y), strafes, s, grid, room)
        room.best[:] = NO_BEST
        # A robot that escapes drives no arcs.
        if not self._escape.active:
            find_arc(state, window, s, grid, room)
        n = find(state, window, self._flags.forbidden, strafes, s, grid, room)
        if n == 0:
            return self._back_up(window, s)
        vx, vy, wz = room.best[:3].tolist()
        self._flags.record(at, vx, vy, wz)
        self._escape.release(state)
        return ControllerAnswer(True, Twist2(vx, vy, wrap_angle(wz)), room.points[:n, :2].copy())

    def _back_up(self, window: Floats, s: RolloutSettings) -> ControllerAnswer:
        """Back up although no motion is legal, unless the plan leads nowhere."""
        state, grid, room = self._state, self._grid, self._room
        n = simulate_trajectory(state, s.escape_vel, 0.0, 0.0, s, room.points)
        cost = score_trajectory(room.points, n, window, math.inf, s, grid, room.terms)
        x, y = state[:2].tolist()
        self._flags.release((x, y))
        if cost > LEADS_NOWHERE:
            self._escape.begin(state)
        self._escape.release(state)
        if cost < COLLIDES:
            return NO_VELOCITY
        way = room.points[: int(room.terms[LEGAL]), :2].copy()
        return ControllerAnswer(True, Twist2(s.escape_vel, 0.0, 0.0), way)

    def _prepare(self, local: CostGrid, twist: Twist2) -> RolloutSettings:
        """Allocate buffers for a costmap of a new shape, and update its passable cells."""
        settings = self._settings
        if settings is None or self._grid.cells.shape != local.cells.shape:
            settings = settings_of(self._p, self._quirks, local.resolution, self._period)
            self._settings = settings
            self._grid = allocate_grid(local, settings, self._outline)
            self._room = allocate_buffers(local.cells.shape, settings, 0)
            self._seen = None
        elif self._grid.cells is not local.cells:
            self._grid, self._seen = self._grid._replace(cells=local.cells), None
        if local.version != self._seen:
            passable_cells(local.cells, self._room.passable)
            self._seen = local.version
        longest = longest_trajectory(self._p, settings, (twist.vx, twist.vy, twist.wz))
        if longest > len(self._room.points):
            self._room = self._room._replace(points=np.zeros((longest, 5)))
        frame = self._grid.frame
        frame[0], frame[1], frame[2] = local.x, local.y, local.resolution
        return settings

    def _brake(self, twist: Twist2) -> Twist2:
        """Stop within the limits of acceleration."""
        p = self._p
        return slow_down(twist, (p.acc_lim_x, p.acc_lim_y, p.acc_lim_theta), self._period)

    def _turn(self, error: float, wz: float) -> Twist2:
        """Turn to the goal's heading on the spot."""
        p = self._p
        fastest = float(p.max_rotational_vel)
        if not self._quirks.goal_turn_has_own_limit:
            fastest = abs(in_range(p, "max_vel_theta" if error > 0.0 else "min_vel_theta"))
        speeds, raised = (slowest_turn_at_goal(p), fastest), self._quirks.rotation_raised_to_minimum
        return turn_towards(error, wz, speeds, p.acc_lim_theta, self._period, raised=raised)

    def _is_legal(self, pose: Pose2, twist: Twist2, sample: Twist2, window: Floats) -> bool:
        """Tell whether a sample is legal by the distances of this cycle (``checkTrajectory``)."""
        s, room = self._settings, self._room
        assert s is not None
        # In double precision, unlike the search.
        state = np.array((pose.x, pose.y, pose.yaw, twist.vx, twist.vy, twist.wz))
        n = simulate_trajectory(state, sample.vx, sample.vy, sample.wz, s, room.points)
        cost = score_trajectory(room.points, n, window, math.inf, s, self._grid, room.terms)
        return bool(cost >= 0.0)
