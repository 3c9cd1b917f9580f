"""``scenario import``: a walls layer from a map, and what becomes of it."""

import json
import sys
from pathlib import Path

import pytest

from grammars.maps import load_walls
from grammars.model.grid import OccupancyGrid
from grammars.model.map_files import write_map
from tests.scene.maps.imported import house


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path


@pytest.fixture
def map_file(folder):
    return write_map(house(), folder / "office", laser_height=0.2)[1]


def test_it_writes_a_layer_and_says_what_is_in_it(scenario, map_file):
    said = scenario("import", "office.yaml", "-o", "house", "--height", "3 m")
    assert said.code == 0
    plan = load_walls("house.walls.yaml")
    assert {feature.height for feature in plan.features} == {3.0}
    assert len(plan.spaces) == 4
    assert "house.walls.yaml: 9.20 m by 6.20 m" in said.out
    assert "doorways  3: doorway_1 0.90 m" in said.out
    assert "at most 0.00 cells of 0.05 m" in said.out
    assert "floorplan: house" in said.err
    assert "from a map of 0.05 m per cell, 9.2 m by 6.2 m" in Path("house.walls.yaml").read_text()


def test_it_never_writes_over_a_layer_unless_told(scenario, map_file):
    Path("office.walls.yaml").write_text("mine")
    said = scenario("import", "office.yaml")
    assert said.code == 2
    assert "office.walls.yaml: error: is there already" in said.err
    assert Path("office.walls.yaml").read_text() == "mine"
    assert scenario("import", "office.yaml", "--force").code == 0
    first = Path("office.walls.yaml").read_bytes()
    assert scenario("import", "office.yaml", "--force").code == 0
    assert Path("office.walls.yaml").read_bytes() == first


def test_scripts_get_an_object(scenario, map_file):
    body = json.loads(scenario("import", "office.yaml", "--no-doorways", "--json").out)
    assert body["schema"] == "scenario/import/1"
    report = body["report"]
    assert (body["file"], report["spaces"]) == ("office.walls.yaml", ["room_1"])
    assert (report["doorways"], report["directions"]) == ({}, [0.0])


def test_what_cannot_be_imported_is_told(scenario, map_file):
    assert "name the YAML file" in scenario("import", "office.pgm").err
    assert "has no unit" in scenario("import", "office.yaml", "--height", "3").err
    assert "no size" in scenario("import", "office.yaml", "--height", "0 m").err
    grid = house()
    walls = OccupancyGrid(grid.resolution, grid.x, grid.y, grid.cells * 0 + 100)
    write_map(walls, Path("full"), laser_height=0.2)
    assert "full.yaml: error: the map shows no free floor" in scenario("import", "full.yaml").err
    # A map of nav2: what nobody saw is free by its thresholds.
    text = map_file.read_text().replace("free_thresh: 0.196", "free_thresh: 0.25")
    map_file.write_text(text)
    assert "grey 205" in scenario("import", "office.yaml").err


def test_it_says_where_floor_ends_without_a_wall(scenario, folder):
    grid = house()
    cells = grid.cells.copy()
    cells[20:60, 190:192] = -1
    write_map(OccupancyGrid(grid.resolution, grid.x, grid.y, cells), Path("glass"), laser_height=1)
    answer = scenario("import", "glass.yaml")
    assert "open      floor ends without a wall along 2.0 m, most of it at [8.5, 0.0]" in answer.out


def test_drawings_need_an_extra_that_the_message_names(scenario, folder, monkeypatch):
    Path("hall.dxf").write_text("")
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    answer = scenario("import", "hall.dxf")
    assert answer.code == 2
    assert 'pip install "scenario-tui[import]"' in answer.err


def test_a_drawing_that_is_refused_says_what_it_leaves_out(scenario, folder):
    ezdxf = pytest.importorskip("ezdxf")
    drawing = ezdxf.new("R2010", units=6)
    drawing.modelspace().add_line((0, 0), (9, 0), dxfattribs={"layer": "walls", "invisible": 1})
    drawing.saveas("hall.dxf")
    answer = scenario("import", "hall.dxf", "--layer", "wall*", "--standing", "racks")
    assert answer.code == 2
    assert "hall.dxf: warning: what the drawing hides was left out: walls (1)" in answer.err
    assert "error: no layer with lines is named like wall*" in answer.err
