"""Table of the published models that load, run and come back.

``python -m campaigns.studies.published_models [--write]``

It looks for models in the folder ``SCENARIO_REFERENCE_DATA``, and in each ``--more FOLDER``, a
checkout of a published repository. ``--write`` writes the table into ``published-models.md``;
otherwise it is printed. A model *loads* if its language accepts it. It *runs* if the pilot drives
to a waypoint in it without an error. It *comes back* if it is the same after this program has
written and read it.
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
PAGE = Path(__file__).with_name("published-models.md")
_NOT_PUBLISHED = {"goldens", "acceptance", "reports"}
"""Folders of the reference data with inputs made for tests."""
_NEAR = 1e-6
"""Largest distance of corners that come back from their originals [m]."""

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
    """One model: its kind, and the result of each trial: ``yes``, ``-`` or why not."""

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
    """Return the kind of a file or folder, and its trial; ``None`` if it is not a model."""
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
        tree = json.loads(text) if path.suffix in (".json", ".jsonld") else yaml.safe_load(text)
    except (ValueError, yaml.YAMLError):
        return set()
    return set(tree) if isinstance(tree, dict) else set()


def outcome_of(attempt):
    """Return ``yes``, or the first problem in a few words."""
    try:
        result = attempt()
    except InputError as error:
        return error.findings[0].message.split("\n")[0]
    except ValueError as error:
        return str(error).split("\n")[0]
    return result if isinstance(result, str) else "yes"


def _plan(path, scratch):
    loads = outcome_of(lambda: load_floorplan(path))
    if loads != "yes":
        return loads, "-", "-"
    plan = load_floorplan(path)
    return (
        loads,
        outcome_of(lambda: run_in(plan, path, scratch)),
        outcome_of(lambda: _returned(plan, scratch)),
    )


def _plan_folder(folder, scratch):
    loads = outcome_of(lambda: load_floorplan_jsonld(folder))
    if loads != "yes":
        return loads, "-", "-"
    plan = load_floorplan_jsonld(folder)
    runs = outcome_of(lambda: run_in(plan, folder, scratch))
    return loads, runs, outcome_of(lambda: _returned(plan, scratch))


def _returned(plan, scratch):
    """Write a plan as JSON-LD, read it, and compare the scenes."""
    scene = compile_scene(plan)
    files = write_jsonld(ArtefactWorld(plan.name, scene, plan, layers=()), scratch / "jsonld")
    again = load_floorplan_jsonld(next(file for file in files if file.suffix == ".jsonld"))
    return "yes" if alike(scene, compile_scene(again)) else "another scene"


def alike(one, other):
    """Return whether solids, spaces and doorways of two scenes are the same to a micrometre."""

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
    """Drive the pilot from one corner of the widest space to the next; return the outcome."""
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
    loads = outcome_of(lambda: load_variation(path))
    if loads != "yes":
        return loads, "-", "-"
    files = []

    def variants():
        samples = sample(load_variation(path), 2, seed=1)
        files.extend(v.path for v in write_variants(samples, scratch / "variants"))
        for file in files:
            load_floorplan(file)

    returns = outcome_of(variants)
    if not files:
        return loads, "-", returns
    return loads, outcome_of(lambda: run_in(load_floorplan(files[0]), files[0], scratch)), returns


def _objects(path, scratch):
    return outcome_of(lambda: load_scenery_jsonld(path)), "-", "-"


def _map(path, scratch):
    file = scratch / path.name
    shutil.copy(path, file)
    name = Path(yaml.safe_load(path.read_text(encoding="utf-8"))["image"]).name
    # The reference data has renamed some images and gzipped large ones.
    images = [path.with_name(name), path.with_suffix(".pgm"), path.with_suffix(".pgm.gz")]
    image = next((image for image in images if image.is_file()), None)
    if image is None:
        return "its image is missing", "-", "-"
    data = image.read_bytes()
    (scratch / name).write_bytes(gzip.decompress(data) if image.suffix == ".gz" else data)
    loads = outcome_of(lambda: read_map(file))
    if loads != "yes":
        return loads, "-", "-"

    def returned():
        grid = read_map(file).grid
        write_map(grid, scratch / "again", laser_height=0.0)
        again = read_map(scratch / "again.yaml").grid
        same = (grid.x, grid.y, grid.resolution) == (again.x, again.y, again.resolution)
        return "yes" if same and np.array_equal(grid.cells, again.cells) else "another map"

    return loads, outcome_of(lambda: _imported(file, scratch)), outcome_of(returned)


def _imported(file, scratch):
    """Run in the building made from a map."""
    walls = scratch / "imported.walls.yaml"
    walls.write_text(walls_text(vectorise(read_map(file).grid).building), encoding="utf-8")
    return run_in(load_walls(walls), walls, scratch)


def _key_frames(path, scratch):
    entries = json.loads(path.read_text(encoding="utf-8"))["keyframes"]
    frames = [(frame["time"], frame.get("pose", frame.get("position"))) for frame in entries]
    moves = ", ".join(f"to {position} rad at {time} s" for time, position in frames)
    layer = scratch / "frames.scenery"
    layer.write_text(f"bedroom_door moves {moves}, as listed, by jump\n")
    demo = ROOT / "campaigns" / "demo"
    doors = load_scenery(demo / "doors.scenery")
    scene = compile_scene(load_floorplan(demo / "flat.fpm"), [doors])

    def act():
        layers = (doors, load_scenery(layer))
        (behaviour,) = resolve_behaviours(
            scene, layers, seed=np.random.SeedSequence(1), limit=3600.0
        ).behaviours
        assert isinstance(behaviour, KeyFrames)
        return behaviour

    def returned():
        again = json.loads(frames_text(act(), "pose"))["keyframes"]
        same = [(f["time"], abs(f["pose"])) for f in again] == [(t, abs(p)) for t, p in frames]
        return "yes" if same else "other frames"

    loads = outcome_of(act)
    return loads, "-", outcome_of(returned) if loads == "yes" else "-"


def _task(path, scratch):
    waypoints = yaml.safe_load(path.read_text(encoding="utf-8"))["waypoints"]
    lines = [
        f"  - {{id: {json.dumps(str(w['id']))}, x: {w['x']}, y: {w['y']}, yaw: {w['yaw']}}}\n"
        for w in waypoints
    ]
    file = scratch / "task.mission.yaml"
    # A task has no start.
    first = f"start: {{x: {waypoints[0]['x']}, y: {waypoints[0]['y']}, yaw: 0}}\n"
    file.write_text(f"mission: task\n{first}waypoints:\n{''.join(lines)}")

    def returned():
        mission, _ = load_mission(file)
        actual = [(w.id, w.x, w.y, w.yaw) for w in mission.waypoints]
        expected = [(str(w["id"]), w["x"], w["y"], w["yaw"]) for w in waypoints]
        return "yes" if actual == expected else "other waypoints"

    loads = outcome_of(lambda: load_mission(file))
    return loads, "-", outcome_of(returned) if loads == "yes" else "-"


def _world(path, scratch):
    return "written, never read", "-", "-"


def table(models):
    """Return findings as a table in Markdown."""
    rows = ["| kind | model | loads | runs | comes back |", "|---|---|---|---|---|"]
    for f in sorted(models, key=lambda f: (f.kind, f.name)):
        cells = (f.kind, f"`{f.name}`", f.loads, f.runs, f.returns)
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(rows)


def main(arguments):
    """Print or write the table; the exit code is 2 without any folder of models."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"into {PAGE.name}")
    parser.add_argument("--more", action="append", default=[], type=Path, metavar="FOLDER")
    options = parser.parse_args(arguments)
    folders = [Path(f) for f in (os.environ.get("SCENARIO_REFERENCE_DATA"),) if f] + options.more
    if not folders:
        print("SCENARIO_REFERENCE_DATA names no folder, and there is no --more", file=sys.stderr)
        return 2
    text = table([finding for folder in folders for finding in findings(folder)])
    if not options.write:
        print(text)
        return 0
    write_tables(PAGE, {"models": text + "\n"})
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
