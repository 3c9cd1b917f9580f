"""The planner thread of move_base: when it plans and what failing means (``planThread``)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, TypeAlias

from daemon.navigation.ros.move_base._parameters import MoveBaseParameters
from daemon.navigation.ros.move_base._status import State, Status, Trigger
from daemon.navigation.ros.quirks import Quirks
from grammars.values import Floats, Pose2

MakePlan: TypeAlias = Callable[[Pose2], Floats | None]
"""From a goal (map) to a plan (n, 3) from where the robot is now, or ``None``."""
_EARLY: Final = 1e-9


class PlannerThread:
    """Plans at ``planner_frequency`` from the start of one plan to the start of the next.

    The control loop wakes it early whenever it waits for a plan. Planning takes no simulated
    time. With a frequency of 0 it plans once when asked, and after a failure again at every step
    of the stack, where the original tries as fast as it can.
    """

    def __init__(
        self, parameters: MoveBaseParameters, quirks: Quirks, status: Status, make_plan: MakePlan
    ) -> None:
        rate = parameters.planner_frequency
        self._period = 1.0 / rate if rate > 0.0 else 0.0
        self._patience = parameters.planner_patience
        retries = parameters.max_planning_retries
        self._retries = retries if retries >= 0 else math.inf
        self._ignores_failures = quirks.failed_replanning_ignored
        self._status, self._make_plan = status, make_plan
        self._due = 0.0
        self._failing_since: float | None = None

    def wake(self) -> None:
        """Let it plan at the next step, whatever its period (``planner_cond_.notify_one``)."""
        self._due = 0.0

    def step(self, now: float) -> None:
        """Make a plan if it is time to."""
        status = self._status
        if not status.running or status.goal is None or now < self._due - _EARLY:
            return
        self._due = now + self._period
        plan = self._make_plan(status.goal)
        if plan is not None and len(plan):
            self._succeed(now, plan)
        elif status.state is State.PLANNING:
            self._fail(now)
        elif status.state is State.CONTROLLING and not self._ignores_failures:
            status.state = State.PLANNING
            status.zeroed = True

    def _succeed(self, now: float, plan: Floats) -> None:
        status = self._status
        status.plan, status.fresh = plan, True
        status.last_valid_plan, status.planning_retries = now, 0
        status.state = State.CONTROLLING
        if self._period == 0.0:
            status.running = False
        if self._failing_since is not None:
            status.said.append(f"found a plan after {now - self._failing_since:.1f} s without one")
            self._failing_since = None

    def _fail(self, now: float) -> None:
        status = self._status
        if self._failing_since is None:
            self._failing_since = now
            status.said.append("no plan to the goal")
        status.planning_retries += 1
        late = now > status.last_valid_plan + self._patience
        if late or status.planning_retries > self._retries:
            status.state, status.trigger = State.CLEARING, Trigger.PLANNING
            status.running = False
            status.zeroed = True
