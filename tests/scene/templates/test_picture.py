"""Where things are on a picture: 120 points a metre, the origin at (108.5, 356) on this page."""

import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from daemon.analysis.campaign_worlds import worlds_of_campaign
from templates.picture import SMALL, DrivenWay, RunOverlay, draw_world, write_drawing
from templates.picture._drawing import Disc, Shape, TextLabel
from templates.plan_shapes import MeasuredMark
from tests.scene.templates.worlds import box, world

ROOT = Path(__file__).parents[3]


def shapes(figure, group):
    return [item for item in figure.groups[group] if isinstance(item, Shape)]


def words(figure):
    return [i.text for items in figure.groups.values() for i in items if isinstance(i, TextLabel)]


def page(x, y):
    return (108.5 + 120.0 * x, 356.0 - 120.0 * y)


def pages(*points):
    return tuple((round(x, 2), round(y, 2)) for x, y in (page(*point) for point in points))


def driven(*points, clearance=()):
    return (DrivenWay(np.array(points), np.array(clearance), 0.2),)


def test_a_swing_goes_around_its_hinge_from_limit_to_limit():
    # Hinged at (-0.02, 0.025) of a door at (2.1, 0.5), turned by 30 degrees; the corner of the leaf
    # farthest from there, (0.02, 0.95), is 0.926 m away, at 87.5 degrees when the door is closed.
    area, arc = shapes(draw_world(world()), "swings")[:2]
    hinge, *around = area.rings[0]
    assert hinge == pytest.approx(page(2.0702, 0.5117), abs=0.05)
    assert tuple(around) == arc.rings[0]
    assert arc.open
    seen = [(x - hinge[0], hinge[1] - y) for x, y in around]
    assert [math.hypot(*p) for p in seen] == pytest.approx([0.92586 * 120.0] * len(seen), abs=0.02)
    angles = [math.degrees(math.atan2(y, x)) % 360.0 for x, y in seen]
    assert (angles[0], angles[-1]) == pytest.approx((117.52, 117.52 + math.degrees(1.9)), abs=0.02)
    steps = [b - a for a, b in itertools.pairwise(angles)]
    assert steps == pytest.approx([steps[0]] * len(steps), abs=0.03)


def test_what_slides_is_shown_at_both_ends():
    closed, open_ = (s.rings[0] for s in shapes(draw_world(world()), "swings")[-2:])
    # A panel of 1 m by 4 cm at (1, 1.5), which slides 1 m along the diagonal.
    assert sorted(closed)[0] == pytest.approx(page(0.5, 1.52), abs=0.01)
    assert sorted(closed)[-1] == pytest.approx(page(1.5, 1.48), abs=0.01)
    way = 120.0 * math.sqrt(0.5)
    moved = [(x + way, y - way) for x, y in closed]
    assert [c for p in open_ for c in p] == pytest.approx([c for p in moved for c in p], abs=0.02)


def test_low_walls_are_told_from_those_that_are_cut():
    figure = draw_world(world())
    low, cut = shapes(figure, "walls")
    assert sorted(low.rings[0])[0] == pytest.approx(page(-0.2, 2.0), abs=0.01)
    assert "low or sill" in words(figure)
    scene = world().scene
    tall = tuple(s for s in scene.solids if s.z_max > 1.5)
    assert len(tall) < len(scene.solids)
    without = draw_world(replace(world(), scene=replace(scene, solids=tall)))
    assert "low or sill" not in words(without)
    assert [s.fill for s in shapes(without, "walls")] == [cut.fill]


def test_the_bar_is_as_long_as_it_says():
    figure = draw_world(world())
    bar = sorted(shapes(figure, "scale")[0].rings[0])
    assert bar[-1][0] - bar[0][0] == pytest.approx(120.0)
    assert [w for w in words(figure) if w in ("0", "0.5", "1 m")] == ["0", "0.5", "1 m"]


def test_waypoints_of_one_place_share_a_disc():
    items = draw_world(world()).groups["waypoints"]
    discs = [item.centre for item in items if isinstance(item, Disc)]
    assert discs == [pytest.approx(page(1.5, 1.5)), pytest.approx(page(3.8, 1.7))]


def test_robot_and_waypoints_show_where_they_look():
    figure = draw_world(world())
    body, arrow = shapes(figure, "robot")
    nose, left, right = arrow.rings[0]
    assert len(body.rings[0]) == 4
    c, s = math.cos(0.7), math.sin(0.7)
    assert nose == pytest.approx(page(0.4 + 0.2 * c, 0.3 + 0.2 * s), abs=0.01)
    assert ((left[0] + right[0]) / 2, (left[1] + right[1]) / 2) == (
        pytest.approx(page(0.4 - 0.07 * c, 0.3 - 0.07 * s), abs=0.01)
    )
    # The second waypoint is to be reached at 0.5 rad, the others any way round.
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
    items = figure.groups["driven"]
    ends = [item.centre for item in items if isinstance(item, Disc)]
    assert tuple(ends) == pages((1.5, 1.5), (1.4, 1.6))
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
    discs = [item.centre for item in items if isinstance(item, Disc)]
    # What is too short to be seen has a circle around it.
    assert tuple(discs) == measured.rings[0][: 1 if gap < 0.1 else 2]
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
    """``python -m tests.people.pictures`` draws it again."""
    worlds, _ = worlds_of_campaign(ROOT / "campaigns" / "demo" / "campaign.yaml")
    (busy,) = (w for w in worlds if w.name == "busy-house")
    drawn = write_drawing(draw_world(busy), tmp_path / "flat.svg").read_text(encoding="utf-8")
    assert drawn == (ROOT / "docs" / "flat.svg").read_text(encoding="utf-8")
