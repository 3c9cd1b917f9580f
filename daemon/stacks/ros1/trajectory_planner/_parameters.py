"""Parameters of TrajectoryPlannerROS with the names and defaults of Noetic.

Noetic reads most of them twice: ``TrajectoryPlannerROS`` at its start, and dynamic reconfigure
right after. The latter's defaults and ranges then decide about trajectories; they differ from
those in the wiki.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Annotated, ClassVar, Final, Literal, TypeAlias

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

from daemon.stacks.ros1.parameters import Finite, NotNegative, Objection, Positive, Section, refuse

_Optional: TypeAlias = Annotated[float | None, Field(allow_inf_nan=False)]

_STRAFE_SPEEDS: Final = "-0.3,-0.1,0.1,-0.3"
_NUMBER: Final = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


_RENAMED: Final = "its name here is {}"
_NO_STRAFE_LIMITS: Final = "only y_vels decides about strafing"
_DISPLAY: Final = "only for display"
_COSTMAP_ONLY: Final = "the costmap is the only world model"


@dataclass(frozen=True, slots=True, config=ConfigDict(extra="forbid"))
class TrajectoryPlannerParameters(Section):
    """Parameters under ``TrajectoryPlannerROS``."""

    acc_lim_x: NotNegative = 2.5
    """[m/s^2] Along this axis."""
    acc_lim_y: NotNegative = 2.5
    """[m/s^2] Along this axis."""
    acc_lim_theta: NotNegative = 3.2
    """[rad/s^2] Turning."""
    max_vel_x: Finite = 0.55
    """[m/s] Largest speed forward; less near the end of the local plan."""
    min_vel_x: Finite = 0.0
    """[m/s] Smallest speed forward. Below 0 counts as 0."""
    max_vel_theta: Finite = 1.0
    """[rad/s] Fastest turn to the left."""
    min_vel_theta: Finite = -1.0
    """[rad/s] Fastest turn to the right, below 0."""
    min_in_place_vel_theta: Annotated[float | None, Field(ge=0.0, allow_inf_nan=False)] = None
    """[rad/s] Slowest turn on the spot. Default: 0.4."""
    max_rotational_vel: NotNegative = 1.0
    """[rad/s] Fastest turn at the goal."""
    min_in_place_rotational_vel: Annotated[float | None, Field(ge=0.0, allow_inf_nan=False)] = None
    """[rad/s] Older name of the same, which counts only at the goal."""
    holonomic_robot: bool = True
    """Strafe a little while driving, and along ``y_vels`` if nothing else is legal."""
    y_vels: str | tuple[Finite, ...] = _STRAFE_SPEEDS
    """[m/s] Speeds to the left, as text with commas. ROS ignores a list."""
    escape_vel: Finite = -0.1
    """[m/s] Speed ahead when no trajectory is legal; negative: backwards."""
    yaw_goal_tolerance: NotNegative = 0.05
    """[rad] Tolerance of the heading at the goal."""
    xy_goal_tolerance: NotNegative = 0.10
    """[m] Distance from the local plan's end where the robot stops and turns."""
    latch_xy_goal_tolerance: bool = False
    """Once there, only turn until the next plan, even if the robot drifts off."""
    prune_plan: bool = True
    """Remove the plan behind the robot, up to the first pose within 1 m."""
    sim_time: Finite = 1.7
    """[s] Duration of trajectories."""
    sim_granularity: Positive = 0.025
    """[m] Distance between points of a trajectory; with ``heading_scoring`` the time [s]."""
    angular_sim_granularity: Positive = 0.025
    """[rad/s] A trajectory's turning speed divided by this is its least number of points."""
    vx_samples: int = 20
    """Samples of the forward speed."""
    vtheta_samples: int = 20
    """Samples of the turning speed, and of turns on the spot."""
    path_distance_bias: _Optional = None
    """Weight of the distance from the path. Default: ``pdist_scale``."""
    pdist_scale: _Optional = None
    """Older name of ``path_distance_bias``. Default: 0.6."""
    goal_distance_bias: _Optional = None
    """Weight of the distance from the local goal. Default: ``gdist_scale``."""
    gdist_scale: _Optional = None
    """Older name of ``goal_distance_bias``. Default: 0.8."""
    meter_scoring: bool = False
    """Both weights are per metre, not per cell. In Noetic uninitialised memory decides this."""
    occdist_scale: Finite = 0.01
    """Weight of the highest cost under the footprint."""
    heading_lookahead: Finite = 0.325
    """[m] Look ahead of turns on the spot."""
    heading_scoring: bool = False
    """Score a trajectory at one instant only, with its heading."""
    heading_scoring_timestep: Finite = 0.1
    """[s] That instant."""
    dwa: bool = False
    """Sample speeds within reach of one control period instead of ``sim_time``."""
    simple_attractor: Annotated[
        Literal[False], refuse((True,), "the simple attractor is not built in: write false")
    ] = False
    """Score by the straight distance instead of the grid."""
    oscillation_reset_dist: Finite = 0.05
    """[m] Motion after which the robot may turn or strafe the other way again."""
    escape_reset_dist: Finite = 0.10
    """[m] Motion after which a robot that backed up may drive ahead again."""
    escape_reset_theta: Finite = math.pi / 2.0
    """[rad] Turn after which it may, too."""
    controller_frequency: _Optional = None
    """[Hz] For the dynamic window. Default: that of move_base."""

    without_effect: ClassVar[Mapping[str, str]] = {
        "acc_lim_th": _RENAMED.format("acc_lim_theta"),
        "acc_limit_th": _RENAMED.format("acc_lim_theta"),
        "acc_limit_x": _RENAMED.format("acc_lim_x"),
        "acc_limit_y": _RENAMED.format("acc_lim_y"),
        "backup_vel": "escape_vel takes its place at once",
        "global_frame_id": _DISPLAY,
        "max_vel_y": _NO_STRAFE_LIMITS,
        "min_vel_y": _NO_STRAFE_LIMITS,
        "point_grid": _COSTMAP_ONLY,
        "publish_cost_grid": _DISPLAY,
        "publish_cost_grid_pc": _DISPLAY,
        "restore_defaults": "only a button of rqt_reconfigure",
        "stop_time_buffer": "read, but never used",
        "vy_samples": _NO_STRAFE_LIMITS,
        "world_model": _COSTMAP_ONLY,
    }

    def rules(self) -> Iterator[Objection]:
        """Yield objections to limits that prevent motion, then doubts about values."""
        p = self
        slowest = in_range(p, "min_vel_x")
        sim_time, instant = in_range(p, "sim_time"), in_range(p, "heading_scoring_timestep")
        steps = max(1, int(sim_time / p.sim_granularity + 0.5))
        if in_range(p, "max_vel_x") == 0.0:
            yield Objection(("max_vel_x",), "max_vel_x is 0: the robot can never drive")
        if slowest > p.max_vel_x:
            yield Objection(
                ("min_vel_x", "max_vel_x"),
                f"min_vel_x {p.min_vel_x} is above max_vel_x {p.max_vel_x}: there is no "
                "speed between",
            )
        if sim_time == 0.0:
            yield Objection(
                ("sim_time",), "sim_time is 0: trajectories lead nowhere, so all are the same"
            )
        if p.vx_samples <= 1 and slowest == 0.0:
            yield Objection(
                ("vx_samples", "min_vel_x"),
                f"vx_samples is {p.vx_samples}: only min_vel_x is tried, which is 0",
            )
        if p.vtheta_samples <= 1:
            yield Objection(
                ("vtheta_samples",),
                f"vtheta_samples is {p.vtheta_samples}: only straight on is tried, the robot "
                "cannot turn",
            )
        if p.acc_lim_x == 0.0 and slowest == 0.0:
            yield Objection(
                ("acc_lim_x",), "acc_lim_x is 0: no other speed than the present one can be reached"
            )
        if p.acc_lim_theta == 0.0:
            yield Objection(
                ("acc_lim_theta",),
                "acc_lim_theta is 0: no other turning speed than the present one can be reached",
            )
        # A small margin, because the controller sums the time up step by step.
        if p.heading_scoring and instant > sim_time * (1.0 - 1.0 / steps) + 1e-9:
            yield Objection(
                ("heading_scoring_timestep", "sim_time"),
                f"heading_scoring_timestep {instant:g} is beyond the last point of a trajectory of "
                f"{sim_time:g} s: neither path nor goal would count",
            )
        for name, (low, high) in _RANGES.items():
            value = getattr(p, name)
            if value is not None and not low <= value <= high:
                used = in_range(p, name)
                text = f"{name} {value} is beyond what the controller takes: {used:g} counts"
                yield Objection((name,), text, fatal=False)
        if not isinstance(p.y_vels, str):
            text = 'ROS ignores the list y_vels: write text, such as "-0.3, -0.1, 0.1, 0.3"'
            yield Objection(("y_vels",), text, fatal=False)
        elif any(speed == 0.0 for speed in strafe_speeds(p)):
            text = f'y_vels "{p.y_vels}" has parts that are not numbers: they are never tried'
            yield Objection(("y_vels",), text, fatal=False)
        if p.meter_scoring:
            yield Objection(("meter_scoring",), _METER_SCORING, fatal=False)


_METER_SCORING: Final = (
    "in ROS uninitialised memory decides whether weights count per metre; here they do, and with "
    "meter_scoring: false the robot drives as with a zero there"
)
_RANGES: Final[Mapping[str, tuple[float, float]]] = {
    "acc_lim_x": (0.0, 20.0),
    "acc_lim_y": (0.0, 20.0),
    "acc_lim_theta": (0.0, 20.0),
    "max_vel_x": (0.0, 20.0),
    "min_vel_x": (0.0, 20.0),
    "max_vel_theta": (0.0, 20.0),
    "min_vel_theta": (-20.0, 0.0),
    "min_in_place_vel_theta": (0.0, 20.0),
    "sim_time": (0.0, 10.0),
    "sim_granularity": (0.0, 5.0),
    "angular_sim_granularity": (0.0, math.pi / 2.0),
    "path_distance_bias": (0.0, 5.0),
    "pdist_scale": (0.0, 5.0),
    "goal_distance_bias": (0.0, 5.0),
    "gdist_scale": (0.0, 5.0),
    "occdist_scale": (0.0, 5.0),
    "oscillation_reset_dist": (0.0, 5.0),
    "escape_reset_dist": (0.0, 5.0),
    "escape_reset_theta": (0.0, 5.0),
    "vx_samples": (1, 300),
    "vtheta_samples": (1, 300),
    "heading_lookahead": (0.0, 5.0),
    "escape_vel": (-2.0, 2.0),
    "heading_scoring_timestep": (0.0, 1.0),
}
"""Ranges to which dynamic reconfigure silently clamps values."""


def in_range(parameters: TrajectoryPlannerParameters, name: str) -> float:
    """Return a parameter as dynamic reconfigure clamps it; 0 without a value."""
    value: float = getattr(parameters, name) or 0.0
    low, high = _RANGES[name]
    return min(max(value, low), high)


def path_bias(parameters: TrajectoryPlannerParameters) -> float:
    """Return the weight of the distance from the path, by either name."""
    name = "pdist_scale" if parameters.path_distance_bias is None else "path_distance_bias"
    return 0.6 if getattr(parameters, name) is None else in_range(parameters, name)


def goal_bias(parameters: TrajectoryPlannerParameters) -> float:
    """Return the weight of the distance from the goal, by either name."""
    name = "gdist_scale" if parameters.goal_distance_bias is None else "goal_distance_bias"
    return 0.8 if getattr(parameters, name) is None else in_range(parameters, name)


def slowest_turn(parameters: TrajectoryPlannerParameters) -> float:
    """Return the slowest turn on the spot [rad/s] that is sampled."""
    is_written = parameters.min_in_place_vel_theta is not None
    return in_range(parameters, "min_in_place_vel_theta") if is_written else 0.4


def slowest_turn_at_goal(parameters: TrajectoryPlannerParameters) -> float:
    """Return the slowest turn at the goal [rad/s], by either name and not clamped."""
    for speed in (parameters.min_in_place_vel_theta, parameters.min_in_place_rotational_vel):
        if speed is not None:
            return float(speed)
    return 0.4


def strafe_speeds(parameters: TrajectoryPlannerParameters) -> tuple[float, ...]:
    """Return the speeds [m/s] in ``y_vels``.

    A part without a number at its beginning is 0, which is never used, as in the original. So is
    an empty part, for which the original reads uninitialised memory.
    """
    text = parameters.y_vels
    if not isinstance(text, str):
        text = _STRAFE_SPEEDS
    numbers = (_NUMBER.match(part) for part in re.split("[, ]+", text))
    return tuple(float(number.group()) if number else 0.0 for number in numbers)
