"""What the control loop and the planner thread of move_base share."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

from grammars.values import Floats, Pose2


class State(StrEnum):
    """The three states of move_base while it has a goal (``MoveBaseState``)."""

    PLANNING = "planning"
    CONTROLLING = "controlling"
    CLEARING = "clearing"


class Trigger(StrEnum):
    """Why recoveries run, and what the goal is aborted for (``RecoveryTrigger``)."""

    PLANNING = "no valid plan"
    CONTROLLING = "no valid velocity command"
    OSCILLATION = "it does not get on"


@dataclass(slots=True)
class Status:
    """Members of move_base that both threads write; times in seconds.

    ``plan`` (n, 3) in map is the latest one, ``fresh`` until the control loop takes it.
    ``running`` lets the planner thread work (``runPlanner_``). ``said`` are sentences for the log
    of the run, taken by whoever writes it.
    """

    state: State = State.PLANNING
    trigger: Trigger = Trigger.PLANNING
    goal: Pose2 | None = None
    running: bool = False
    plan: Floats | None = None
    fresh: bool = False
    last_valid_plan: float = 0.0
    planning_retries: int = 0
    zeroed: bool = False
    """Whether the planner thread has published a zero velocity since it was last looked at."""
    said: list[str] = field(default_factory=list)
