"""From text to a checked Scene: building C with its seventeen doors, warm."""

import time
from pathlib import Path
from typing import TypeVar

from grammars.floorplan import load_floorplan
from grammars.preflight import check_scene
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene
from tests.benchmarks.measurement import Measurement, Reference

T = TypeVar("T")
FOLDER = Path(__file__).parents[2] / "campaigns" / "ortega2024"


def measure():
    """Yield each step, all of them together being the reference."""
    best = {}

    def timed(step, make):
        start = time.thread_time()
        made = make()
        best[step] = min(best.get(step, 1e9), time.thread_time() - start)
        return made

    for _ in range(5):
        plan = timed("plan from text", lambda: load_floorplan(FOLDER / "building_c.fpm"))
        doors = timed("doors from text", lambda: load_scenery(FOLDER / "doors.scenery"))
        scene = timed("scene compiled", lambda: compile_scene(plan, [doors]))  # noqa: B023
        timed("world checked", lambda: check_scene(scene))  # noqa: B023
    everything = 1e3 * sum(best.values())
    for step, seconds in best.items():
        yield Measurement(step, 1e3 * seconds, "ms", Reference("all steps", everything))
    yield Measurement("text to checked scene", everything, "ms")
