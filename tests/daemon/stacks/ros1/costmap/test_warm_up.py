import importlib
import pkgutil

from numba.core.dispatcher import Dispatcher

import daemon.stacks.ros1.costmap as package
from grammars.model.geometry import Pose2
from tests.daemon.stacks.ros1.costmap.test_costmap import ROLLING, build, looking


def compiled():
    """How many versions of each kernel of the package are compiled."""
    found = {}
    for info in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
        for name, value in vars(importlib.import_module(info.name)).items():
            if isinstance(value, Dispatcher):
                found[f"{info.name}.{name}"] = len(value.signatures)
    return found


def test_after_warming_up_a_run_compiles_nothing():
    package.warm_up()
    before = compiled()
    for costmap in (build(), build(ROLLING)):
        for scans in ((), (looking(1.0),), (looking(0.5),)):
            costmap.update(Pose2(1.0, 1.0), scans)
            costmap.clear_square(Pose2(1.0, 1.0), 0.46)
        costmap.clear_layers(Pose2(1.0, 1.0), 3.0, ("obstacle_layer",))
        costmap.update(Pose2(1.5, 1.0), (looking(0.5),))
    assert compiled() == before
