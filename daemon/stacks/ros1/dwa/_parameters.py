"""Parameters of dwa_local_planner with the names and defaults of Noetic.

Source: dynamic reconfigure descriptions of dwa_local_planner and base_local_planner.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, ClassVar, TypeAlias

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

from daemon.stacks.ros1.base_local_planner.controller import sim_period
from daemon.stacks.ros1.parameters import Finite, NotNegative, Objection, Positive, Section

_Acceleration: TypeAlias = Annotated[float, Field(ge=0.0, le=20.0, allow_inf_nan=False)]
_Samples: TypeAlias = Annotated[int, Field(ge=0, le=1000)]


@dataclass(frozen=True, slots=True, config=ConfigDict(extra="forbid"))
class DwaParameters(Section):
    """Parameters under ``DWAPlannerROS``."""

    max_vel_trans: NotNegative = 0.55
    """[m/s] Largest speed in any direction."""
    min_vel_trans: NotNegative = 0.1
    """[m/s] Slower motions are legal only if they turn at ``min_vel_theta`` or faster."""
    max_vel_x: Finite = 0.55
    """[m/s] Largest speed forward."""
    min_vel_x: Finite = 0.0
    """[m/s] Smallest speed forward; negative: the robot may reverse."""
    max_vel_y: Finite = 0.1
    """[m/s] Largest speed to the left."""
    min_vel_y: Finite = -0.1
    """[m/s] Smallest speed to the left; negative: to the right."""
    max_vel_theta: NotNegative = 1.0
    """[rad/s] Fastest turn, either way."""
    min_vel_theta: NotNegative = 0.4
    """[rad/s] Slower turns are legal only at ``min_vel_trans`` or faster. Slowest turn at the
    goal."""
    acc_lim_x: _Acceleration = 2.5
    """[m/s^2] Along this axis."""
    acc_lim_y: _Acceleration = 2.5
    """[m/s^2] Along this axis."""
    acc_lim_theta: _Acceleration = 3.2
    """[rad/s^2] Turning."""
    prune_plan: bool = False
    """Remove the plan behind the robot, up to the first pose within 1 m."""
    xy_goal_tolerance: NotNegative = 0.1
    """[m] Distance from the goal where the robot stops and turns."""
    yaw_goal_tolerance: NotNegative = 0.1
    """[rad] Tolerance of the heading at the goal."""
    trans_stopped_vel: NotNegative = 0.1
    """[m/s] The robot stands below this speed, per axis."""
    theta_stopped_vel: NotNegative = 0.1
    """[rad/s] The robot does not turn below this speed."""
    sim_time: NotNegative = 1.7
    """[s] Duration of trajectories."""
    sim_granularity: Positive = 0.025
    """[m] Largest distance between points of a trajectory."""
    angular_sim_granularity: Positive = 0.1
    """[rad] Largest turn between points of a trajectory."""
    path_distance_bias: NotNegative = 32.0
    """Weight of the distance from the path, per metre."""
    goal_distance_bias: NotNegative = 24.0
    """Weight of the distance from the local goal, per metre."""
    occdist_scale: NotNegative = 0.01
    """Weight of the highest cost under the footprint."""
    twirling_scale: NotNegative = 0.0
    """Weight of the turning speed."""
    oscillation_reset_dist: NotNegative = 0.05
    """[m] Motion after which the robot may change its direction again."""
    oscillation_reset_angle: NotNegative = 0.2
    """[rad] Turn after which it may, too."""
    forward_point_distance: Finite = 0.325
    """[m] Distance of the nose, which also follows the path."""
    scaling_speed: NotNegative = 0.25
    """[m/s] The footprint grows above this speed."""
    max_scaling_factor: NotNegative = 0.2
    """Relative growth of the footprint at ``max_vel_trans``."""
    vx_samples: _Samples = 3
    """Samples of the forward speed; 0 counts as 1."""
    vy_samples: _Samples = 10
    """Samples of the sideways speed."""
    vth_samples: _Samples = 20
    """Samples of the turning speed."""
    use_dwa: bool = True
    """Sample speeds within reach of one control period; otherwise of ``sim_time``, and trajectories
    accelerate."""
    sum_scores: bool = False
    """Sum the costs under the footprint instead of taking the highest."""
    cheat_factor: NotNegative = 1.0
    """The nose counts while the local plan's end is further than ``forward_point_distance`` times
    the root of this."""
    controller_frequency: Annotated[float | None, Field(allow_inf_nan=False)] = None
    """[Hz] For the dynamic window. Default: that of move_base."""

    without_effect: ClassVar[Mapping[str, str]] = {
        "acc_lim_trans": "read, but never used",
        "global_frame_id": "only for display",
        "holonomic_robot": "the limits of y decide about strafing",
        "latch_xy_goal_tolerance": "DWA reads it in the namespace of move_base",
        "publish_cost_grid_pc": "only for display",
        "publish_traj_pc": "only for display",
        "restore_defaults": "only a button of rqt_reconfigure",
        "stop_time_buffer": "read, but never used",
    }

    # Noetic warns of the first six (``DWAPlannerROS::initialize``).
    renamed: ClassVar[Mapping[str, str]] = {
        "max_trans_vel": "max_vel_trans",
        "min_trans_vel": "min_vel_trans",
        "max_rot_vel": "max_vel_theta",
        "min_rot_vel": "min_vel_theta",
        "acc_limit_trans": "acc_lim_trans",
        "rot_stopped_vel": "theta_stopped_vel",
        "acc_lim_th": "acc_lim_theta",
        "vtheta_samples": "vth_samples",
    }

    def rules(self) -> Iterator[Objection]:
        """Yield objections to limits that prevent motion, and a doubt that the robot ever starts.

        Samples of a standing robot end at the speeds it reaches within a control period
        (``sim_time`` without ``use_dwa``). Samples below both minimum speeds are illegal.
        """
        p = self
        # 1e-4 m/s is the slack of the original's test of samples (``generateTrajectory``), on both
        # sides of the first rule.
        if p.min_vel_trans > p.max_vel_trans + 2e-4:
            yield Objection(
                ("min_vel_trans", "max_vel_trans"),
                f"min_vel_trans {p.min_vel_trans} is above max_vel_trans {p.max_vel_trans}: no "
                "motion is legal but fast turns, so the robot cannot drive",
            )
        if p.max_vel_trans == 0.0:
            yield Objection(("max_vel_trans",), "max_vel_trans is 0: the robot can never drive")
        for low, high in (("min_vel_x", "max_vel_x"), ("min_vel_y", "max_vel_y")):
            least, most = getattr(p, low), getattr(p, high)
            if least > most:
                text = f"{low} {least} is above {high} {most}: there is no speed between"
                yield Objection((low, high), text)
        if (
            min(abs(p.min_vel_x), abs(p.max_vel_x)) > p.max_vel_trans + 1e-4
            and p.min_vel_x * p.max_vel_x > 0.0
        ):
            yield Objection(
                ("min_vel_x", "max_vel_x", "max_vel_trans"),
                f"every speed between min_vel_x {p.min_vel_x} and max_vel_x {p.max_vel_x} is "
                f"beyond max_vel_trans {p.max_vel_trans}: no motion is legal",
            )
        if p.min_vel_theta > p.max_vel_theta:
            remedy = "set it lower"
            if p.min_vel_trans > 1e-4:
                remedy = "slow motions never turn fast enough to be legal"
            yield Objection(
                ("min_vel_theta", "max_vel_theta"),
                f"min_vel_theta {p.min_vel_theta} is above max_vel_theta {p.max_vel_theta}: "
                + remedy,
            )
        if p.sim_time == 0.0:
            yield Objection(
                ("sim_time",), "sim_time is 0: trajectories have no points, so none is ever chosen"
            )
        if p.acc_lim_x == 0.0 and p.acc_lim_y == 0.0 and p.use_dwa:
            yield Objection(
                ("acc_lim_x", "acc_lim_y"),
                "acc_lim_x and acc_lim_y are 0: no other speed than the present one can be reached",
            )
        if p.acc_lim_theta == 0.0:
            yield Objection(
                ("acc_lim_theta",),
                "acc_lim_theta is 0: no other turning speed than the present one can be reached",
            )
        if p.scaling_speed == p.max_vel_trans and p.max_scaling_factor > 0.0:
            yield Objection(
                ("scaling_speed", "max_vel_trans", "max_scaling_factor"),
                f"scaling_speed equals max_vel_trans {p.max_vel_trans}: the footprint of samples "
                "faster by rounding grows without bound; set it apart or max_scaling_factor to 0",
            )
        reach = sim_period(p.controller_frequency, 0.05) if p.use_dwa else p.sim_time
        # Bounds of the window of a standing robot (``SimpleTrajectoryGenerator::initialise``).
        ahead = max(
            abs(max(p.min_vel_x, -p.acc_lim_x * reach)), min(p.max_vel_x, p.acc_lim_x * reach)
        )
        aside = max(
            abs(max(p.min_vel_y, -p.acc_lim_y * reach)), min(p.max_vel_y, p.acc_lim_y * reach)
        )
        turning = min(p.max_vel_theta, p.acc_lim_theta * reach)
        fastest = math.hypot(ahead, aside)
        if fastest + 1e-4 < p.min_vel_trans and turning + 1e-4 < p.min_vel_theta:
            yield Objection(
                (
                    "acc_lim_x",
                    "min_vel_trans",
                    "acc_lim_theta",
                    "min_vel_theta",
                    "controller_frequency",
                ),
                f"a standing robot never starts: within {reach:g} s it reaches {fastest:g} m/s "
                f"and {turning:g} rad/s (acc_lim_x {p.acc_lim_x:g}, acc_lim_theta "
                f"{p.acc_lim_theta:g}), below both min_vel_trans {p.min_vel_trans:g} and "
                f"min_vel_theta {p.min_vel_theta:g}",
                fatal=False,
            )
