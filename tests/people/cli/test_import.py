"""``scenario import``: a walls layer from a map, and what becomes of it."""

import json
import sys
from types import SimpleNamespace

import pytest

from grammars.maps import load_walls
from grammars.model.grid import OccupancyGrid
from grammars.model.map_files import write_map
from tests.scene.maps.imported import house


@pytest.fixture
def folder(place):
    """A folder of maps: of a house, of one with glass in its wall, and of nothing but walls."""
    grid = house()
    write_map(grid, place / "office", laser_height=0.2)
    glass, full = grid.cells.copy(), grid.cells * 0 + 100
    glass[20:60, 190:192] = -1
    for name, cells in (("glass", glass), ("full", full)):
        write_map(
            OccupancyGrid(grid.resolution, grid.x, grid.y, cells), place / name, laser_height=1
        )
    # A map of nav2: what nobody saw is free by its thresholds.
    text = (place / "office.yaml").read_text()
    (place / "grey.yaml").write_text(text.replace("free_thresh: 0.196", "free_thresh: 0.25"))
    turned = text.replace(", 0.0]", ", 90]").replace("resolution", "Resolution: 1\nresolution")
    (place / "turned.yaml").write_text(turned)
    (place / "hall.world").write_text("<sdf version='1.6'/>")
    return place


def test_a_layer_is_written_and_told(folder, transcript):
    (folder / "taken.walls.yaml").write_text("mine")
    transcript("import")
    plan = load_walls("house.walls.yaml")
    assert {feature.height for feature in plan.features} == {3.0}
    assert len(plan.spaces) == 4
    text = (folder / "house.walls.yaml").read_text()
    assert "from a map of 0.05 m per cell, 9.2 m by 6.2 m" in text
    assert (folder / "taken.walls.yaml").read_text() == "mine"


def test_it_writes_over_a_layer_when_it_is_told(scenario, folder):
    (folder / "taken.walls.yaml").write_text("mine")
    written = []
    for _ in range(2):
        assert scenario("import", "office.yaml", "-o", "taken", "--force").code == 0
        written.append((folder / "taken.walls.yaml").read_bytes())
    assert written[0] == written[1] != b"mine"


def test_scripts_get_an_object(scenario, folder):
    body = json.loads(scenario("import", "office.yaml", "--no-doorways", "--json").out)
    assert body["schema"] == "scenario/import/1"
    report = body["report"]
    assert (body["file"], report["spaces"]) == ("office.walls.yaml", ["room_1"])
    assert (report["doorways"], report["directions"]) == ({}, [0.0])


@pytest.mark.parametrize(
    ("origin", "command"),
    [
        (None, "pip install 'scenario-tui[cad]'"),
        ('{"url": "file:///my%20clone", "dir_info": {}}', "pip install '/my clone[cad]'"),
        ('{"url": "file:///c", "dir_info": {"editable": true}}', "pip install -e '/c[cad]'"),
    ],
)
def test_drawings_need_an_extra_from_where_the_program_came(
    scenario, folder, monkeypatch, origin, command
):
    package = SimpleNamespace(read_text=lambda _: origin)
    monkeypatch.setattr("importlib.metadata.distribution", lambda _: package)
    (folder / "hall.dxf").write_text("")
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    answer = scenario("import", "hall.dxf")
    assert answer.code == 2
    assert f"install it with: {command}\n" in answer.err


def test_a_drawing_that_is_refused_says_what_it_leaves_out(scenario, folder):
    ezdxf = pytest.importorskip("ezdxf")
    drawing = ezdxf.new("R2010", units=6)
    drawing.modelspace().add_line((0, 0), (9, 0), dxfattribs={"layer": "walls", "invisible": 1})
    drawing.saveas("hall.dxf")
    answer = scenario("import", "hall.dxf", "--layer", "wall*", "--standing", "racks")
    assert answer.code == 2
    assert "hall.dxf: warning: hidden entities were ignored on layers: walls (1)" in answer.err
    assert "error: no layer with lines matches wall*" in answer.err
