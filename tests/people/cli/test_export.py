"""Exporting from the command line: plans, campaigns, one kind, several, all."""

import re
import shutil
import sys
from pathlib import Path

import pytest
import yaml

from grammars.text.plugins import install_command
from scenario_tui.cli import export, invoke
from templates.artefacts import ALL, KINDS


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


@pytest.fixture
def copied(campaigns, tmp_path):
    """A copy of the campaigns, to change them."""
    return shutil.copytree(campaigns, tmp_path / "campaigns")


def test_scenarios_that_look_the_same_share_a_folder(copied, tmp_path, capsys):
    file = copied / "demo" / "campaign.yaml"
    strict = "\n  strict-house:\n    like: open-house\n    oracles: [no-contact]\n"
    file.write_text(file.read_text().replace("\nexpect:", f"{strict}\nexpect:"))
    assert invoke(["export", str(file), "tasks", "-o", str(tmp_path / "out")]) == 0
    folders = {p.name for p in (tmp_path / "out").iterdir()}
    assert folders == {"open-house", "busy-house", "rude-house"}
    printed = {Path(line) for line in capsys.readouterr().out.splitlines()}
    assert printed == {p for p in (tmp_path / "out").rglob("*") if p.is_file()}


def test_every_variant_of_a_plan_is_a_world(copied, tmp_path):
    varied = copied / "demo" / "campaign.yaml"
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


def test_waypoints_are_chosen_on_the_command_line(campaigns, tmp_path):
    plan = campaigns / "demo" / "flat.fpm"
    how = ["--distance", "0.4", "--first", "1", "--closed", "--backward", "--yaw", "path"]
    assert invoke(["export", str(plan), "tasks", "-o", str(tmp_path), *how]) == 0
    task = yaml.safe_load((tmp_path / "tasks" / "bedroom_route.yaml").read_text())
    waypoints = task["task"][0]["waypoints"]
    assert [w["id"][-1] for w in waypoints] == ["1", "0", "3", "2", "1"]
    assert any(w["yaw"] != 0 for w in waypoints)


def test_pictures_need_no_mesh_library(campaigns, tmp_path, monkeypatch, capsys):
    for module in ("trimesh", "manifold3d"):
        monkeypatch.setitem(sys.modules, module, None)
    plan = ["export", str(campaigns / "demo" / "flat.fpm"), "-o", str(tmp_path)]
    assert invoke([*plan, "picture", "map", "tasks"]) == 0
    assert invoke([*plan, "mesh"]) == 2
    assert install_command("cad") in capsys.readouterr().err


def test_a_note_about_every_scenario_is_said_once(demo, tmp_path, capsys):
    assert invoke(["export", str(demo), "tasks", "--distance", "2", "-o", str(tmp_path)]) == 0
    notes = [line for line in capsys.readouterr().err.splitlines() if "no place 2 m" in line]
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
    assert invoke(["check", str(graph)]) == 2
    assert invoke(["export", str(graph), "picture", *base, *out]) == 0
    assert list((tmp_path / "out").rglob("graph.svg")), "it is called like its file"
