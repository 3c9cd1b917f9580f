"""Parameters of move_base, of the recoveries it loads and of the waypoint dispatcher.

Names and defaults as in ROS 1 Noetic (``move_base``, ``rotate_recovery``,
``clear_costmap_recovery``).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Final, Literal, TypeAlias

from pydantic import AfterValidator, ConfigDict, Field
from pydantic.dataclasses import dataclass

from daemon.stacks.ros1.parameters import NotNegative, Positive, Section

_Rate: TypeAlias = Annotated[float, Field(gt=0.0, le=100.0, allow_inf_nan=False)]

CLEAR: Final = "clear_costmap_recovery/ClearCostmapRecovery"
ROTATE: Final = "rotate_recovery/RotateRecovery"
_CONFIG: Final = ConfigDict(extra="forbid")


def _known_recovery(plugin: str) -> str:
    """Return ``plugin`` when it is built in; raises ``ValueError`` otherwise."""
    if plugin not in (CLEAR, ROTATE):
        raise ValueError(
            f"this recovery is not built in, {CLEAR} and {ROTATE} are: take it out of the list"
        )
    return plugin


@dataclass(frozen=True, slots=True, config=_CONFIG)
class RecoveryBehavior:
    """One entry of ``recovery_behaviors``: what is run, under which name its parameters are."""

    name: Annotated[str, Field(min_length=1, max_length=100)]
    """Also the namespace of its parameters."""
    type: Annotated[str, AfterValidator(_known_recovery)]
    """What it does: ``clear_costmap_recovery/ClearCostmapRecovery`` or
    ``rotate_recovery/RotateRecovery``."""


@dataclass(frozen=True, slots=True, config=_CONFIG)
class MoveBaseParameters(Section):
    """Namespace ``move_base``."""

    base_global_planner: str = "navfn/NavfnROS"
    """The global planner, as pluginlib knows it."""
    base_local_planner: str = "base_local_planner/TrajectoryPlannerROS"
    """The local planner, as pluginlib knows it."""
    controller_frequency: _Rate = 20.0
    """[Hz] How often the control loop runs."""
    planner_frequency: Annotated[float, Field(ge=0.0, le=100.0, allow_inf_nan=False)] = 0.0
    """[Hz] How often a new global plan is made; 0: only when the control loop asks for one."""
    planner_patience: NotNegative = 5.0
    """[s] Without a plan for so long, recoveries begin."""
    controller_patience: NotNegative = 15.0
    """[s] Without a valid velocity command for so long, recoveries begin."""
    max_planning_retries: Annotated[int, Field(ge=-1)] = -1
    """After so many failed plans recoveries begin, whatever the patience; -1: no limit."""
    oscillation_timeout: NotNegative = 0.0
    """[s] A robot that moves no farther than ``oscillation_distance`` for so long goes into
    recoveries; 0: never."""
    oscillation_distance: NotNegative = 0.5
    """[m] How far it must move to count as getting on."""
    latch_xy_goal_tolerance: bool = False
    """Once within the tolerance of a goal, only turn, even if the robot drifts off again. DWA
    reads it here and not in its own namespace."""
    make_plan_clear_costmap: bool = True
    """Whether the make_plan service clears a square around the robot in both costmaps."""
    clearing_radius: NotNegative = 0.46
    """[m] Half the side of that square (ROS: ``local_costmap/circumscribed_radius``, a parameter
    of its own that does not follow the footprint)."""
    conservative_reset_dist: NotNegative = 3.0
    """[m] Side of the square around the robot that the first reset keeps."""
    recovery_behavior_enabled: bool = True
    """Whether anything is tried before a goal is aborted."""
    clearing_rotation_allowed: bool = True
    """Whether the default recoveries contain turns on the spot."""
    recovery_behaviors: tuple[RecoveryBehavior, ...] | None = None
    """What is tried, in this order; none given: a conservative reset, a turn, an aggressive
    reset, a turn."""

    without_effect: ClassVar[Mapping[str, str]] = {
        "make_plan_add_unreachable_goal": (
            "it only changes the answer of make_plan, which nobody reads"
        ),
        "restore_defaults": "only dynamic_reconfigure reads it",
        "shutdown_costmaps": "costmaps would only rest between two goals, which is no time here",
    }


@dataclass(frozen=True, slots=True, config=_CONFIG)
class ClearCostmapParameters(Section):
    """Namespace of one reset, ``move_base/conservative_reset`` for example.

    The default behaviours get ``reset_distance`` from move_base (``conservative_reset_dist``, and
    four times 0.46 m for the aggressive one), whatever is written here.
    """

    reset_distance: NotNegative = 3.0
    """[m] Side of the square around the robot that is kept."""
    layer_names: tuple[str, ...] = ("obstacles",)
    """Layers to clear. Costmaps without ``plugins`` call theirs ``obstacle_layer``."""
    invert_area_to_clear: bool = False
    """Clear inside of the square instead of outside."""
    affected_maps: Literal["both", "local", "global"] = "both"
    """Which costmaps are cleared."""
    force_updating: bool = False
    """Update each costmap as soon as it is cleared, instead of at its own rate."""


@dataclass(frozen=True, slots=True, config=_CONFIG)
class RotateRecoveryParameters(Section):
    """Namespace ``move_base/rotate_recovery``, and what it reads from ``TrajectoryPlannerROS``."""

    sim_granularity: Positive = 0.017
    """[rad] Step at which the turn ahead is checked for collisions."""
    frequency: _Rate = 20.0
    """[Hz] How often it commands."""
    acc_lim_theta: Positive = 3.2
    """[rad/s^2] Limits the speed towards the end of the turn."""
    max_vel_theta: Positive = 1.0
    """[rad/s] Fastest turn."""
    min_in_place_vel_theta: NotNegative = 0.4
    """[rad/s] Slowest turn."""
    yaw_goal_tolerance: Positive = 0.10
    """[rad] How near to the heading it began with the turn ends."""


OTHER_NAMES: Final[Mapping[str, str]] = {
    "acc_lim_th": "acc_lim_theta",
    "max_rotational_vel": "max_vel_theta",
    "min_in_place_rotational_vel": "min_in_place_vel_theta",
}
"""Older names in ``TrajectoryPlannerROS`` that rotate_recovery still reads."""


@dataclass(frozen=True, slots=True, config=_CONFIG)
class DispatcherParameters(Section):
    """The node that sends the waypoints of a mission one by one (argenos/waypoint_dispatcher)."""

    strict: ClassVar[bool] = True

    rate: _Rate = 1.0
    """[Hz] Goals are at least this period apart."""
    make_plan: bool = True
    """Whether it asks for a plan before each goal, which it does not use: what counts are the
    side effects of the request."""
    default_yaw: Annotated[float, Field(ge=-6.2832, le=6.2832)] = 0.0
    """[rad] Heading at waypoints that ask for none: a goal of move_base always has one."""
