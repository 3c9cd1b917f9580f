"""From text to a checked Scene: building C with its seventeen doors, warm."""

from grammars.floorplan import load_floorplan
from grammars.preflight import check_scene
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene
from tests.benchmarks.measurement import side_by_side
from tests.parts import ROOT

FOLDER = ROOT / "campaigns" / "ortega2024"


def measure():
    """Yield each step, all of them together being the reference."""

    def plan():
        return load_floorplan(FOLDER / "building_c.fpm")

    def doors():
        return load_scenery(FOLDER / "doors.scenery")

    building, layers = plan(), [doors()]
    scene = compile_scene(building, layers)
    works = {
        "text to checked scene": lambda: check_scene(compile_scene(plan(), [doors()])),
        "plan from text": plan,
        "doors from text": doors,
        "scene compiled": lambda: compile_scene(building, layers),
        "world checked": lambda: check_scene(scene),
    }
    yield from side_by_side(works, 5)
