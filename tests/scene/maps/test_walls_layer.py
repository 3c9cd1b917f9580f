"""Walls layers: read, written, refused with the place of what is wrong."""

import pytest

from grammars.maps import WallsText, load_walls, walls_text
from grammars.text.documents import parse_yaml, read_model
from tests.scene.maps.houses import HUT, hut


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
    text = walls_text(read_model(parse_yaml(HUT, "hut.walls.yaml"), WallsText))
    assert text.startswith(
        "walls: hut\nheight: 2.5 m\nspaces:\n  hall:\n    outline:\n    - [0.0, 0.0]"
    )
    assert "    from: [6.1, 1.0]\n    to: [6.1, 2.0]\n    depth: 0.2 m\n" in text
    (tmp_path / "again.walls.yaml").write_text(text, encoding="utf-8")
    assert load_walls(tmp_path / "again.walls.yaml") == hut(tmp_path)
