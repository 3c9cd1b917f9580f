"""Pictures of a world: 120 points a metre, the origin at (108.5, 356) on this page; its shapes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from daemon.analysis.campaign_worlds import worlds_of_campaign
from grammars.model.behaviour import start_positions
from grammars.model.geometry import Pose2
from grammars.model.movers import with_planar_chain
from grammars.model.scene import Link, SceneObject
from templates import plan_shapes
from templates.picture import SMALL, Drawing, DrivenWay, RunOverlay, draw_world, write_drawing
from templates.picture._drawing import Colour, Disc, Shape, TextLabel
from templates.plan_shapes import MeasuredMark, ShapeRole, trail_shapes
from tests.parts import ROOT
from tests.scene.templates.worlds import box, world


def shapes(figure, group):
    return [item for item in figure.groups[group] if isinstance(item, Shape)]


def discs(figure, group):
    return [item.centre for item in figure.groups[group] if isinstance(item, Disc)]


def words(figure):
    return [i.text for items in figure.groups.values() for i in items if isinstance(i, TextLabel)]


def page(x, y):
    return (108.5 + 120.0 * x, 356.0 - 120.0 * y)


def pages(*points):
    return tuple((round(x, 2), round(y, 2)) for x, y in (page(*point) for point in points))


def driven(*points, clearance=()):
    return (DrivenWay(np.array(points), np.array(clearance), 0.2),)


def test_low_walls_are_told_from_those_that_are_cut():
    figure = draw_world(world())
    low, cut = shapes(figure, "walls")
    assert sorted(low.rings[0])[0] == pytest.approx(page(-0.2, 2.0), abs=0.01)
    assert "low or sill" in words(figure)
    tall = tuple(s for s in world().scene.solids if s.z_max > 1.5)
    without = draw_world(replace(world(), scene=replace(world().scene, solids=tall)))
    assert "low or sill" not in words(without)
    assert [s.fill for s in shapes(without, "walls")] == [cut.fill]


def test_robot_and_waypoints_show_where_they_look():
    figure = draw_world(world())
    body, arrow = shapes(figure, "robot")
    nose, left, right = arrow.rings[0]
    assert len(body.rings[0]) == 4
    c, s = math.cos(0.7), math.sin(0.7)
    assert nose == pytest.approx(page(0.4 + 0.2 * c, 0.3 + 0.2 * s), abs=0.01)
    back = ((left[0] + right[0]) / 2, (left[1] + right[1]) / 2)
    assert back == pytest.approx(page(0.4 - 0.07 * c, 0.3 - 0.07 * s), abs=0.01)
    # Waypoints of one place share a disc; the second one is to be reached at 0.5 rad.
    assert discs(figure, "waypoints") == [
        pytest.approx(page(1.5, 1.5)), pytest.approx(page(3.8, 1.7))
    ]  # fmt: skip
    (look,) = shapes(figure, "waypoints")
    at, ahead = look.rings[0]
    assert at == pytest.approx(page(3.8, 1.7))
    assert math.atan2(at[1] - ahead[1], ahead[0] - at[0]) == pytest.approx(0.5, abs=1e-3)


def test_a_run_is_drawn_where_it_was():
    way = ((0.4, 0.3), (1.0, 0.5), (1.2, 0.9), (1.5, 1.5))
    what = RunOverlay(
        driven(*way, clearance=(1.0, 1.0, 0.1, -0.1)),
        believed=((0.4, 0.4), (1.0, 0.7)),
        contacts=((1.0, 0.5),),
        footprints=(box(0.2, 0.2, 0.6, 0.4), box(1.4, 1.4, 1.6, 1.6)),
        apparent_goals=((1.4, 1.6),),
    )
    figure = draw_world(world(), what)
    first, last, filled, believed, clear, close, touching, cross = shapes(figure, "driven")
    assert first.rings[0] == pages(*what.footprints[0])
    assert last.rings == filled.rings == (pages(*what.footprints[1]),)
    assert [bool(one.fill) for one in (first, last, filled)] == [False, False, True]
    assert believed.rings[0] == pages(*what.believed)
    assert [line.rings for line in (clear, close, touching)] == [
        (pages(*way[a : a + 2]),) for a in range(3)
    ]
    assert all(line.open for line in (believed, clear, close, touching, cross))
    # A cross over the contact, at (228.5, 296).
    assert cross.rings == (((222.5, 290.0), (234.5, 302.0)), ((222.5, 302.0), (234.5, 290.0)))
    assert tuple(discs(figure, "driven")) == pages((1.5, 1.5), (1.4, 1.6))
    key = ["driven", "believed", "inside the buffer", "contact"]
    key += ["footprint, filled at the end", "the waypoint as the robot sees it"]
    assert [w for w in words(figure) if w in key] == key


def test_what_a_run_lacks_is_neither_drawn_nor_in_the_key():
    figure = draw_world(world(), RunOverlay(driven((0.4, 0.3), (1.0, 0.5))))
    assert len(shapes(figure, "driven")) == 1
    key = figure.groups["key"]
    assert [item.text for item in key if isinstance(item, TextLabel)] == ["driven"]
    nowhere = draw_world(world(), RunOverlay(driven((0.4, 0.3)), contacts=((1.0, 0.5),)))
    assert len(shapes(nowhere, "driven")) == 1


@pytest.mark.parametrize("gap", [0.5, 0.02])
def test_what_decides_is_found_and_its_measure_is_on_the_page(gap):
    line = ((1.0, 0.5), (1.0 + gap, 0.5))
    mark = MeasuredMark("wall", line, "0.5 m", (box(1.0 + gap, 0.0, 2.0, 1.0),))
    figure = draw_world(world(), RunOverlay(driven((0.4, 0.3), line[0]), mark=mark, closely=True))
    items = figure.groups["mark"]
    thing, measured = (item for item in items if isinstance(item, Shape))
    assert thing.fill == thing.line == measured.line
    # What is too short to be seen has a circle around it.
    assert tuple(discs(figure, "mark")) == measured.rings[0][: 1 if gap < 0.1 else 2]
    (label,) = (item for item in items if isinstance(item, TextLabel))
    assert 0.0 < label.at[0] < figure.width


def test_a_small_map_has_no_names_and_shows_what_is_near_alone():
    whole = draw_world(world(), style=SMALL)
    assert not {"left", "right", "entrance", "start, cart"} & set(words(whole))
    near = RunOverlay(driven((0.4, 0.3), (0.5, 0.3)), closely=True)
    part = draw_world(world(), near, SMALL)
    assert len(shapes(part, "doors")) < len(shapes(whole, "doors"))
    for shape in (*shapes(part, "walls"), *shapes(part, "floors")):
        corners = np.array([corner for ring in shape.rings for corner in ring])
        assert (corners >= -0.1).all()
        assert (corners <= (part.width + 0.1, part.height + 0.1)).all()


def test_no_name_hides_the_way_and_one_footprint_is_where_it_ends():
    def name_of_room(figure):
        items = figure.groups["space names"]
        (label,) = (i for i in items if isinstance(i, TextLabel) and i.text == "left")
        return label

    free = name_of_room(draw_world(world()))
    x, y = (free.at[0] - 108.5) / 120.0, (356.0 - free.at[1]) / 120.0
    way = driven((x - 0.2, y), (x + 0.2, y))
    figure = draw_world(world(), RunOverlay(way, footprints=(box(0.2, 0.2, 0.6, 0.4),)))
    assert name_of_room(figure).at != free.at
    groups = list(figure.groups)
    assert groups.index("space names") < groups.index("driven") < groups.index("waypoints")
    key = figure.groups["key"]
    said = [item.text for item in key if isinstance(item, TextLabel)]
    assert said == ["driven", "robot at the end of its way"]


def test_the_documentation_shows_the_flat_of_the_demo_as_it_is(tmp_path):
    """``python -m docs.pictures`` draws it again."""
    worlds, _ = worlds_of_campaign(ROOT / "campaigns" / "demo" / "campaign.yaml")
    (busy,) = (w for w in worlds if w.name == "busy-house")
    drawn = write_drawing(draw_world(busy), tmp_path / "flat.svg").read_text(encoding="utf-8")
    assert drawn == (ROOT / "docs" / "flat.svg").read_text(encoding="utf-8")


LETTERS = "−–—×·→←°±²³…∞≤≥µσΩ“”’½äöüßéñçøåłşПж✓✗▶"
"""What we say ourselves (minus, dashes, arrows, units), and letters of names in Europe."""


def painted(text, path, *, bold=False):
    drawing = Drawing(60.0, 40.0, "letters", "")
    drawing.add("words", [TextLabel((30.0, 25.0), text, 20.0, Colour.INK, bold=bold)])
    return write_drawing(drawing, path).read_bytes()


@pytest.mark.parametrize("bold", [False, True])
def test_no_letter_comes_out_as_a_box(tmp_path, bold):
    box = painted("\ue000", tmp_path / "box.png", bold=bold)
    blank = painted(" ", tmp_path / "blank.png", bold=bold)
    for letter in LETTERS:
        shown = painted(letter, tmp_path / "letter.png", bold=bold)
        assert shown not in (box, blank), letter


def test_bold_texts_are_bold(tmp_path):
    plain, bold = (painted("door", tmp_path / "a.png", bold=bold) for bold in (False, True))
    assert plain != bold


def test_a_pdf_has_our_face(tmp_path):
    document = painted("door", tmp_path / "a.pdf")
    assert document.startswith(b"%PDF-")
    assert b"ScenarioSans" in document


# Shapes of a world seen from above, as the terminal draws them.


def trails(found):
    return {s.role: [[(x, y) for x, y in part] for part in s.parts] for s in found}


WAY = ((0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0), (4.0, 0.0))


def test_a_trail_is_cut_where_its_clearance_crosses_the_limit():
    found = trails(list(trail_shapes(WAY, (1.0, 0.9, 0.1, 0.0, math.nan), limit=0.2)))
    assert found == {
        ShapeRole.TRAIL: [[(0.0, 0.0), (1.0, 0.0)]],
        ShapeRole.NEAR_TRAIL: [[(1.0, 0.0), (2.0, 0.0)]],
        ShapeRole.TOUCHING_TRAIL: [[(2.0, 0.0), (3.0, 0.0), (4.0, 0.0)]],
    }


@pytest.mark.parametrize("clearances", [(), (0.1, 0.1), (math.nan,) * 5])
def test_a_trail_of_unknown_clearance_is_one_line(clearances):
    assert trails(list(trail_shapes(WAY, clearances, limit=0.2))) == {ShapeRole.TRAIL: [list(WAY)]}


def test_without_a_limit_only_touching_stands_out():
    found = trails(list(trail_shapes(WAY, (1.0, 0.01, 0.01, 0.01, -0.1))))
    assert set(found) == {ShapeRole.TRAIL, ShapeRole.TOUCHING_TRAIL}
    assert found[ShapeRole.TOUCHING_TRAIL] == [[(3.0, 0.0), (4.0, 0.0)]]


def test_a_point_is_no_trail():
    assert list(trail_shapes(WAY[:1], (0.1,), limit=0.2)) == []


def test_the_spread_holds_two_standard_deviations_along_each_axis():
    shape = plan_shapes.spread_shape(Pose2(1.0, 2.0), (0.04, 0.0, 0.01))
    around = np.asarray(shape.parts[0]) - (1.0, 2.0)
    assert np.abs(around).max(axis=0) == pytest.approx([0.4, 0.2])


def test_waypoints_are_numbered_and_the_first_are_reached():
    mission = world().mission
    assert mission is not None
    found = [(s.role, s.text) for s in plan_shapes.waypoint_shapes(mission, 1)]
    assert found[:2] == [(ShapeRole.REACHED, "1"), (ShapeRole.WAYPOINT, "2")]
    assert len(found) == len(mission.waypoints)


def test_everything_in_the_plan_has_its_role():
    scene = world().scene
    start = start_positions(scene, world().draws[0].behaviours)
    solids = {shape.role for shape in plan_shapes.solid_shapes(scene, 1.2)}
    assert solids == {ShapeRole.WALL, ShapeRole.LOW}
    bodies = {shape.text: shape.role for shape in plan_shapes.body_shapes(scene, start)}
    assert set(bodies) == {thing.name for thing in scene.objects if thing.links[0].polygons}
    assert ShapeRole.DOOR in bodies.values()
    assert [s.text for s in plan_shapes.space_names(scene)] == [r.name for r in scene.regions]


def test_a_plan_leaves_out_what_its_height_does_not_cross():
    scene = world().scene
    start = start_positions(scene, world().draws[0].behaviours)
    assert list(plan_shapes.body_shapes(scene, start, cut=50.0)) == []
    assert list(plan_shapes.solid_shapes(scene, cut=-50.0)) == []


def test_whoever_walks_is_seen_at_any_height_and_named_as_such():
    trunk = Link("trunk", (box(-0.2, -0.1, 0.2, 0.1),), 4.0, 0.0, 0.25)
    links, joints = with_planar_chain((trunk,), (), "trunk")
    cat = SceneObject("tom", "cat", Pose2(1.0, 1.0), links, joints, (0.0, 0.0, 0.0))
    scene = replace(world().scene, objects=(cat,))
    (body,) = plan_shapes.body_shapes(scene, {"tom.x": 2.0}, cut=0.3)
    assert (body.role, body.text) == (ShapeRole.MOVER, "tom")
    assert np.mean(body.parts[0], axis=0) == pytest.approx([3.0, 1.0])
    (name,) = plan_shapes.object_names(scene, {})
    assert name.role is ShapeRole.MOVER_NAME
