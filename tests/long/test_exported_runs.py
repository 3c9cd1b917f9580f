"""Every artefact of a campaign beside the runs it has: what is exported is what is run."""

import json
import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from mcap.reader import make_reader

from daemon.campaign import expand, load_campaign
from daemon.model import ros_messages as ros
from daemon.model.spec import RunSpec, SutReference
from daemon.run import execute
from daemon.trace import read_trace
from grammars.model.behaviour import KeyFrames
from grammars.model.grid import OCCUPIED
from grammars.model.kinematics import driven_joints
from grammars.model.map_files import read_map, write_map
from grammars.model.scene import Scene
from scenario_tui.cli import invoke
from templates.occupancy import occupancy_grid, with_objects

KINDS = ("map", "sdf", "keyframes", "launch")
"""What says something about the doors of a run."""
BY_CHANCE = """\
bedroom_door toggles between closed and open every 5 s from 0 s until 20 s,
    with probability 0.5, by jump
kitchen_door goes from ajar to closed when the robot is within 1.3 m of its foot,
    starting at 0.2 rad, by spring of 0.5 N m/rad
"""
HALF_OPEN = "living_room_door starts at 0.4 m\n"
PAPER = """\
campaign: worlds
seed: 2024
repeats: 1
limit: 1 min
robot: robile-planar-move
oracles: navigation
matrix: {sut: [pilot]}
scenarios:
  shut: {floorplan: building_c, objects: doors_s1, mission: corridor, map: {doors: initial},
         oracles: [arrived]}
  timed: {like: shut, objects: doors_s2, behaviours: doors_timed_era,
          map: {doors: initial, rule: centre, resolution: 20 cm}}
  approached: {like: shut, objects: [doors, wall_stub], mission: task_2,
               behaviours: [doors_open, close_on_approach_era], map: {doors: none, rule: touch}}
"""


@dataclass(frozen=True)
class World:
    """An exported folder, and the runs of the scenario it shows."""

    folder: Path
    runs: tuple[RunSpec, ...]
    scene: Scene
    traces: Path

    @property
    def name(self):
        return self.runs[0].scenario

    def draw(self, spec):
        """Return what names of files say about the behaviours of a run."""
        first = {}
        for run in self.runs:
            first.setdefault(run.behaviours, run.repeat)
        return f"repeat-{first[spec.behaviours]}" if len(first) > 1 else ""


@pytest.fixture(scope="module")
def worlds(campaigns, tmp_path_factory):
    folder = tmp_path_factory.mktemp("worlds")
    shutil.copytree(campaigns, folder / "campaigns")
    demo, paper = (folder / "campaigns" / name for name in ("demo", "ortega2024"))
    text = (demo / "campaign.yaml").read_text().replace("repeats: 5", "repeats: 3")
    text = text.partition("search:")[0]  # of layers that are not there then
    drawn = occupancy_grid(expand(load_campaign(demo / "campaign.yaml")).scenes[0], laser_height=1)
    drawn.cells[:3] = OCCUPIED
    write_map(drawn, demo / "lab", laser_height=1)
    (demo / "by_chance.scenery").write_text(BY_CHANCE)
    (demo / "half_open.scenery").write_text(HALF_OPEN)
    moved = "objects: [doors, half_open]\n    behaviours: by_chance"
    # Its search varies the times of the doors that are replaced.
    moody = text.partition("\nsearch:")[0].replace("behaviours: doors_moving", moved)
    ways = {
        "plain": text,
        "initial": moody.replace("{rule: touch}", "{doors: initial, resolution: 10 cm}"),
        "own": text.replace("{rule: touch}", "{file: lab.yaml}"),
    }
    files = []
    for name, written in ways.items():
        assert name == "plain" or written != text
        files.append(demo / f"{name}.yaml")
        files[-1].write_text(written)
    files.append(paper / "worlds.yaml")
    files[-1].write_text(PAPER)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
        yield tuple(world for file in files for world in _exported(file, folder / file.stem))


def _exported(file, folder):
    assert invoke(["export", str(file), *KINDS, "-o", str(folder)]) == 0
    submission = expand(load_campaign(file))
    scenes = {scene.digest: scene for scene in submission.scenes}
    found = []
    for path in sorted(folder.iterdir()):
        runs = tuple(run for run in submission.specs if run.scenario == path.name)
        found.append(World(path, runs, scenes[runs[0].scene], folder))
    assert {w.name for w in found} == {run.scenario for run in submission.specs}
    return found


def launch_files(world):
    """Return the arguments of both launch files, without the folder."""
    found = []
    for ending in ("launch", "launch.xml"):
        root = ElementTree.parse(world.folder / "launch" / f"{world.name}.{ending}").getroot()
        values = {a.get("name", ""): a.get("default") or "" for a in root.findall("arg")}
        found.append({k: v.split("root)/")[-1] for k, v in values.items()})
    return found


def executed(world, spec):
    """Return the trace of the first moments of a run."""
    path = world.traces / f"{spec.scenario}-{spec.repeat}.mcap"
    if not path.exists():
        idle = replace(spec, sut=SutReference("idle", "idle", {}), limit=0.05)
        execute(idle, world.scene, trace_path=path)
    return path


def test_launch_files_load_the_map_of_the_run(worlds):
    shut = 0
    for world in worlds:
        spec = world.runs[0]
        with executed(world, spec).open("rb") as stream:
            _, _, message = next(iter(make_reader(stream).iter_messages(topics=["/map"])))
        told = ros.deserialize(message.data, "nav_msgs/msg/OccupancyGrid")
        for values in launch_files(world):
            grid = read_map(world.folder / values["map"]).grid
            origin = told.info.origin.position
            assert (grid.x, grid.y) == (origin.x, origin.y), (world.name, values["map"])
            assert grid.resolution == pytest.approx(told.info.resolution, rel=1e-7)
            cells = np.array(told.data, np.int8).reshape(told.info.height, told.info.width)
            assert np.array_equal(grid.cells, cells), (world.name, values["map"])
            shut += values["map"].endswith("-start.yaml")
            if not spec.map.file:
                text = (world.folder / values["map"]).read_text()
                assert f"laser at {spec.robot.laser.z:g} m" in text
    assert shut == 2 * 5


def test_every_draw_has_the_map_of_its_runs(worlds):
    (world,) = (w for w in worlds if w.folder.parent.name == "initial" and w.name == "busy-house")
    names = {p.stem for p in (world.folder / "maps").glob("flat-start*.yaml")}
    assert names == {"flat-start", "flat-start-repeat-1"}
    seen = set()
    for spec in world.runs:
        trace = read_trace(executed(world, spec))
        start = dict(zip(trace.joints.names, trace.joints.position[0], strict=True))
        height = spec.robot.laser.z
        building = occupancy_grid(world.scene, laser_height=height, resolution=0.1)
        expected = with_objects(building, world.scene, laser_height=height, joints=start)
        found = [
            name
            for name in names
            if np.array_equal(
                read_map(world.folder / "maps" / f"{name}.yaml").grid.cells, expected.cells
            )
        ]
        assert len(found) == 1, spec.label
        seen |= set(found)
    assert seen == names


def test_worlds_of_gazebo_hold_what_the_run_holds(worlds):
    for world in worlds:
        spec = world.runs[0]
        trace = read_trace(executed(world, spec))
        start = dict(zip(trace.joints.names, trace.joints.position[0], strict=True))
        for classic in (False, True):
            compare_with_gazebo(world, spec, start, classic=classic)


def compare_with_gazebo(world, spec, start, *, classic):
    """Compare an exported world with the scene of a run whose joints start at ``start``."""
    name = "-".join(filter(None, (world.name, world.draw(spec))))
    worlds = world.folder / "gazebo" / "worlds"
    root = ElementTree.parse(worlds / f"{name}.{'world' if classic else 'sdf'}")
    included = {item.findtext("name"): item for item in root.iter("include")}
    assert len(included) == len(world.scene.objects) + 1
    for thing in world.scene.objects:
        item = included[thing.name]
        pose = [float(v) for v in (item.findtext("pose") or "").split()]
        expected = [thing.pose.x, thing.pose.y, 0, 0, 0, thing.pose.yaw]
        assert pose == pytest.approx(expected, abs=1e-8)
        for joint in () if thing.frozen else driven_joints(thing):
            at = f"{thing.name}.{joint.name}"
            assert begins(world, item, joint.name, classic=classic) == pytest.approx(start[at]), at


def begins(world, item, joint, *, classic):
    """Return where a joint is after the first update of Gazebo, which begins with all at zero."""
    for plugin in item.iter("plugin"):
        library = plugin.get("filename")
        if plugin.findtext("joint") != joint:
            continue
        if classic and library == "libinitial_plugin.so":
            return float(plugin.findtext("position") or 0)
        if library in ("libdynamic_joint_plugin.so", "libtimed_joint_state_change_plugin.so"):
            file = (plugin.findtext("uri") or "").removeprefix("file://")
            frame = json.loads((world.folder / file).read_text())["keyframes"][0]
            if frame["time"] <= 0.0:
                return float(frame["pose" if classic else "position"])
    return 0.0


def test_key_frames_are_those_of_the_draw(worlds):
    compared = 0
    for world in worlds:
        things = {thing.name: thing for thing in world.scene.objects}
        for spec in world.runs:
            for act in spec.behaviours:
                if not isinstance(act, KeyFrames):
                    continue
                thing, joint = act.joint.split(".")
                name = thing if len(things[thing].joints) == 1 else f"{thing}.{joint}"
                told = [(f.time, f.position) for f in act.frames]
                for key, form in (("position", ""), ("pose", "era")):
                    file = world.folder.joinpath(
                        "keyframes", form, world.draw(spec), f"{name}.json"
                    )
                    frames = json.loads(file.read_text())["keyframes"]
                    found = [(frame["time"], frame[key]) for frame in frames]
                    # Where a joint starts is said first, unless its first frame does so.
                    assert found[len(found) - len(told) :] == told, (file, spec.label)
                    assert len(found) == len(told) + (not told or told[0][0] > 0.0)
                    compared += 1
    assert compared > 20
