"""Walls layers: read, written, refused with the place of what is wrong."""

import pytest

from grammars.maps import (
    Area,
    DrawnBuilding,
    DrawnEntryway,
    DrawnSpace,
    DrawnWall,
    load_walls,
    walls_text,
)
from tests.grammars.maps.houses import hut


def test_a_layer_becomes_a_plan(tmp_path):
    plan = hut(tmp_path)
    assert [space.name for space in plan.spaces] == ["hall", "kitchen"]
    assert plan.spaces[0].holes[0][2] == (2.5, 1.5)
    assert plan.walls == ()
    assert [(f.kind, f.id, f.height) for f in plan.features] == [
        ("wall", "wall_1", 2.5),
        ("wall", "post", 1.0),
    ]
    (gap,) = plan.openings
    assert (gap.walls, gap.width, gap.z_min, gap.z_max) == ((), 1.0, 0.0, 2.0)
    # Inwards is to the right of the way from one jamb to the other, where y = 0 is.
    assert gap.frame.x == pytest.approx(6.2)
    corners = {(round(x, 6), round(y, 6)) for x, y in gap.footprint}
    assert corners == {(6.0, 1.0), (6.0, 2.0), (6.2, 1.0), (6.2, 2.0)}
    assert plan.warnings == ()


def test_what_is_written_reads_back(tmp_path):
    plan = hut(tmp_path)
    building = DrawnBuilding(
        "hut",
        tuple(DrawnSpace(s.name, Area(s.outline, s.holes)) for s in plan.spaces),
        tuple(DrawnWall(Area(f.footprint, f.holes), f.height) for f in plan.features),
        (DrawnEntryway("gap", (6.1, 1.0), (6.1, 2.0), 0.2, 2.0),),
        "Made by hand,\nfor tests",
    )
    text = walls_text(building)
    assert text.startswith("# Made by hand,\n# for tests\nwalls: hut\n")
    assert max(map(len, text.splitlines())) <= 100
    (tmp_path / "again.walls.yaml").write_text(text, encoding="utf-8")
    again = load_walls(tmp_path / "again.walls.yaml")
    assert (again.spaces, again.openings) == (plan.spaces, plan.openings)
    assert [f.footprint for f in again.features] == [f.footprint for f in plan.features]
    assert [f.height for f in again.features] == [2.5, 1.0]


def test_corners_are_written_as_finely_as_it_takes(tmp_path):
    """Rounded to millimetres, this hole would lie across its outline."""
    hole = ((0.0002, 0.1), (0.3, 0.1), (0.3, 0.2), (0.0004, 0.2))
    area = Area(((-0.0002, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0003, 0.15)), (hole,))
    wall = DrawnWall(area, 2.5)
    space = DrawnSpace("yard", Area(((2.0, 0.0), (3.0, 0.0), (3.0, 1.0))))
    path = tmp_path / "fine.walls.yaml"
    fine = Area(((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)), (hole,))
    for one in (wall, DrawnWall(fine, 2.5)):
        path.write_text(walls_text(DrawnBuilding("fine", (space,), (one,))), encoding="utf-8")
        if one is not wall:
            assert load_walls(path).features[0].holes[0][0][0] == pytest.approx(0.0002)
