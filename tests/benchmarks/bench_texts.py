"""From texts to scenes, plans and artefacts: building C, and a hundred sampled plans.

Steps from text to a checked scene. Plans are parsed again from their text, checked for soundness
and written; the reference data's kitchen is used when ``SCENARIO_REFERENCE_DATA`` is set, besides
the demo's flat. Artefacts are made in a process for
each kind, which pays for the libraries it imports; the reference is a repeat in the same process.
"""

import os
import tempfile
import time
from pathlib import Path

from grammars.floorplan import load_floorplan
from grammars.preflight import check_scene
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene
from grammars.variation import load_variation, sample, write_variants
from templates.artefacts import KINDS
from tests.benchmarks.measurement import Measurement, Reference, at_most, side_by_side, told
from tests.parts import ROOT

FOLDER = ROOT / "campaigns" / "ortega2024"
PLAN = FOLDER / "building_c.fpm"
COUNT, RADIUS = 100, 0.3


def measure():
    """Yield what each language takes."""
    yield from scenes()
    yield from variants()
    for kinds in (*([kind] for kind in KINDS), ["all"]):
        yield from artefacts(*kinds)


def scenes():
    """Yield each step, all of them together being the reference."""
    doors = FOLDER / "doors.scenery"
    building, layers = load_floorplan(PLAN), [load_scenery(doors)]
    scene = compile_scene(building, layers)

    def everything():
        return check_scene(compile_scene(load_floorplan(PLAN), [load_scenery(doors)]))

    works = {
        "text to checked scene": everything,
        "  plan from text": lambda: load_floorplan(PLAN),
        "  doors from text": lambda: load_scenery(doors),
        "  scene compiled": lambda: compile_scene(building, layers),
        "  world checked": lambda: check_scene(scene),
    }
    yield from side_by_side(works, 5)


def variants():
    """Yield the seconds for a hundred plans; sampled without a check they are the reference."""
    files = [ROOT / "campaigns" / "demo" / "flat.variation"]
    if data := os.environ.get("SCENARIO_REFERENCE_DATA"):
        files.append(Path(data) / "floorplans" / "kitchen.variation")
    for path in files:
        # Grammars are compiled and geometry libraries loaded once per process.
        sample(load_variation(path), 1, seed=0, check=RADIUS)
        beside = None
        for name, check in (("random", None), (f"random, sound for {RADIUS} m", RADIUS)):
            start = time.perf_counter()
            found = sample(load_variation(path), COUNT, seed=0, method="random", check=check)
            with tempfile.TemporaryDirectory() as folder:
                plans = len(write_variants(found, folder))
            took = time.perf_counter() - start
            note = f"{plans} plans of {sum(one.tries for one in found)} draws"
            goals = (at_most(10.0),) if check else ()
            yield Measurement(f"{path.stem}: {name}", took, "s", beside, goals, note)
            beside = Reference(name, took)


def export(*kinds):
    """Return what reading took and the first and second time for ``kinds`` [s], files and bytes."""
    from daemon.analysis.campaign_worlds import worlds_of_campaign
    from scenario_tui.cli.export import world_of_plan
    from templates.artefacts import export

    begin = time.perf_counter()
    plan, _ = world_of_plan(PLAN)
    worlds, _ = worlds_of_campaign(FOLDER / "first.yaml")
    times = [time.perf_counter() - begin]
    known = [KINDS[kind] for kind in kinds if kind in KINDS]
    world = next(w for w in (worlds[-1], plan) if all(kind.fits(w) for kind in known))
    for _ in range(2):
        with tempfile.TemporaryDirectory() as folder:
            begin = time.perf_counter()
            done = export(world, kinds, Path(folder))
            times.append(time.perf_counter() - begin)
            size = sum(path.stat().st_size for path in done.paths)
    return *times, len(done.paths), size


def artefacts(*kinds):
    reading, first, second, files, size = told(export, *kinds)
    note = f"{files} files, {size / 1e6:.2f} MB"
    name = f"export {', '.join(kinds)}"
    yield Measurement(name, first, "s", Reference("again", second), (), note)
    if kinds == ("all",):
        yield Measurement("  plan and campaign read", reading, "s", Reference(name, first))
