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
from templates.plan_shapes import MeasuredMark, trail_shapes
from templates.world import BehaviourDraw
from tests.parts import ROOT
from tests.scene.templates.worlds import BEHAVIOURS, box, scene, walker, world


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
    """``python -m campaigns.studies.pictures`` draws it again."""
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

WAY = ((0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0), (4.0, 0.0))


def cat_at_home():
    """Return the world with a cat, low and at (1, 1), instead of its things."""
    trunk = Link("trunk", (box(-0.2, -0.1, 0.2, 0.1),), 4.0, 0.0, 0.25)
    links, joints = with_planar_chain((trunk,), (), "trunk")
    cat = SceneObject("tom", "cat", Pose2(1.0, 1.0), links, joints, (0.0, 0.0, 0.0))
    return replace(scene(), objects=(cat,))


def test_shapes_of_a_plan_and_of_trails(golden):
    start = start_positions(scene(), BEHAVIOURS)
    shapes = {
        "solids": plan_shapes.solid_shapes(scene(), 1.2),
        "solids, cut below the floor": plan_shapes.solid_shapes(scene(), cut=-50.0),
        "names of spaces": plan_shapes.space_names(scene()),
        "bodies": plan_shapes.body_shapes(scene(), start),
        "bodies, cut above all": plan_shapes.body_shapes(scene(), start, cut=50.0),
        "names of objects": plan_shapes.object_names(scene(), start),
        "a cat 2 m further, seen at any height": plan_shapes.body_shapes(
            cat_at_home(), {"tom.x": 2.0}, cut=0.3
        ),
        "its name": plan_shapes.object_names(cat_at_home(), {}),
        "waypoints, the first of them reached": plan_shapes.waypoint_shapes(world().mission, 1),
        "a trail, near below 0.2 m": trail_shapes(WAY, (1.0, 0.9, 0.1, 0.0, math.nan), limit=0.2),
        "a trail without a limit": trail_shapes(WAY, (1.0, 0.01, 0.01, 0.01, -0.1)),
        "a trail of too few clearances": trail_shapes(WAY, (0.1, 0.1), limit=0.2),
        "a trail of unknown clearances": trail_shapes(WAY, (math.nan,) * 5, limit=0.2),
        "a trail of one point": trail_shapes(WAY[:1], (0.1,), limit=0.2),
    }
    golden("shapes.txt", "\n".join(f"=== {what}\n{lines_of(all)}" for what, all in shapes.items()))


def lines_of(shapes):
    lines = []
    for shape in shapes:
        lines.append(f"{shape.role.name} {shape.text}".rstrip())
        parts = (np.round(np.asarray(part), 3) + 0.0 for part in shape.parts)
        lines += ["    " + " ".join(f"({x:g}, {y:g})" for x, y in part) for part in parts]
    return "".join(f"{line}\n" for line in lines)


def test_the_spread_holds_two_standard_deviations_along_each_axis():
    shape = plan_shapes.spread_shape(Pose2(1.0, 2.0), (0.04, 0.0, 0.01))
    around = np.asarray(shape.parts[0]) - (1.0, 2.0)
    assert np.abs(around).max(axis=0) == pytest.approx([0.4, 0.2])
