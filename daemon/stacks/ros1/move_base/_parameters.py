"""Parameters of move_base, of its recoveries and of the waypoint dispatcher.

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
    """Return ``plugin`` if it is built in; raises ``ValueError`` otherwise."""
    if plugin not in (CLEAR, ROTATE):
        raise ValueError(
            f"this recovery is not built in, {CLEAR} and {ROTATE} are: take it out of the list"
        )
    return plugin


@dataclass(frozen=True, slots=True, config=_CONFIG)
class RecoveryBehavior:
    """An entry of ``recovery_behaviors``: a recovery and the namespace of its parameters."""

    name: Annotated[str, Field(min_length=1, max_length=100)]
    """Also the namespace of its parameters."""
    type: Annotated[str, AfterValidator(_known_recovery)]
    """``clear_costmap_recovery/ClearCostmapRecovery`` or ``rotate_recovery/RotateRecovery``."""


@dataclass(frozen=True, slots=True, config=_CONFIG)
class MoveBaseParameters(Section):
    """Namespace ``move_base``."""

    base_global_planner: str = "navfn/NavfnROS"
    """Global planner by its pluginlib name."""
    base_local_planner: str = "base_local_planner/TrajectoryPlannerROS"
    """Local planner by its pluginlib name."""
    controller_frequency: _Rate = 20.0
    """[Hz] Rate of the control loop."""
    planner_frequency: Annotated[float, Field(ge=0.0, le=100.0, allow_inf_nan=False)] = 0.0
    """[Hz] Rate of new global plans; 0: only when the controller requests one."""
    planner_patience: NotNegative = 5.0
    """[s] Time without a plan before recoveries begin."""
    controller_patience: NotNegative = 15.0
    """[s] Time without a valid velocity command before recoveries begin."""
    max_planning_retries: Annotated[int, Field(ge=-1)] = -1
    """Failed plans before recoveries begin, whatever the patience; -1: no limit."""
    oscillation_timeout: NotNegative = 0.0
    """[s] Time without ``oscillation_distance`` of motion before recoveries begin; 0: never."""
    oscillation_distance: NotNegative = 0.5
    """[m] Motion that counts as progress."""
    latch_xy_goal_tolerance: bool = False
    """Once at a goal, only turn, even if the robot drifts off. DWA reads it here."""
    make_plan_clear_costmap: bool = True
    """The make_plan service clears a square around the robot in both costmaps."""
    clearing_radius: NotNegative = 0.46
    """[m] Half the side of that square (ROS: ``local_costmap/circumscribed_radius``)."""
    conservative_reset_dist: NotNegative = 3.0
    """[m] Side of the square around the robot that the first reset keeps."""
    recovery_behavior_enabled: bool = True
    """Run recoveries before aborting a goal."""
    clearing_rotation_allowed: bool = True
    """The default recoveries contain turns on the spot."""
    recovery_behaviors: tuple[RecoveryBehavior, ...] | None = None
    """Recoveries in order. Default: conservative reset, turn, aggressive reset, turn."""

    without_effect: ClassVar[Mapping[str, str]] = {
        "make_plan_add_unreachable_goal": "it only changes the unused answer of make_plan",
        "restore_defaults": "only a button of rqt_reconfigure",
        "shutdown_costmaps": "no time passes between two goals",
    }


@dataclass(frozen=True, slots=True, config=_CONFIG)
class ClearCostmapParameters(Section):
    """Namespace of one reset, ``move_base/conservative_reset`` for example.

    The default behaviours ignore ``reset_distance``: move_base sets ``conservative_reset_dist``
    and four times 0.46 m for the aggressive one.
    """

    reset_distance: NotNegative = 3.0
    """[m] Side of the square around the robot that stays."""
    layer_names: tuple[str, ...] = ("obstacles",)
    """Layers to clear. Costmaps without ``plugins`` call theirs ``obstacle_layer``."""
    invert_area_to_clear: bool = False
    """Clear inside of the square instead of outside."""
    affected_maps: Literal["both", "local", "global"] = "both"
    """The costmaps to clear."""
    force_updating: bool = False
    """Update each costmap right after clearing it, instead of at its own rate."""


@dataclass(frozen=True, slots=True, config=_CONFIG)
class RotateRecoveryParameters(Section):
    """Parameters under ``rotate_recovery`` and ``TrajectoryPlannerROS``."""

    sim_granularity: Positive = 0.017
    """[rad] Step of the check of the turn ahead for collisions."""
    frequency: _Rate = 20.0
    """[Hz] Rate of commands."""
    acc_lim_theta: Positive = 3.2
    """[rad/s^2] Limits the speed towards the end of the turn."""
    max_vel_theta: Positive = 1.0
    """[rad/s] Fastest turn."""
    min_in_place_vel_theta: NotNegative = 0.4
    """[rad/s] Slowest turn."""
    yaw_goal_tolerance: Positive = 0.10
    """[rad] The turn ends this near to its initial heading."""


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
    """[Hz] Highest rate of goals."""
    make_plan: bool = True
    """Request a plan before each goal; only its side effects matter."""
    default_yaw: Annotated[float, Field(ge=-6.2832, le=6.2832)] = 0.0
    """[rad] Heading at waypoints without one: goals of move_base need it."""
