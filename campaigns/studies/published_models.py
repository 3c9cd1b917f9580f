"""Table of the published models that load, run and come back.

``python -m campaigns.studies.published_models [--write]``

Models are looked for in the folder that ``SCENARIO_REFERENCE_DATA`` names, and in those given by
``--more FOLDER``, checkouts of the published repositories. ``--write`` writes the table into
``docs/published-models.md``, otherwise it is printed. A model *loads* when its language takes it,
*runs* when the pilot is driven to a waypoint in it without an error, and *comes back* when it is
the same after it was written by this program and read again.
"""

import argparse
import gzip
import json
import os
import shutil
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from campaigns.studies.pages import write_tables
from daemon.campaign import expand, load_campaign
from daemon.model.verdicts import Outcome
from daemon.run import execute
from grammars.floorplan import load_floorplan
from grammars.jsonld import load_floorplan_jsonld, load_scenery_jsonld
from grammars.maps import load_walls, walls_text
from grammars.maps.map_import import vectorise
from grammars.model.behaviour import KeyFrames
from grammars.model.map_files import read_map, write_map
from grammars.model.mission_files import load_mission
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene, resolve_behaviours
from grammars.text.diagnostics import InputError
from grammars.text.sources import model_files
from grammars.variation import load_variation, sample, write_variants
from templates.jsonld import write_jsonld
from templates.sdf import frames_text
from templates.tasks import contour_route, inset_contour
from templates.world import ArtefactWorld

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "published-models.md"
_NOT_PUBLISHED = {"goldens", "acceptance", "reports"}
"""Folders of the reference data that hold inputs made for tests."""
_NEAR = 1e-6
"""What comes back lies this near to where it was [m]."""

CAMPAIGN = """\
campaign: published
seed: 1
repeats: 1
limit: 40 s
robot: {robot}
oracles: seen
matrix: {{sut: [pilot]}}
scenarios:
  only: {{floorplan: {plan}, mission: there, oracles: [arrived]}}
"""


@dataclass(frozen=True, slots=True)
class Finding:
    """One model: what kind it is, and of each trial ``yes``, ``-`` or why not."""

    kind: str
    name: str
    loads: str
    runs: str = "-"
    returns: str = "-"


def findings(folder):
    """Try every published model below ``folder``, in the order of their paths."""
    for path in sorted(folder.rglob("*")):
        parts = path.relative_to(folder).parts
        if _NOT_PUBLISHED & set(parts) or any(part.startswith(".") for part in parts):
            continue
        trial = _trial(path)
        if trial is not None:
            kind, look = trial
            with tempfile.TemporaryDirectory() as scratch:
                loads, runs, returns = look(path, Path(scratch))
            yield Finding(kind, path.relative_to(folder).as_posix(), loads, runs, returns)


def _trial(path):
    """Return what a file or folder is, and how it is tried; ``None`` for what is no model."""
    if path.is_dir():
        if _is_plan_folder(path):
            return "JSON-LD plan", _plan_folder
        is_model = any("@graph" in _keys(file) for file in model_files(path))
        return ("JSON-LD objects", _objects) if is_model else None
    endings = {
        ".fpm": ("plan", _plan),
        ".variation": ("variation", _variation),
        ".world": ("Gazebo world", _world),
    }
    if path.suffix in endings:
        return endings[path.suffix]
    if path.suffix in (".yaml", ".yml"):
        keys = _keys(path)
        if "image" in keys and "resolution" in keys:
            return "map", _map
        return ("task", _task) if "waypoints" in keys else None
    if path.suffix in (".json", ".jsonld"):
        return ("key frames", _key_frames) if "keyframes" in _keys(path) else None
    return None


def _is_plan_folder(folder):
    return all((folder / f"{name}.json").is_file() for name in ("floorplan", "skeleton"))


def _keys(path):
    text = path.read_text(encoding="utf-8", errors="replace")
    try:
        told = json.loads(text) if path.suffix in (".json", ".jsonld") else yaml.safe_load(text)
    except (ValueError, yaml.YAMLError):
        return set()
    return set(told) if isinstance(told, dict) else set()


def tried(attempt):
    """Return ``yes``, or the first thing that is wrong in a few words."""
    try:
        found = attempt()
    except InputError as error:
        return error.findings[0].message.split("\n")[0]
    except ValueError as error:
        return str(error).split("\n")[0]
    return found if isinstance(found, str) else "yes"


def _plan(path, scratch):
    loads = tried(lambda: load_floorplan(path))
    if loads != "yes":
        return loads, "-", "-"
    plan = load_floorplan(path)
    return (
        loads,
        tried(lambda: run_in(plan, path, scratch)),
        tried(lambda: _returned(plan, scratch)),
    )


def _plan_folder(folder, scratch):
    loads = tried(lambda: load_floorplan_jsonld(folder))
    if loads != "yes":
        return loads, "-", "-"
    plan = load_floorplan_jsonld(folder)
    runs = tried(lambda: run_in(plan, folder, scratch))
    return loads, runs, tried(lambda: _returned(plan, scratch))


def _returned(plan, scratch):
    """Write a plan as JSON-LD, read it, and compare the scenes."""
    scene = compile_scene(plan)
    written = write_jsonld(ArtefactWorld(plan.name, scene, plan, layers=()), scratch / "jsonld")
    again = load_floorplan_jsonld(next(p for p in written if p.suffix == ".jsonld"))
    return "yes" if alike(scene, compile_scene(again)) else "another scene"


def alike(one, other):
    """Whether what stands in two scenes, and where one can go, is the same within a micrometre."""

    def corners(scene):
        rings = [*(s.polygon for s in scene.solids), *(r.outline for r in scene.regions)]
        rings += [d.footprint for d in scene.doorways]
        return sorted(sorted(np.array(ring).round(6).tolist()) for ring in rings)

    mine, theirs = corners(one), corners(other)
    if [len(ring) for ring in mine] != [len(ring) for ring in theirs]:
        return False
    flat = [np.array([corner for ring in rings for corner in ring]) for rings in (mine, theirs)]
    return bool(np.allclose(*flat, atol=2 * _NEAR))


def run_in(plan, source, scratch):
    """Drive the pilot from one corner of the widest space to the next; say how it ended."""
    regions = sorted(compile_scene(plan).regions, key=lambda r: -_span(r.outline))
    routes = (contour_route(inset_contour(region, 0.7)) for region in regions)
    stops = next((route for route in routes if len(route) > 1), None)
    if stops is None:
        return "no space is wide enough for a waypoint"
    start, goal = stops[0], stops[1]
    (scratch / "there.mission.yaml").write_text(
        f"mission: there\nstart: {{x: {start.x} m, y: {start.y} m, yaw: 0 rad}}\n"
        f"waypoints:\n  - {{id: goal, x: {goal.x} m, y: {goal.y} m}}\n"
    )
    (scratch / "seen.oracles.yaml").write_text("arrived: reached(mission, 0.3 m)\n")
    shutil.copy(ROOT / "campaigns" / "suts" / "pilot.yaml", scratch)
    robot = ROOT / "campaigns" / "robots" / "courier.yaml"
    file = scratch / "campaign.yaml"
    file.write_text(CAMPAIGN.format(robot=robot, plan=source.resolve()))
    submission = expand(load_campaign(file))
    result = execute(submission.specs[0], submission.scenes[0], trace_path=scratch / "run.mcap")
    return result.note or "error" if result.outcome is Outcome.ERROR else "yes"


def _span(ring):
    return float(np.ptp(np.array(ring), axis=0).min())


def _variation(path, scratch):
    loads = tried(lambda: load_variation(path))
    if loads != "yes":
        return loads, "-", "-"
    files = []

    def variants():
        drawn = sample(load_variation(path), 2, seed=1)
        files.extend(v.path for v in write_variants(drawn, scratch / "variants"))
        for file in files:
            load_floorplan(file)

    returns = tried(variants)
    if not files:
        return loads, "-", returns
    return loads, tried(lambda: run_in(load_floorplan(files[0]), files[0], scratch)), returns


def _objects(path, scratch):
    return tried(lambda: load_scenery_jsonld(path)), "-", "-"


def _map(path, scratch):
    file = scratch / path.name
    shutil.copy(path, file)
    name = Path(yaml.safe_load(path.read_text(encoding="utf-8"))["image"]).name
    # Some were renamed where they are kept, large ones are gzipped there.
    images = [path.with_name(name), path.with_suffix(".pgm"), path.with_suffix(".pgm.gz")]
    image = next((image for image in images if image.is_file()), None)
    if image is None:
        return "its image is not at hand", "-", "-"
    data = image.read_bytes()
    (scratch / name).write_bytes(gzip.decompress(data) if image.suffix == ".gz" else data)
    loads = tried(lambda: read_map(file))
    if loads != "yes":
        return loads, "-", "-"

    def returned():
        grid = read_map(file).grid
        write_map(grid, scratch / "again", laser_height=0.0)
        again = read_map(scratch / "again.yaml").grid
        same = (grid.x, grid.y, grid.resolution) == (again.x, again.y, again.resolution)
        return "yes" if same and np.array_equal(grid.cells, again.cells) else "another map"

    return loads, tried(lambda: _imported(file, scratch)), tried(returned)


def _imported(file, scratch):
    """Run in the building that is made of a map."""
    walls = scratch / "imported.walls.yaml"
    walls.write_text(walls_text(vectorise(read_map(file).grid).building), encoding="utf-8")
    return run_in(load_walls(walls), walls, scratch)


def _key_frames(path, scratch):
    told = json.loads(path.read_text(encoding="utf-8"))["keyframes"]
    frames = [(frame["time"], frame.get("pose", frame.get("position"))) for frame in told]
    moves = ", ".join(f"to {position} rad at {time} s" for time, position in frames)
    layer = scratch / "frames.scenery"
    layer.write_text(f"bedroom_door moves {moves}, as listed, by jump\n")
    demo = ROOT / "campaigns" / "demo"
    doors = load_scenery(demo / "doors.scenery")
    scene = compile_scene(load_floorplan(demo / "flat.fpm"), [doors])

    def act():
        layers = (doors, load_scenery(layer))
        (found,) = resolve_behaviours(
            scene, layers, seed=np.random.SeedSequence(1), limit=3600.0
        ).behaviours
        assert isinstance(found, KeyFrames)
        return found

    def returned():
        again = json.loads(frames_text(act(), "pose"))["keyframes"]
        same = [(f["time"], abs(f["pose"])) for f in again] == [(t, abs(p)) for t, p in frames]
        return "yes" if same else "other frames"

    loads = tried(act)
    return loads, "-", tried(returned) if loads == "yes" else "-"


def _task(path, scratch):
    told = yaml.safe_load(path.read_text(encoding="utf-8"))["waypoints"]
    lines = [
        f"  - {{id: {json.dumps(str(w['id']))}, x: {w['x']}, y: {w['y']}, yaw: {w['yaw']}}}\n"
        for w in told
    ]
    file = scratch / "task.mission.yaml"
    # Where the robot starts is not said in a task.
    first = f"start: {{x: {told[0]['x']}, y: {told[0]['y']}, yaw: 0}}\n"
    file.write_text(f"mission: task\n{first}waypoints:\n{''.join(lines)}")

    def returned():
        mission, _ = load_mission(file)
        found = [(w.id, w.x, w.y, w.yaw) for w in mission.waypoints]
        wanted = [(str(w["id"]), w["x"], w["y"], w["yaw"]) for w in told]
        return "yes" if found == wanted else "other waypoints"

    loads = tried(lambda: load_mission(file))
    return loads, "-", tried(returned) if loads == "yes" else "-"


def _world(path, scratch):
    return "written, never read", "-", "-"


def table(found):
    """Return the findings as a table in Markdown."""
    rows = ["| kind | model | loads | runs | comes back |", "|---|---|---|---|---|"]
    for f in sorted(found, key=lambda f: (f.kind, f.name)):
        cells = (f.kind, f"`{f.name}`", f.loads, f.runs, f.returns)
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(rows)


def main(arguments):
    """Print or write the table; the exit code is 2 without any folder of models."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"into {PAGE.name}")
    parser.add_argument("--more", action="append", default=[], type=Path, metavar="FOLDER")
    chosen = parser.parse_args(arguments)
    folders = [Path(f) for f in (os.environ.get("SCENARIO_REFERENCE_DATA"),) if f] + chosen.more
    if not folders:
        print("SCENARIO_REFERENCE_DATA names no folder, and there is no --more", file=sys.stderr)
        return 2
    made = table([finding for folder in folders for finding in findings(folder)])
    if not chosen.write:
        print(made)
        return 0
    write_tables(PAGE, {"models": made + "\n"})
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
