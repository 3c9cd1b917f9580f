"""Exporting from the command line: plans, campaigns, one kind, several, all."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from grammars.floorplan import load_floorplan
from grammars.model.grid import OCCUPIED
from grammars.model.map_files import read_map, write_map
from grammars.scenery.composition import compile_scene
from scenario_tui.cli import export, invoke
from templates.artefacts import ALL, KINDS
from templates.occupancy import occupancy_grid

RULES = ("outline", "touch", "centre")


@pytest.fixture(scope="module")
def demo(campaigns):
    return campaigns / "demo" / "campaign.yaml"


@pytest.fixture(scope="module")
def everything(demo, tmp_path_factory):
    folder = tmp_path_factory.mktemp("everything")
    assert invoke(["export", str(demo), "all", "-o", str(folder)]) == 0
    return folder


def files(folder):
    return {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()}


def test_every_kind_there_is_can_be_asked_for():
    assert {kind.value for kind in export.Artefact} == {ALL, "traces", *KINDS}


def test_a_campaign_has_a_folder_per_scenario(everything):
    assert {p.name for p in everything.iterdir()} == {"open-house", "busy-house", "rude-house"}
    written = files(everything / "busy-house")
    assert {
        "busy-house.svg",
        "busy-house.png",
        "busy-house.prov.ttl",
        "busy-house.foxglove.json",
        "maps/flat.pgm",
        "maps/flat-closed.pgm",
        "maps/flat-ajar.pgm",
        "mesh/flat.glb",
        "gazebo/worlds/busy-house.sdf",
        "gazebo/models/hinged_door/model.sdf",
        "keyframes/kitchen_door.json",
        "keyframes/era/kitchen_door.json",
        "launch/busy-house.launch",
        "tasks/hall_route.yaml",
        "tasks/mission/courier_route.yaml",
    } <= written
    # Doors that are held need none in Gazebo Classic, whose plugin puts them there at once.
    held = files(everything / "open-house")
    assert "keyframes/kitchen_door.json" in held
    assert "keyframes/era/kitchen_door.json" not in held


def test_scenarios_that_look_the_same_share_a_folder(campaigns, tmp_path, capsys):
    text = (campaigns / "demo" / "campaign.yaml").read_text()
    twin = tmp_path / "campaign.yaml"
    strict = "\n  strict-house:\n    like: open-house\n    oracles: [no-contact]\n"
    twin.write_text(text.replace("\nexpect:", f"{strict}\nexpect:"))
    for name in ("demo", "robots", "suts"):
        for path in (campaigns / name).iterdir():
            folder = tmp_path if name == "demo" else tmp_path / name
            folder.mkdir(exist_ok=True)
            if path.is_file() and path.name != "campaign.yaml":
                (folder / path.name).write_bytes(path.read_bytes())
    assert invoke(["export", str(twin), "tasks", "-o", str(tmp_path / "out")]) == 0
    folders = {p.name for p in (tmp_path / "out").iterdir()}
    assert folders == {"open-house", "busy-house", "rude-house"}
    printed = {Path(line) for line in capsys.readouterr().out.splitlines()}
    assert printed == {p for p in (tmp_path / "out").rglob("*") if p.is_file()}


def test_maps_are_those_that_the_campaign_declares(campaigns, tmp_path):
    shutil.copytree(campaigns, tmp_path / "campaigns")
    demo = tmp_path / "campaigns" / "demo" / "campaign.yaml"
    text = "".join(
        line for line in demo.read_text().splitlines(keepends=True) if not line.startswith("map:")
    )
    plan = tmp_path / "campaigns" / "demo" / "flat.fpm"
    scene = compile_scene(load_floorplan(plan), [])

    def exported(map):
        demo.write_text(f"{text}\nmap: {map}\n")
        out = tmp_path / map.strip("{}").split(": ")[1]
        assert invoke(["export", str(demo), "map", "launch", "-o", str(out)]) == 0
        return out / "open-house"

    for rule in RULES:
        found = read_map(exported(f"{{rule: {rule}}}") / "maps" / "flat.yaml").grid
        expected = occupancy_grid(scene, laser_height=0.2, rule=rule)
        assert np.array_equal(found.cells, expected.cells)
    own = occupancy_grid(scene, laser_height=0.2)
    own.cells[:3] = OCCUPIED
    write_map(own, demo.with_name("own"), laser_height=0.2)
    folder = exported("{file: own.yaml}")
    assert np.array_equal(read_map(folder / "maps" / "flat.yaml").grid.cells, own.cells)
    assert {p.name for p in (folder / "maps").iterdir()} == {"flat.yaml", "flat.pgm"}
    assert "maps/flat.yaml" in (folder / "launch" / "open-house.launch").read_text()


def test_every_repeat_with_doors_of_its_own_has_its_world(campaigns, tmp_path):
    shutil.copytree(campaigns, tmp_path / "campaigns")
    first = tmp_path / "campaigns" / "ortega2024" / "first.yaml"
    arguments = ["export", str(first), "keyframes", "sdf", "-o"]
    assert invoke([*arguments, str(tmp_path / "one")]) == 0
    assert "keyframes/door_1.json" in files(tmp_path / "one" / "S2")
    assert not (tmp_path / "one" / "S1" / "keyframes").exists()
    text = first.read_text()
    assert "chance: per campaign" in text
    first.write_text(text.replace("chance: per campaign", "chance: per repeat"))
    assert invoke([*arguments, str(tmp_path / "many"), "--repeats", "2"]) == 0
    many = tmp_path / "many" / "S2"
    worlds = {f for f in files(many) if f.startswith("gazebo/worlds/")}
    assert worlds == {f"gazebo/worlds/S2-repeat-{i}.{e}" for i in (0, 1) for e in ("sdf", "world")}
    doors = [(many / f"keyframes/repeat-{i}/door_1.json").read_text() for i in (0, 1)]
    assert doors[0] != doors[1]


def test_every_variant_of_a_plan_is_a_world(campaigns, tmp_path):
    shutil.copytree(campaigns, tmp_path / "campaigns")
    varied = tmp_path / "campaigns" / "demo" / "campaign.yaml"
    text = varied.read_text().split("  busy-house:")[0]
    vary = "    vary: {floorplan: flat, samples: 2, seed: 11}\n"
    text = text.replace(
        "    floorplan: flat\n    objects: doors\n    behaviours: doors_open\n", vary
    )
    assert vary in text
    varied.write_text(text)
    out = tmp_path / "out"
    assert invoke(["export", str(varied), "map", "prov", "-o", str(out)]) == 0
    worlds = sorted(out.iterdir())
    assert [world.name for world in worlds] == ["open-house@11", "open-house@12"]
    maps = [next(world.glob("*.pgm")).read_bytes() for world in worlds]
    assert maps[0] != maps[1]
    assert "flat.variation" in (worlds[0] / f"{worlds[0].name}.prov.ttl").read_text()


def test_a_composable_plan_gives_the_same_walls(campaigns, tmp_path):
    plan = campaigns / "demo" / "flat.fpm"
    assert invoke(["export", str(plan), "jsonld", "mesh", "-o", str(tmp_path)]) == 0
    composable = tmp_path / "jsonld" / "flat.jsonld"
    again = tmp_path / "again"
    assert invoke(["export", str(composable), "mesh", "-o", str(again)]) == 0
    mesh = "mesh/flat.stl"
    assert (again / mesh).stat().st_size == (tmp_path / mesh).stat().st_size
    # The folder of published files is the same plan.
    folder = str(composable.parent)
    assert invoke(["export", folder, "mesh", "prov", "-o", str(tmp_path / "whole")]) == 0
    assert (tmp_path / "whole" / mesh).read_bytes() == (again / mesh).read_bytes()
    assert "skeleton.json" in (tmp_path / "whole" / "flat.prov.ttl").read_text()


def test_waypoints_are_chosen_on_the_command_line(campaigns, tmp_path):
    plan = campaigns / "demo" / "flat.fpm"
    how = ["--distance", "0.4", "--first", "1", "--closed", "--backward", "--yaw", "path"]
    assert invoke(["export", str(plan), "tasks", "-o", str(tmp_path), *how]) == 0
    task = yaml.safe_load((tmp_path / "tasks" / "bedroom_route.yaml").read_text())
    waypoints = task["task"][0]["waypoints"]
    assert [w["id"][-1] for w in waypoints] == ["1", "0", "3", "2", "1"]
    assert any(w["yaw"] != 0 for w in waypoints)


def test_pictures_need_no_mesh_library(campaigns, tmp_path):
    script = (
        "import sys; sys.modules['trimesh'] = sys.modules['manifold3d'] = None\n"
        "from scenario_tui.cli.command_line import invoke\n"
        "plan, out = sys.argv[1:]\n"
        "assert invoke(['export', plan, 'picture', 'map', 'tasks', '-o', out]) == 0\n"
        "sys.exit(invoke(['export', plan, 'mesh', '-o', out]))\n"
    )
    plan = str(campaigns / "demo" / "flat.fpm")
    done = subprocess.run(
        [sys.executable, "-c", script, plan, str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    assert 'pip install "scenario-tui[mesh]"' in done.stderr


def test_a_note_about_every_scenario_is_said_once(demo, tmp_path, capsys):
    assert invoke(["export", str(demo), "tasks", "--distance", "2", "-o", str(tmp_path)]) == 0
    notes = [line for line in capsys.readouterr().err.splitlines() if "nowhere 2 m" in line]
    assert notes
    assert len(notes) == len(set(notes))
    assert all(note.startswith(f"{demo}: warning: ") for note in notes)


def test_relative_identifiers_have_the_base_they_are_given(demo, tmp_path):
    assert invoke(["export", str(demo.with_name("flat.fpm")), "jsonld", "-o", str(tmp_path)]) == 0
    text = (tmp_path / "jsonld" / "flat.jsonld").read_text("utf-8")
    text = re.sub(r'"@base": "[^"]*",\s*', "", text, count=1)
    absolute = text.replace('"world-frame"', '"http://example.org/flat/world-frame"', 1)
    graph = tmp_path / "graph.jsonld"
    graph.write_text(absolute, "utf-8")
    base = ["--base", "http://example.org/flat/"]
    out = ["-o", str(tmp_path / "out")]
    assert invoke(["check", str(graph)]) == invoke(["export", str(graph), "map", *out]) == 2
    assert invoke(["check", str(graph), *base]) == 0
    assert invoke(["export", str(graph), "map", *base, *out]) == 0
