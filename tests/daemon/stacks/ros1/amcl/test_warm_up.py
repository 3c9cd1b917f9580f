import importlib
import pkgutil

import numpy as np
from numba.core.dispatcher import Dispatcher

import daemon.stacks.ros1.amcl as room
from daemon.stacks import warm_up
from daemon.stacks.ros1.amcl import AmclParameters
from daemon.stacks.ros1.amcl.node import Amcl
from daemon.stacks.ros1.quirks import FAST, FIXED
from grammars.model.geometry import Pose2
from tests.daemon.stacks.ros1.amcl.world import LASER, a_room, map_of, see


def compiled():
    """How many versions of each kernel of the room are compiled."""
    found = {}
    for info in pkgutil.iter_modules(room.__path__, f"{room.__name__}."):
        for name, value in vars(importlib.import_module(info.name)).items():
            if isinstance(value, Dispatcher):
                found[f"{info.name}.{name}"] = len(value.signatures)
    return found


def test_after_warming_up_no_run_compiles_anything():
    warm_up()
    before = compiled()
    assert before
    walls = a_room(3.0, 2.0, 0.2)
    for odometry in ("diff", "omni", "diff-corrected", "omni-corrected"):
        p = AmclParameters(min_particles=10, max_particles=30, odom_model_type=odometry)
        for quirks in (FAST, FIXED):
            seed = np.random.SeedSequence(0)
            amcl = Amcl(p, quirks, map_of(walls), (LASER,), Pose2(1.0, 1.0), seed)
            for k in range(4):
                pose = Pose2(1.0 + 0.3 * k, 1.0)
                amcl.scan(0.1 * k, see(walls, pose), pose)
    assert compiled() == before
