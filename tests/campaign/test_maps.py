"""The map of a campaign: drawn by a rule, or one of its own."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from daemon.campaign import examine, expand, load_campaign
from daemon.model.attachments import user_files_folder
from daemon.model.spec import MapSettings, RunSpec
from daemon.run_map import MapMissingError, run_map, stored_map
from grammars.floorplan import load_floorplan
from grammars.model.grid import FREE, OCCUPIED, UNKNOWN
from grammars.model.map_files import write_map
from grammars.scenery.composition import compile_scene
from grammars.text import codec
from grammars.text.diagnostics import Severity
from templates.occupancy import occupancy_grid

CAMPAIGN = """\
campaign: flat
seed: 7
repeats: 1
limit: 5 s
robot: courier
matrix: {{sut: [pilot]}}
oracles: navigation
{map}
scenarios:
  A: {{floorplan: flat, mission: courier, oracles: [reached]}}
  B: {{like: A{override}}}
"""


@pytest.fixture
def folder(tmp_path, campaigns, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for path in (campaigns / "demo").iterdir():
        if path.suffix in (".fpm", ".yaml") and path.name != "campaign.yaml":
            shutil.copy(path, tmp_path)
    shutil.copy(campaigns / "robots" / "courier.yaml", tmp_path)
    return tmp_path


def written(folder, map="", override=""):
    path = folder / "campaign.yaml"
    path.write_text(CAMPAIGN.format(map=map, override=override))
    return path


def specs(folder, map="", override=""):
    return expand(load_campaign(written(folder, map, override))).specs


def drawn(folder):
    scene = compile_scene(load_floorplan(folder / "flat.fpm"), [])
    return scene, occupancy_grid(scene, laser_height=0.2)


def warnings(folder, map="map: {file: own.yaml}"):
    found = examine(written(folder, map))[1]
    assert not [d for d in found if d.severity is Severity.ERROR]
    return [str(d).replace(f"{folder}/", "") for d in found]


def test_a_map_is_drawn_by_outline_unless_the_campaign_says_otherwise(folder):
    assert {run.map.rule for run in specs(folder)} == {"outline"}
    first, second = specs(folder, "map: {rule: touch}", ", map: {rule: centre}")
    assert (first.map, second.map) == (MapSettings(rule="touch"), MapSettings(rule="centre"))
    assert len({run.digest for run in (first, second)}) == 2


def test_what_was_recorded_before_there_were_rules_is_drawn_by_touch(folder):
    (spec, _) = specs(folder)
    plain = codec.to_plain(spec)
    plain["map"] = {"resolution": 0.05, "doors": "none"}
    old = codec.from_json(RunSpec, json.dumps(plain))
    assert old.map == MapSettings(0.05, "none", "touch", "")
    scene, _ = drawn(folder)
    grid = run_map(old.map, scene, 0.2, {})
    expected = occupancy_grid(scene, laser_height=0.2, rule="touch")
    assert np.array_equal(grid.cells, expected.cells)


@pytest.mark.parametrize("doors", ["none", "initial"])
def test_who_writes_into_a_map_leaves_that_of_the_next_run_alone(folder, doors):
    scene, _ = drawn(folder)
    settings = MapSettings(doors=doors)
    first = run_map(settings, scene, 0.2, {})
    kept = first.cells.copy()
    first.cells[:] = OCCUPIED
    assert np.array_equal(run_map(settings, scene, 0.2, {}).cells, kept)


def test_a_map_of_ones_own_is_the_one_of_the_run(folder):
    scene, grid = drawn(folder)
    cells = grid.cells.copy()
    cells[5, 7] = OCCUPIED
    own = replace(grid, cells=cells)
    write_map(own, folder / "own", laser_height=0.2)
    first, second = specs(folder, override=", map: {file: own.yaml}")
    assert (first.map.file, second.map.resolution) == ("", 0.05)
    assert second.files == (second.map.file,)
    given = run_map(second.map, scene, 0.2, {})
    assert np.array_equal(given.cells, cells)
    assert (given.x, given.y, given.resolution) == (grid.x, grid.y, grid.resolution)


def test_a_run_is_known_by_the_content_of_its_map_not_by_its_place(folder):
    _, grid = drawn(folder)
    (folder / "maps").mkdir()
    write_map(grid, folder / "own", laser_height=0.2)
    write_map(grid, folder / "maps" / "other", laser_height=0.7)
    here = specs(folder, "map: {file: own.yaml}")
    assert specs(folder, "map: {file: maps/other.yaml}") == here
    write_map(replace(grid, x=grid.x + 0.05), folder / "own", laser_height=0.2)
    there = specs(folder, "map: {file: own.yaml}")
    assert {run.digest for run in there}.isdisjoint(run.digest for run in here)


def test_a_map_that_is_gone_or_damaged_is_told(folder):
    _, grid = drawn(folder)
    write_map(grid, folder / "own", laser_height=0.2)
    (spec, _) = specs(folder, "map: {file: own.yaml}")
    kept = user_files_folder() / spec.map.file
    kept.chmod(0o600)
    kept.write_bytes(kept.read_bytes()[:-1])
    with pytest.raises(MapMissingError, match="is not the map .* any more: remove it"):
        stored_map(spec.map.file)
    kept.unlink()
    with pytest.raises(MapMissingError, match="cannot be read.*loading its campaign again"):
        stored_map(spec.map.file)


def test_the_map_of_the_building_itself_gives_no_warnings(folder):
    _, grid = drawn(folder)
    write_map(grid, folder / "own", laser_height=0.2)
    assert warnings(folder) == warnings(folder, "")


def test_a_start_and_waypoints_that_are_not_free_are_told(folder):
    scene, grid = drawn(folder)
    missions = {w.id: (w.x, w.y) for w in load_campaign(written(folder)).cells[0].mission.waypoints}
    cells = grid.cells.copy()
    (first, at_first), (second, at_second) = list(missions.items())[:2]
    for point, value in ((at_first, OCCUPIED), (at_second, UNKNOWN), ((0.0, 0.0), UNKNOWN)):
        row, column = (
            int((p - o) / 0.05) for p, o in zip(point[::-1], (grid.y, grid.x), strict=True)
        )
        assert cells[row, column] == FREE
        cells[row, column] = value
    write_map(replace(grid, cells=cells), folder / "own", laser_height=0.2)
    found = "\n".join(warnings(folder))
    assert f"waypoint {first} ({at_first[0]:g}, {at_first[1]:g}) lies on an occupied cell" in found
    assert f"waypoint {second} ({at_second[0]:g}, {at_second[1]:g}) lies on an unknown" in found
    assert "courier.mission.yaml" in found
    assert scene.name not in found


def test_a_map_that_lies_beside_the_building_is_told(folder):
    scene, grid = drawn(folder)
    write_map(replace(grid, x=grid.x + 40.0), folder / "own", laser_height=0.2)
    found = warnings(folder)
    assert any("the start (0, 0) lies outside of the map" in one for one in found)
    (beside,) = [one for one in found if "of the occupied cells" in one]
    assert beside.startswith("campaign.yaml:8:7: warning: 0% of the occupied cells of the map lie")
    assert f"what stands in {scene.name}" in beside
    cells = grid.cells.copy()
    cells[cells == FREE] = 40
    write_map(replace(grid, cells=cells), folder / "own", laser_height=0.2)
    assert any("but in between" in one for one in warnings(folder))
    empty = np.full_like(grid.cells, FREE)
    write_map(replace(grid, cells=empty), folder / "own", laser_height=0.2)
    assert any("no cell of the map is occupied" in one for one in warnings(folder))
