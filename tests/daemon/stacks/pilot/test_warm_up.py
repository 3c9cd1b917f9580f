import importlib
import pkgutil

from numba.core.dispatcher import Dispatcher

import daemon.stacks.pilot
from daemon.stacks import warm_up
from grammars.model.geometry import Pose2
from tests.daemon.stacks.pilot.plans import DOOR, SIZE, TWO_DOORWAYS
from tests.daemon.stacks.pilot.world import drive


def compiled():
    """How many versions of each kernel of the room are compiled."""
    found = {}
    for info in pkgutil.iter_modules(daemon.stacks.pilot.__path__, "daemon.stacks.pilot."):
        for name, value in vars(importlib.import_module(info.name)).items():
            if isinstance(value, Dispatcher):
                found[f"{info.name}.{name}"] = len(value.signatures)
    return found


def test_after_warming_up_a_run_compiles_nothing():
    warm_up()
    before = compiled()
    log = drive(
        TWO_DOORWAYS, SIZE, Pose2(1.2, 1.5), [(7.6, 1.5)], doors={DOOR: lambda now: now > 1.0}
    )
    assert log.said("replanning around an obstacle") is not None
    assert compiled() == before
