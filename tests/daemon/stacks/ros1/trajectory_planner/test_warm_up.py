import importlib
import pkgutil
from dataclasses import replace

import numpy as np
from numba.core.dispatcher import Dispatcher

import daemon.stacks.ros1.base_local_planner as shared
import daemon.stacks.ros1.trajectory_planner as room
from daemon.stacks.ros1.quirks import FAST, FIXED
from daemon.stacks.ros1.trajectory_planner import (
    TrajectoryPlanner,
    TrajectoryPlannerParameters,
    warm_up,
)
from grammars.model.geometry import Pose2, Twist2
from tests.daemon.stacks.ros1.trajectory_planner.helpers import (
    circle,
    costs_around,
    rectangle,
    straight,
)


def compiled():
    """How many versions of each kernel of both rooms are compiled."""
    found = {}
    for package in (shared, room):
        for info in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
            for name, value in vars(importlib.import_module(info.name)).items():
                if isinstance(value, Dispatcher):
                    found[f"{info.name}.{name}"] = len(value.signatures)
    return found


def test_after_warming_up_no_run_compiles_anything():
    warm_up()
    before = compiled()
    assert before
    plain = TrajectoryPlannerParameters(vx_samples=3, vtheta_samples=5)
    for parameters in (
        plain,
        replace(plain, dwa=True, heading_scoring=True, holonomic_robot=False, prune_plan=False),
        replace(plain, simple_attractor=True, y_vels="", meter_scoring=True),
    ):
        for outline in (circle(0.3), rectangle(-0.3, 0.3, 0.2), circle(0.3)[:1]):
            for quirks in (FAST, FIXED):
                planner = TrajectoryPlanner(parameters, quirks, outline, 0.1)
                planner.set_plan(straight(1.5, end=2.0))
                for x in (0.0, 0.3, 1.3, 1.5):
                    local = costs_around(Pose2(x), 60, 0.05, (0.8, -0.3, 1.0, 0.4))
                    planner.command(Pose2(x), Twist2(0.2, 0.0, 0.1), Pose2(0.1), local)
                local.cells[:] = np.uint8(254)
                local.touch((0, 0, 60, 60))
                planner.command(Pose2(1.0), Twist2(), Pose2(), local)
    assert compiled() == before
