"""What counts when nothing is written: the defaults of Noetic's move_base and its recoveries."""

from dataclasses import asdict

import pytest
from pydantic import ValidationError

from daemon.stacks.ros1.move_base import (
    ClearCostmapParameters,
    MoveBaseParameters,
    RotateRecoveryParameters,
)
from daemon.stacks.ros1.move_base._parameters import RecoveryBehavior


def test_move_base():
    """``MoveBase.cfg`` and the constructor of ``MoveBase``."""
    assert asdict(MoveBaseParameters()) == {
        "base_global_planner": "navfn/NavfnROS",
        "base_local_planner": "base_local_planner/TrajectoryPlannerROS",
        "controller_frequency": 20.0, "planner_frequency": 0.0, "planner_patience": 5.0,
        "controller_patience": 15.0, "max_planning_retries": -1, "oscillation_timeout": 0.0,
        "oscillation_distance": 0.5, "latch_xy_goal_tolerance": False,
        "make_plan_clear_costmap": True, "clearing_radius": 0.46, "conservative_reset_dist": 3.0,
        "recovery_behavior_enabled": True, "clearing_rotation_allowed": True,
        "recovery_behaviors": None,
    }  # fmt: skip


def test_recoveries():
    """``ClearCostmapRecovery::initialize`` and ``RotateRecovery::initialize``."""
    assert asdict(ClearCostmapParameters()) == {
        "reset_distance": 3.0, "layer_names": ("obstacles",), "invert_area_to_clear": False,
        "affected_maps": "both", "force_updating": False,
    }  # fmt: skip
    assert asdict(RotateRecoveryParameters()) == {
        "sim_granularity": 0.017, "frequency": 20.0, "acc_lim_theta": 3.2, "max_vel_theta": 1.0,
        "min_in_place_vel_theta": 0.4, "yaw_goal_tolerance": 0.1,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("name", "wrong", "right"),
    [
        ("controller_frequency", (0.0, 100.1), (0.1, 100.0)),
        ("planner_frequency", (-0.1, 100.1), (0.0, 100.0)),
        ("max_planning_retries", (-2,), (-1, 0)),
        ("planner_patience", (-0.1,), (0.0,)),
    ],
)
def test_what_makes_no_sense_is_refused(name, wrong, right):
    for value in wrong:
        with pytest.raises(ValidationError):
            MoveBaseParameters(**{name: value})
    for value in right:
        assert getattr(MoveBaseParameters(**{name: value}), name) == value


def test_recoveries_that_are_not_built_in_are_refused():
    with pytest.raises(ValidationError, match="not built in"):
        RecoveryBehavior("shake", "shake_recovery/ShakeRecovery")
