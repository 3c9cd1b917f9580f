"""Pictures of a world and of runs in it, letters, and the shapes that terminals draw."""

import math
from dataclasses import replace

import numpy as np
import pytest

from daemon.analysis.campaign_worlds import worlds_of_campaign
from grammars.model.behaviour import Walk, start_positions
from grammars.model.geometry import Pose2
from grammars.model.movers import with_planar_chain
from grammars.model.scene import Link, SceneObject
from templates import plan_shapes
from templates.picture import SMALL, Drawing, DrivenWay, RunOverlay, draw_world, write_drawing
from templates.picture._drawing import Colour, Shape, TextLabel
from templates.picture._page import FILE
from templates.plan_shapes import MeasuredMark, ShapeRole, trail_shapes
from templates.world import BehaviourDraw
from tests.parts import ROOT
from tests.scene.templates.worlds import box, scene, walker, world


def driven(*points, clearance=()):
    return (DrivenWay(np.array(points), np.array(clearance), 0.2),)


def closely(gap):
    """Return a run that is measured at a place, shown from near."""
    line = ((1.0, 0.5), (1.0 + gap, 0.5))
    mark = MeasuredMark("wall", line, "0.5 m", (box(1.0 + gap, 0.0, 2.0, 1.0),))
    return RunOverlay(driven((0.4, 0.3), line[0]), mark=mark, closely=True)


RUN = RunOverlay(
    driven((0.4, 0.3), (1.0, 0.5), (1.2, 0.9), (1.5, 1.5), clearance=(1.0, 1.0, 0.1, -0.1)),
    believed=((0.4, 0.4), (1.0, 0.7)),
    contacts=((1.0, 0.5),),
    footprints=(box(0.2, 0.2, 0.6, 0.4), box(1.4, 1.4, 1.6, 1.6)),
    apparent_goals=((1.4, 1.6),),
)
BRIEF = RunOverlay(driven((0.4, 0.3), (1.0, 0.5)), footprints=(box(0.2, 0.2, 0.6, 0.4),))
CROWD = replace(
    world("crowd", BehaviourDraw("", (Walk("walker", ((1.0, 0.3), (1.8, 0.3), (1.8, 1.7)), 1.0),))),
    scene=replace(scene(), objects=(*scene().objects, walker())),
)
WITHOUT_LOW_WALLS = replace(
    world(), scene=replace(scene(), solids=tuple(s for s in scene().solids if s.z_max > 1.5))
)
PICTURES = {
    "world": (world(), None, FILE),
    "high-walls": (WITHOUT_LOW_WALLS, None, FILE),
    "crowd": (CROWD, None, FILE),
    "run": (world(), RUN, FILE),
    "brief-run": (world(), BRIEF, FILE),
    "mark": (world(), closely(0.5), FILE),
    "tiny-mark": (world(), closely(0.02), FILE),
    "small": (world(), None, SMALL),
    "small-near": (world(), RunOverlay(driven((0.4, 0.3), (0.5, 0.3)), closely=True), SMALL),
}


@pytest.mark.parametrize("name", PICTURES)
def test_pictures_of_a_world_and_of_runs(tmp_path, golden, name):
    what, run, style = PICTURES[name]
    picture = write_drawing(draw_world(what, run, style), tmp_path / "picture.svg")
    golden(f"pictures/{name}.svg", picture.read_text("utf-8"))


def test_a_way_of_one_point_is_not_drawn():
    what = RunOverlay(driven((0.4, 0.3)), contacts=((1.0, 0.5),))
    figure = draw_world(world(), what)
    assert len([item for item in figure.groups["driven"] if isinstance(item, Shape)]) == 1


def test_no_name_hides_the_way():
    def place_of_left(figure):
        items = figure.groups["space names"]
        (label,) = (i for i in items if isinstance(i, TextLabel) and i.text == "left")
        return label.at

    free = place_of_left(draw_world(world()))
    x, y = (free[0] - 108.5) / 120.0, (356.0 - free[1]) / 120.0
    figure = draw_world(world(), RunOverlay(driven((x - 0.2, y), (x + 0.2, y))))
    assert place_of_left(figure) != free


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
    assert painted("door", tmp_path / "a.png", bold=not bold) != (
        painted("door", tmp_path / "b.png", bold=bold)
    )


def test_a_pdf_has_our_face(tmp_path):
    document = painted("door", tmp_path / "a.pdf")
    assert document.startswith(b"%PDF-")
    assert b"ScenarioSans" in document


# Shapes of a world seen from above, as the terminal draws them.


def trails(found):
    return {s.role: [[(x, y) for x, y in part] for part in s.parts] for s in found}


WAY = ((0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0), (4.0, 0.0))


def test_a_trail_is_cut_where_its_clearance_crosses_the_limit():
    found = trails(trail_shapes(WAY, (1.0, 0.9, 0.1, 0.0, math.nan), limit=0.2))
    assert found == {
        ShapeRole.TRAIL: [[(0.0, 0.0), (1.0, 0.0)]],
        ShapeRole.NEAR_TRAIL: [[(1.0, 0.0), (2.0, 0.0)]],
        ShapeRole.TOUCHING_TRAIL: [[(2.0, 0.0), (3.0, 0.0), (4.0, 0.0)]],
    }


@pytest.mark.parametrize("clearances", [(), (0.1, 0.1), (math.nan,) * 5])
def test_a_trail_of_unknown_clearance_is_one_line(clearances):
    assert trails(trail_shapes(WAY, clearances, limit=0.2)) == {ShapeRole.TRAIL: [list(WAY)]}
    assert list(trail_shapes(WAY[:1], clearances, limit=0.2)) == []


def test_without_a_limit_only_touching_stands_out():
    found = trails(trail_shapes(WAY, (1.0, 0.01, 0.01, 0.01, -0.1)))
    assert set(found) == {ShapeRole.TRAIL, ShapeRole.TOUCHING_TRAIL}
    assert found[ShapeRole.TOUCHING_TRAIL] == [[(3.0, 0.0), (4.0, 0.0)]]


def test_the_spread_holds_two_standard_deviations_along_each_axis():
    shape = plan_shapes.spread_shape(Pose2(1.0, 2.0), (0.04, 0.0, 0.01))
    around = np.asarray(shape.parts[0]) - (1.0, 2.0)
    assert np.abs(around).max(axis=0) == pytest.approx([0.4, 0.2])


def test_waypoints_are_numbered_and_the_first_are_reached():
    mission = world().mission
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
