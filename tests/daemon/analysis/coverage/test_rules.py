"""Rules that recognise features in what a trace tells, however often it was recorded."""

from dataclasses import replace

import numpy as np
import pytest

from daemon.analysis.coverage._rules import crossed_rooms, run_facts
from grammars.model.scene import Region
from tests.daemon.judging.oracles.traces import CORRIDOR, along, box, make_trace, mission

ROOMS = (
    Region("west", box(-1.0, -1.0, 5.0, 1.0)),
    Region("east", box(5.0, -1.0, 11.0, 1.0)),
)
SCENE = replace(CORRIDOR, regions=ROOMS)


@pytest.mark.parametrize("rate", [1.0, 20.0, 100.0])
def test_rooms_are_crossed_at_any_rate_of_poses(rate):
    time = np.arange(12.0 * rate) / rate
    trace = make_trace(along(time, speed=0.75), scene=SCENE, goal=mission((8.0, 0.0)))
    assert crossed_rooms(run_facts(trace.spec, SCENE, trace))
