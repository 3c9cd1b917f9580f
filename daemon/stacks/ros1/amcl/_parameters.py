"""Parameters of amcl: ROS names, the defaults of ROS Noetic, units and ranges.

The node's source, its wiki page and its dynamic_reconfigure file differ in the recovery rates: the
defaults are those of the source.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, ClassVar, Literal, TypeAlias

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

from daemon.stacks.ros1.parameters import NotNegative, Objection, Positive, Section, refuse

_Share: TypeAlias = Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False)]
_Particles: TypeAlias = Annotated[int, Field(ge=1, le=100_000)]
_Reach: TypeAlias = Annotated[float, Field(gt=0.0, le=20.0, allow_inf_nan=False)]
_Range: TypeAlias = Annotated[float, Field(ge=-1.0, le=1000.0, allow_inf_nan=False)]

_FRAME = "there is one robot, with one base frame"
_START = "the initial pose is the start pose of the mission"
_DISPLAY = "only for display"
_RECONFIGURE = "parameters hold for the whole run"
_ONE_MAP = "there is one map, known from the start"
_BEAM = "only for the sensor model beam"
_BEAM_SKIPPING = "only for the sensor model likelihood_field_prob"


@dataclass(frozen=True, slots=True, config=ConfigDict(extra="forbid", strict=True))
class AmclParameters(Section):
    """Parameters of amcl."""

    min_particles: _Particles = 100
    """Fewest particles after resampling."""
    max_particles: _Particles = 5000
    """Most particles, and the number at the start."""
    kld_err: Annotated[float, Field(gt=0.0, le=1.0)] = 0.01
    """Largest Kullback-Leibler divergence of the sampled distribution from the true one."""
    kld_z: Annotated[float, Field(ge=0.0, le=10.0)] = 0.99
    """Standard normal quantile that bounds this error (the quantile, not its probability)."""
    update_min_d: NotNegative = 0.2
    """[m] Motion along x or y after which the filter updates."""
    update_min_a: NotNegative = math.pi / 6.0
    """[rad] Turn after which it updates."""
    resample_interval: Annotated[int, Field(ge=1, le=1000)] = 2
    """Updates from one resampling to the next. AMCL publishes its pose upon resampling."""
    selective_resampling: Annotated[
        Literal[False],
        refuse((True,), "selective resampling is not built in: write false"),
    ] = False
    """Resample only when few particles are effective."""
    transform_tolerance: Annotated[float, Field(ge=0.0, le=10.0)] = 0.1
    """[s] Stamp of the transform map->odom, ahead of the scan."""
    recovery_alpha_slow: _Share = 0.001
    """Rate of the slow average of weights; with 0 for both no random particles."""
    recovery_alpha_fast: _Share = 0.1
    """Rate of the fast average of weights."""
    initial_cov_xx: NotNegative = 0.25
    """[m^2] Variance of the start position."""
    initial_cov_yy: NotNegative = 0.25
    """[m^2] Variance of the start position."""
    initial_cov_aa: NotNegative = (math.pi / 12.0) ** 2
    """[rad^2] Variance of the start heading."""
    laser_min_range: _Range = -1.0
    """[m] Shorter returns are ignored; -1: the scanner's limit."""
    laser_max_range: _Range = -1.0
    """[m] Returns from here on are ignored; -1: the scanner's limit."""
    laser_max_beams: Annotated[int, Field(ge=2, le=100_000)] = 30
    """Beams used of each scan, evenly spread."""
    laser_model_type: Annotated[
        Literal["likelihood_field"],
        refuse(
            ("beam", "likelihood_field_prob"),
            "this sensor model is not built in: write likelihood_field",
        ),
    ] = "likelihood_field"
    """Weight of a particle by a scan."""
    laser_z_hit: NotNegative = 0.95
    """Share of returns from obstacles in the map."""
    laser_z_rand: NotNegative = 0.05
    """Share of returns from anywhere."""
    laser_sigma_hit: Positive = 0.2
    """[m] Standard deviation of these returns."""
    laser_likelihood_max_dist: _Reach = 2.0
    """[m] Distances to obstacles are capped here."""
    odom_model_type: Literal["diff", "omni", "diff-corrected", "omni-corrected"] = "diff"
    """Spread of the particles by odometry. Without -corrected, variances serve as standard
    deviations, as in the original."""
    odom_alpha1: NotNegative = 0.2
    """Variance of rotation per squared rotation."""
    odom_alpha2: NotNegative = 0.2
    """[rad^2/m^2] Variance of rotation per squared translation."""
    odom_alpha3: NotNegative = 0.2
    """Variance of translation per squared translation."""
    odom_alpha4: NotNegative = 0.2
    """[m^2/rad^2] Variance of translation per squared rotation."""
    odom_alpha5: NotNegative = 0.2
    """Variance of strafing per squared translation (omni only)."""
    global_frame_id: str = "map"
    """Name of the map's frame in costmaps."""
    odom_frame_id: str = "odom"
    """Name of the odometry frame in costmaps."""

    without_effect: ClassVar[Mapping[str, str]] = {
        "base_frame_id": _FRAME,
        "initial_pose_x": _START,
        "initial_pose_y": _START,
        "initial_pose_a": _START,
        "always_reset_initial_pose": _START,
        "force_update_after_initialpose": _START,
        "force_update_after_set_map": _ONE_MAP,
        "use_map_topic": _ONE_MAP,
        "first_map_only": _ONE_MAP,
        "gui_publish_rate": _DISPLAY,
        "save_pose_rate": _START,
        "tf_broadcast": "the correction map->odom is always there",
        "bag_scan_period": "scans come from the simulator, not from a bag",
        "restore_defaults": _RECONFIGURE,
        "laser_z_short": _BEAM,
        "laser_z_max": _BEAM,
        "laser_lambda_short": _BEAM,
        "do_beamskip": _BEAM_SKIPPING,
        "beam_skip_distance": _BEAM_SKIPPING,
        "beam_skip_threshold": _BEAM_SKIPPING,
        "beam_skip_error_threshold": _BEAM_SKIPPING,
        "beam_skip_error_threshold_": _BEAM_SKIPPING,
        "std_warn_level_x": _DISPLAY,
        "std_warn_level_y": _DISPLAY,
        "std_warn_level_yaw": _DISPLAY,
    }

    def rules(self) -> Iterator[Objection]:
        """Yield objections to limits in the wrong order."""
        if self.laser_min_range >= self.laser_max_range > 0.0:
            message = (
                f"no return is between {self.laser_min_range:g} and {self.laser_max_range:g} m"
            )
            yield Objection(("laser_min_range", "laser_max_range"), message, fatal=False)
        if self.min_particles > self.max_particles:
            yield Objection(
                ("min_particles", "max_particles"),
                f"min_particles ({self.min_particles}) is more than max_particles "
                f"({self.max_particles}): raise max_particles or lower min_particles",
            )
