"""Control loop and planner thread of move_base: one goal, from plan to success or abort.

The states, timers and the order of the checks are those of ``MoveBase::executeCycle`` (ROS 1
Noetic). Two surprises are kept. A failing controller sends the loop back to planning, which
succeeds at once, so the controller fails again until ``controller_patience`` is over. And that
patience counts from the last valid command even across recoveries.

The planner thread (``planThread``) decides when to plan and handles failures. Both share a
:class:`MoveBaseStatus`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

from daemon.stacks.ros1.dwa.controller import Dwa
from daemon.stacks.ros1.move_base._parameters import MoveBaseParameters
from daemon.stacks.ros1.move_base.dispatcher import Outcome
from daemon.stacks.ros1.move_base.recoveries import Recovery
from daemon.stacks.ros1.navfn.planner import GlobalPlanner, Navfn
from daemon.stacks.ros1.quirks import Quirks
from daemon.stacks.ros1.scan_buffer import ObservedCostmap
from daemon.stacks.ros1.timers import TIME_TOLERANCE, LoopRate, is_after
from daemon.stacks.ros1.trajectory_planner.controller import TrajectoryPlanner
from grammars.model.geometry import Floats, Pose2, Twist2


class MoveBaseState(StrEnum):
    """The three states of move_base while it has a goal (``MoveBaseState``)."""

    PLANNING = "planning"
    CONTROLLING = "controlling"
    CLEARING = "clearing"


class RecoveryTrigger(StrEnum):
    """Reasons to run recoveries and to abort a goal (``RecoveryTrigger``)."""

    PLANNING = "no valid plan"
    CONTROLLING = "no valid velocity command"
    OSCILLATION = "it does not get on"


@dataclass(slots=True)
class MoveBaseStatus:
    """Members of move_base that both threads write; times in seconds.

    ``plan`` (n, 3) in map is the latest plan, ``plan_is_new`` until the control loop takes it.
    ``planner_runs`` lets the planner thread work (``runPlanner_``). ``log`` holds sentences for
    the log of the run, until the stack takes them.
    """

    state: MoveBaseState = MoveBaseState.PLANNING
    trigger: RecoveryTrigger = RecoveryTrigger.PLANNING
    goal: Pose2 | None = None
    planner_runs: bool = False
    plan: Floats | None = None
    plan_is_new: bool = False
    last_valid_plan: float = 0.0
    planning_retries: int = 0
    planner_stopped_robot: bool = False
    """The planner thread has published a zero velocity that the control loop has not seen yet."""
    log: list[str] = field(default_factory=list)


_WAKING: Final = 0.001
"""Delay of every wake-up of the planner thread [s].

Its timer restarts at the beginning of a plan, so it falls behind the control loop, which makes up
for every delay. With equal frequencies this sometimes leaves a control cycle without a new plan.
TrajectoryPlannerROS forgets its arrival with every plan: with both at 20 Hz, as on the Jackal, it
would never finish without that cycle. With other ratios the phase does not matter, and simulated
time stays on its grid.
"""


class PlannerThread:
    """Planner on the global ``costmap`` at ``planner_frequency``, from start to start of plans.

    The control loop wakes it early to wait for a plan. Planning takes no simulated time; a wake-up
    by the timer does if it matters (``_WAKING``). With a frequency of 0 it plans once on request,
    and after a failure again at every step of the stack. The original repeats as fast as it can.
    """

    def __init__(
        self,
        parameters: MoveBaseParameters,
        quirks: Quirks,
        status: MoveBaseStatus,
        planner: Navfn | GlobalPlanner,
        costmap: ObservedCostmap,
    ) -> None:
        rate = parameters.planner_frequency
        self._period = 1.0 / rate if rate > 0.0 else 0.0
        together = math.isclose(rate, parameters.controller_frequency)
        self._waking = _WAKING if together else 0.0
        self._patience = parameters.planner_patience
        retries = parameters.max_planning_retries
        self._retries = retries if retries >= 0 else math.inf
        self._ignores_failures = quirks.failed_replanning_ignored
        self._status, self._planner, self._costmap = status, planner, costmap
        self._due = 0.0
        self._failing_since: float | None = None

    def wake(self) -> None:
        """Let it plan at the next step, regardless of its period (``planner_cond_.notify_one``)."""
        self._due = 0.0

    def step(self, now: float) -> None:
        """Make a plan if one is due."""
        status = self._status
        if not status.planner_runs or status.goal is None or now < self._due - TIME_TOLERANCE:
            return
        begin = self._due if self._waking and now - self._due < self._period else now
        self._due = begin + self._period + self._waking
        plan = self.plan(self._costmap.frame.base, status.goal)
        if plan is not None and len(plan):
            self._succeed(now, plan)
        elif status.state is MoveBaseState.PLANNING:
            self._fail(now)
        elif status.state is MoveBaseState.CONTROLLING and not self._ignores_failures:
            status.state = MoveBaseState.PLANNING
            status.planner_stopped_robot = True

    def plan(self, start: Pose2, goal: Pose2) -> Floats | None:
        """Return a plan (n, 3) between poses in the frame of the global costmap, if any."""
        return self._planner.plan(self._costmap.costmap.grid, start, goal)

    def _succeed(self, now: float, plan: Floats) -> None:
        status = self._status
        status.plan, status.plan_is_new = plan, True
        status.last_valid_plan, status.planning_retries = now, 0
        status.state = MoveBaseState.CONTROLLING
        if self._period == 0.0:
            status.planner_runs = False
        if self._failing_since is not None:
            status.log.append(f"found a plan after {now - self._failing_since:.1f} s without one")
            self._failing_since = None

    def _fail(self, now: float) -> None:
        status = self._status
        if self._failing_since is None:
            self._failing_since = now
            status.log.append("no plan to the goal")
        status.planning_retries += 1
        late = is_after(now, status.last_valid_plan + self._patience)
        if late or status.planning_retries > self._retries:
            status.state, status.trigger = MoveBaseState.CLEARING, RecoveryTrigger.PLANNING
            status.planner_runs = False
            status.planner_stopped_robot = True


STILL: Final = Twist2()


class MoveBase:
    """Control loop; ``step`` runs it when it is due.

    ``controller`` is the local planner. The ``take_`` methods remove their results. Sentences for
    the log go to ``status.log``.
    """

    def __init__(
        self,
        parameters: MoveBaseParameters,
        quirks: Quirks,
        status: MoveBaseStatus,
        planner: PlannerThread,
        controller: Dwa | TrajectoryPlanner,
        recoveries: Sequence[Recovery],
        global_costmap: ObservedCostmap,
        local_costmap: ObservedCostmap,
    ) -> None:
        self._parameters, self._status, self._planner = parameters, status, planner
        self._controller, self._recoveries = controller, recoveries
        self._global, self._local = global_costmap, local_costmap
        self._clears_square = quirks.dispatcher_clears_square and parameters.make_plan_clear_costmap
        self._period = 1.0 / parameters.controller_frequency
        self._control_survives = quirks.control_patience_survives_recovery
        self._last_valid_control = self._last_oscillation_reset = 0.0
        self._anchor = (0.0, 0.0)
        """Position of the robot at its latest sufficient motion (``oscillation_pose_``)."""
        self._index = 0
        self._rate = LoopRate(self._period, 0.0)
        self._recovery: Recovery | None = None
        self._recovery_rate = self._rate
        self._result: Outcome | None = None
        self._failing_since: float | None = None
        self.command: Twist2 | None = None
        self._trajectory: Floats | None = None

    def take_command(self) -> Twist2 | None:
        """Return the command published last since the previous call, if any."""
        command, self.command = self.command, None
        return command

    def take_trajectory(self) -> Floats | None:
        """Return the trajectory (n, 2) chosen since the previous call, in the local frame."""
        trajectory, self._trajectory = self._trajectory, None
        return trajectory

    def take_result(self) -> Outcome | None:
        """Return the outcome of the goal, once."""
        result, self._result = self._result, None
        return result

    def accept(self, now: float, goal: Pose2) -> None:
        """Begin with ``goal`` (map): the first cycle runs at once (``executeCb``)."""
        status = self._status
        self.command = STILL
        status.goal, status.planner_runs = goal, True
        self._planner.wake()
        status.last_valid_plan = now
        status.planning_retries = 0
        self._last_valid_control = self._last_oscillation_reset = now
        self._failing_since = None
        self._rate = LoopRate(self._period, now)
        self.step(now)

    def serve_plan(self, start: Pose2, goal: Pose2) -> None:
        """Serve make_plan (``planService``): its plan is unused, its side effects stay.

        ``start`` and ``goal`` are in map.
        """
        if self._clears_square:
            for observed in (self._global, self._local):
                half = self._parameters.clearing_radius
                observed.costmap.clear_square(observed.frame.base, half)
        # The service passes start and goal on unchanged, and planners refuse other frames.
        if self._global.frame.name == "map":
            self._planner.plan(start, goal)

    def step(self, now: float) -> None:
        """Run a cycle, or the recovery that blocks it, if one is due."""
        status = self._status
        if status.planner_stopped_robot:
            self.command, status.planner_stopped_robot = STILL, False
        if self._recovery is not None and self._recovery_rate.is_over(now):
            self._step_recovery(now, self._recovery)
        while status.goal is not None and self._recovery is None and self._rate.is_over(now):
            self._cycle(now)
            # A recovery that takes time is part of the cycle, which then ends later.
            if self._recovery is None:
                self._rate.sleep(now)

    def _cycle(self, now: float) -> None:
        status = self._status
        self._notice_motion(now)
        if status.plan_is_new and status.plan is not None:
            status.plan_is_new = False
            self._controller.set_plan(status.plan)
            if status.trigger is RecoveryTrigger.PLANNING:
                self._index = 0
        if status.state is MoveBaseState.PLANNING:
            status.planner_runs = True
            self._planner.wake()
        elif status.state is MoveBaseState.CONTROLLING:
            self._control(now)
        else:
            self._recover(now)

    def _notice_motion(self, now: float) -> None:
        pose = self._global.frame.base
        away = math.hypot(pose.x - self._anchor[0], pose.y - self._anchor[1])
        if away >= self._parameters.oscillation_distance:
            self._last_oscillation_reset = now
            self._anchor = (pose.x, pose.y)
            if self._status.trigger is RecoveryTrigger.OSCILLATION:
                self._index = 0

    def _control(self, now: float) -> None:
        status, timeout = self._status, self._parameters.oscillation_timeout
        frame = self._local.frame
        twist, in_plan = frame.transforms.twist, frame.pose_in(self._global.frame)
        if self._controller.goal_reached(frame.base, twist, in_plan):
            self._end("succeeded")
            return
        if timeout > 0.0 and is_after(now, self._last_oscillation_reset + timeout):
            self.command = STILL
            status.state, status.trigger = MoveBaseState.CLEARING, RecoveryTrigger.OSCILLATION
        # As in the original, oscillation does not suppress this last command.
        answer = self._controller.command(frame.base, twist, in_plan, self._local.costmap.grid)
        self._trajectory = answer.local_plan
        if answer.ok:
            self._publish(now, answer.twist)
        elif is_after(now, self._last_valid_control + self._parameters.controller_patience):
            self.command = STILL
            status.state, status.trigger = MoveBaseState.CLEARING, RecoveryTrigger.CONTROLLING
        else:
            if self._failing_since is None:
                self._failing_since = now
                status.log.append("no valid velocity command, planning again")
            status.last_valid_plan, status.planning_retries = now, 0
            status.state = MoveBaseState.PLANNING
            self.command = STILL
            status.planner_runs = True
            self._planner.wake()

    def _publish(self, now: float, command: Twist2) -> None:
        self._last_valid_control = now
        self.command = command
        if self._status.trigger is RecoveryTrigger.CONTROLLING:
            self._index = 0
        if self._failing_since is not None:
            away = now - self._failing_since
            self._status.log.append(f"velocity commands again after {away:.1f} s")
            self._failing_since = None

    def _recover(self, now: float) -> None:
        status = self._status
        if self._index < len(self._recoveries):
            recovery = self._recoveries[self._index]
            status.log.append(f"recovery {self._index + 1}, {recovery.name}: {status.trigger}")
            recovery.start()
            self._recovery = recovery
            self._recovery_rate = LoopRate(recovery.period, now)
            self._advance_recovery(now, recovery)
            return
        tried = ", even after recoveries" if self._recoveries else ""
        status.log.append(f"goal aborted: {status.trigger}{tried}")
        self._end("aborted")

    def _step_recovery(self, now: float, recovery: Recovery) -> None:
        """Continue a recovery of an earlier instant; its end also ends the blocked cycle."""
        self._advance_recovery(now, recovery)
        if self._recovery is None:
            self._rate.sleep(now)

    def _advance_recovery(self, now: float, recovery: Recovery) -> None:
        """Take the next step of the recovery; after its end the loop plans again."""
        advance = recovery.step()
        if advance.command is not None:
            self.command = advance.command
        if advance.log:
            self._status.log.append(advance.log)
        if not advance.ended:
            self._recovery_rate.sleep(now)
            return
        self._recovery = None
        self._last_oscillation_reset = now
        if not self._control_survives:
            self._last_valid_control = now
        status = self._status
        status.last_valid_plan, status.planning_retries = now, 0
        status.state = MoveBaseState.PLANNING
        self._index += 1

    def _end(self, outcome: Outcome) -> None:
        """Drop the goal and stop (``resetState``)."""
        status = self._status
        status.planner_runs, status.state = False, MoveBaseState.PLANNING
        status.trigger, status.goal = RecoveryTrigger.PLANNING, None
        self._index = 0
        self.command = STILL
        self._result = outcome
