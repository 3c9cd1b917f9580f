"""Controller that follows a global plan by trying velocities.

Its state besides the search: directions that oscillation rules out, and the phase within tolerance
of the goal (stop, then turn).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

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
from daemon.stacks.ros1.base_local_planner.map_grid import Cells, passable_cells
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.dwa._parameters import DwaParameters
from daemon.stacks.ros1.dwa._scoring import (
    ScoringGrid,
    allocate_scoring_grid,
    complete_distances,
    critic_weights,
    fill_distances,
    score_trajectory,
)
from daemon.stacks.ros1.dwa._search import SearchBuffers, allocate_buffers, find_best_sample
from daemon.stacks.ros1.dwa.samples import (
    DwaSettings,
    longest_trajectory,
    sample_speeds,
    settings_of,
    simulate_trajectory,
)
from daemon.stacks.ros1.quirks import Quirks
from grammars.model.geometry import Floats, Pose2, Twist2, wrap_angle

_VX, _VY, _WZ = 0, 2, 4


class Oscillation:
    """Directions ruled out (base_local_planner ``OscillationCostFunction``).

    ``banned`` (6,) holds a flag each for negative and positive vx, vy, wz: after a change of sign
    the old sign is ruled out until the robot has moved or turned far enough.
    """

    def __init__(self, distance: float, angle: float) -> None:
        self.banned: Integers = np.zeros(6, dtype=np.int32)
        self._bans = False
        self._last_signs = [0, 0, 0]
        self._distance, self._angle = distance, angle
        self._turned_at: Sequence[float] = (0.0, 0.0, 0.0)

    def reset(self) -> None:
        """Release all directions."""
        self.banned[:] = 0
        self._bans = False
        self._last_signs = [0, 0, 0]

    def record(self, at: Sequence[float], velocity: Sequence[float], min_vel_trans: float) -> None:
        """Record the command ``velocity`` (vx, vy, wz) ``at`` a pose (x, y, yaw).

        Strafing and turning count only if the robot is slow.
        """
        vx, vy, wz = velocity
        flipped = self._take(_VX, vx)
        if abs(vx) <= min_vel_trans:
            flipped |= self._take(_VY, vy)
            flipped |= self._take(_WZ, wz)
        if flipped:
            self._turned_at = at
        if self._bans and self._moved(at):
            self.reset()

    def _take(self, place: int, speed: float) -> bool:
        """Remember the sign of ``speed`` and rule out the other one if it changed."""
        sign = (speed > 0.0) - (speed < 0.0)
        if sign == 0:
            return False
        last, self._last_signs[place // 2] = self._last_signs[place // 2], sign
        if last != -sign:
            return False
        self.banned[place if sign > 0 else place + 1] = 1
        self._bans = True
        return True

    def _moved(self, at: Sequence[float]) -> bool:
        turned_at = self._turned_at
        dx, dy = at[0] - turned_at[0], at[1] - turned_at[1]
        far = dx * dx + dy * dy > self._distance * self._distance
        return far or abs(at[2] - turned_at[2]) > self._angle


class StopRotate:
    """base_local_planner ``LatchedStopRotateController``.

    With ``latch`` a reached position stays reached until the next plan, even if the estimate moves.
    """

    def __init__(
        self, parameters: DwaParameters, period: float, *, latch: bool, raised: bool
    ) -> None:
        self._p = parameters
        self._period = period
        self._latch = latch
        self._raised = raised
        self._latched = False
        self._rotating = False

    def reset_latch(self) -> None:
        """Release a reached position."""
        self._latched = False

    def position_reached(self, pose: Pose2, goal: Pose2) -> bool:
        """Tell whether ``pose`` is within ``xy_goal_tolerance`` of ``goal``, or was if latched."""
        near = math.hypot(goal.x - pose.x, goal.y - pose.y) <= self._p.xy_goal_tolerance
        reached = near or (self._latch and self._latched)
        self._latched = self._latched or reached
        return reached

    def goal_reached(self, pose: Pose2, twist: Twist2, goal: Pose2) -> bool:
        """Tell whether the robot stands at ``goal`` with its heading."""
        return (
            self.position_reached(pose, goal)
            and abs(wrap_angle(goal.yaw - pose.yaw)) <= self._p.yaw_goal_tolerance
            and self._stopped(twist)
        )

    def command(
        self, pose: Pose2, twist: Twist2, goal: Pose2, legal: Callable[[Twist2], bool]
    ) -> Twist2 | None:
        """Return the next command, ``None`` if it is not ``legal``."""
        p = self._p
        error = wrap_angle(goal.yaw - pose.yaw)
        if abs(error) <= p.yaw_goal_tolerance:
            self._rotating = False
            return Twist2()
        self._rotating = self._rotating or self._stopped(twist)
        if self._rotating:
            speeds = (p.min_vel_theta, p.max_vel_theta)
            command = turn_towards(
                error, twist.wz, speeds, p.acc_lim_theta, self._period, raised=self._raised
            )
        else:
            limits = (p.acc_lim_x, p.acc_lim_y, p.acc_lim_theta)
            command = slow_down(twist, limits, self._period)
        return command if legal(command) else None

    def _stopped(self, twist: Twist2) -> bool:
        still = max(abs(twist.vx), abs(twist.vy)) <= self._p.trans_stopped_vel
        return still and abs(twist.wz) <= self._p.theta_stopped_vel


class Dwa:
    """dwa_local_planner ``DWAPlannerROS`` of ROS Noetic.

    ``footprint`` is the padded outline, shape (corners, 2) [m]. ``control_period_default`` [s] is
    that of move_base, for a configuration without its own ``controller_frequency``.
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
            sim_period(parameters.controller_frequency, control_period_default),
            latch=latch_goal,
            raised=quirks.rotation_raised_to_minimum,
        )
        self._plan = FollowedPlan()
        self._front_end = np.zeros(2)
        self._state = np.zeros(6)
        self._settings: DwaSettings | None = None
        self._seen: int | None = None
        self._snapshot: Cells
        self._last: tuple[Floats, Cells, Floats] | None = None
        """Plan, cells and frame of the last sampling cycle."""
        self._field: ScoringGrid
        self._room: SearchBuffers
        self._critics: tuple[Floats, Floats]
        self._weights: Floats
        # Load it now, because it takes longest to compile in the first run on a machine.
        self._machine = self._load_machine_code()

    def _load_machine_code(self) -> tuple[Callable[..., Any], ...]:
        """Return the three kernels of a search, for a costmap of any shape."""
        grid = CostGrid(0.05, 0.0, 0.0, np.zeros((1, 1), dtype=np.uint8))
        settings = settings_of(self._p, self._quirks, grid.resolution, self._period_default)
        field = allocate_scoring_grid(grid, settings, self._outline, self._oscillation.banned)
        room = allocate_buffers((1, 1), settings, 1)
        state, point, window = np.zeros(6), np.zeros(2), np.zeros((1, 2))
        reach, weights = (0.0, 0.0), critic_weights(settings, False)
        return (
            machine_code(sample_speeds, state, point, settings, room.samples, room.counts),
            machine_code(fill_distances, state, window, point, reach, weights, field),
            machine_code(find_best_sample, state, weights, settings, field, room),
        )

    def set_plan(self, plan: Floats) -> None:
        """Follow ``plan``, shape (poses, 3): x, y, yaw in the map frame, the goal last."""
        self._plan.take(plan)
        self._stop_rotate.reset_latch()
        if self._quirks.plans_reset_oscillation:
            self._oscillation.reset()

    def goal_reached(self, pose: Pose2, twist: Twist2, map_to_odom: Pose2) -> bool:
        """Tell whether the robot stands at the end of the plan; ``pose`` is in odom."""
        if self._plan.is_over:
            return False
        return self._stop_rotate.goal_reached(pose, twist, self._plan.goal(map_to_odom))

    def command(
        self, pose: Pose2, twist: Twist2, map_to_odom: Pose2, local: CostGrid
    ) -> ControllerAnswer:
        """Return the next velocity; ``pose`` and ``local`` are in odom.

        ``map_to_odom`` is the pose of odom in the map. The answer is not ok without a plan near the
        robot, or if every velocity is illegal (``DWAPlannerROS::computeVelocityCommands``).
        """
        settings = self._prepare(local)
        window = self._plan.window(pose, map_to_odom, local, prune=self._p.prune_plan)
        if len(window) == 0:
            return NO_VELOCITY
        # The original keeps velocities in poses, whose "yaw" comes back normalised.
        twist = Twist2(twist.vx, twist.vy, wrap_angle(twist.wz))
        self._take_state(pose, twist, settings, local)
        self._aim(window, settings)
        goal = self._plan.goal(map_to_odom)
        if self._stop_rotate.position_reached(pose, goal):
            turn = self._stop_rotate.command(pose, twist, goal, self._is_legal)
            return NO_VELOCITY if turn is None else ControllerAnswer(True, turn, NO_POINTS)
        return self._sample(window, settings)

    def _prepare(self, local: CostGrid) -> DwaSettings:
        """Allocate buffers for a costmap of a new shape, and update its passable cells."""
        settings = self._settings
        if settings is None or self._field.cells.shape != local.cells.shape:
            settings = settings_of(self._p, self._quirks, local.resolution, self._period_default)
            self._settings = settings
            self._critics = critic_weights(settings, False), critic_weights(settings, True)
            self._field = allocate_scoring_grid(
                local, settings, self._outline, self._oscillation.banned
            )
            longest = longest_trajectory(settings, 0.0, 0.0, 0.0)
            self._room = allocate_buffers(local.cells.shape, settings, longest)
            self._last, self._seen = None, None
        elif self._field.cells is not local.cells:
            self._field, self._seen = self._field._replace(cells=local.cells), None
        if local.version != self._seen:
            passable_cells(local.cells, self._field.passable)
            self._snapshot = local.cells.copy()
            self._seen = local.version
        frame = self._field.frame
        frame[0], frame[1], frame[2] = local.x, local.y, local.resolution
        return settings

    def _take_state(
        self, pose: Pose2, twist: Twist2, settings: DwaSettings, local: CostGrid
    ) -> None:
        row = (pose.x, pose.y, pose.yaw, twist.vx, twist.vy, twist.wz)
        # The original stores poses and speeds in single precision.
        self._state[:] = np.array(row, dtype=np.float32)
        needed = longest_trajectory(settings, twist.vx, twist.vy, twist.wz)
        if needed > len(self._room.points):
            self._room = allocate_buffers(local.cells.shape, settings, needed)

    def _aim(self, window: Floats, settings: DwaSettings) -> None:
        """Push the end of the window ahead and decide whether the nose counts."""
        x, y = window[-1].tolist()
        at_x, at_y = self._state[:2].tolist()
        forward = self._p.forward_point_distance
        angle = math.atan2(y - at_y, x - at_x)
        end = self._front_end
        end[0], end[1] = x + forward * math.cos(angle), y + forward * math.sin(angle)
        square = (at_x - x) * (at_x - x) + (at_y - y) * (at_y - y)
        far = square > forward * forward * self._p.cheat_factor
        self._weights = self._critics[far]

    def _sample(self, window: Floats, settings: DwaSettings) -> ControllerAnswer:
        state, weights, field, room = self._state, self._weights, self._field, self._room
        end, front_end = window[-1], self._front_end
        sample, fill, find = self._machine
        # Samples first, because their speeds bound the distances needed. Filling the whole costmap
        # would cost more than following every trajectory.
        centre = sample(state, end, settings, room.samples, room.counts)
        reach = (centre, centre + abs(settings.forward_point_distance))
        fill(state, window, front_end, reach, weights, field)
        n = find(state, weights, settings, field, room)
        self._last = window.copy(), self._snapshot, field.frame.copy()
        if n == 0:
            return NO_VELOCITY
        vx, vy, wz = velocity = room.answer[:3].tolist()
        twist = Twist2(vx, vy, wrap_angle(wz))
        self._oscillation.record(self._state.tolist(), velocity, self._p.min_vel_trans)
        return ControllerAnswer(True, twist, room.points[:n, :2].copy())

    def _is_legal(self, twist: Twist2) -> bool:
        """Tell whether a trajectory is legal now, by the distances of the last sampling cycle."""
        # ``checkTrajectory`` resets oscillation before it scores, also for later cycles.
        self._oscillation.reset()
        s, field, weights = self._settings, self._field, self._weights
        assert s is not None
        points, moving = self._room.points, self._room.moving
        if self._last is not None:
            field = complete_distances(*self._last, field, weights)
        sample = np.array((twist.vx, twist.vy, twist.wz), dtype=np.float32)
        vx, vy, wz = sample.tolist()
        n = simulate_trajectory(self._state, vx, vy, wz, s, points, moving)
        return bool(score_trajectory(points, n, moving, weights, math.inf, s, field) >= 0.0)
