"""Routes of movers: what they may pass, at which height, and what they cover on the way."""

import pytest

from grammars.model.behaviour import Hold, Jump, KeyFrame, KeyFrames, Walk
from grammars.model.geometry import Pose2
from tests.scene.preflight.samples import DOOR, PERSON, messages, mission, scene_with

TASK = mission((3, -1.5), start=Pose2(-4, -1.5))
MOVE = "nothing stops a mover but the robot: move the route"


def found(objects, *route, **how):
    walk = Walk("v", route, 1.0, **how)
    return messages(objects, TASK, walk)


def test_who_walks_round_also_goes_from_the_last_point_to_the_first():
    route = ((-3.0, 0.0), (0.5, 0.0), (0.5, 4.0))
    through = "v walks through hall-wall-0 and kitchen-wall-2 (lead the route through a doorway)"
    assert found(PERSON, *route, manner="round") == [through]
    assert found(PERSON, *route, manner="back-and-forth") == []


@pytest.mark.parametrize(
    ("low", "high", "met"),
    [
        ("0 m", "0.2 m", True),
        ("1.6 m", "2 m", True),
        ("1.7 m", "2 m", False),
        ("2 m", "3 m", False),
    ],
)
def test_what_hangs_above_a_mover_is_not_met(low, high, met):
    board = f"object board link top box 1 m x 1 m from {low} to {high}, mass 9 kg\n"
    texts = found(PERSON + board + "b is a board at hall", (-3.0, 0.2), (3.0, 0.2))
    assert texts == [f"? v walks through b on its way ({MOVE})"] * met


def test_what_stands_below_a_mover_is_not_met():
    flying = PERSON.replace("from 0 m to 1.7 m", "from 1 m to 1.7 m")
    for high, met in (("0.9 m", False), ("1 m", False), ("1.1 m", True)):
        low = f"object low link top box 1 m x 1 m from 0 m to {high}, mass 9 kg\n"
        texts = found(flying + low + "b is a low in hall, y 0.5 m", (-3, 0.2), (3, 0.2))
        assert (texts == [f"? v walks through b on its way ({MOVE})"]) is met


def test_who_keeps_a_radius_away_from_a_wall_does_not_brush_it():
    assert found(PERSON, (-3.0, 1.75), (3.0, 1.75)) == []
    brushes = f"? v brushes hall-wall-0 on its way ({MOVE})"
    assert found(PERSON, (-3.0, 1.78), (3.0, 1.78)) == [brushes]
    corner = ((-4.8, -1.0), (-4.8, 1.9), (-3.0, 1.9))
    assert found(PERSON, *corner) == [
        f"? v brushes hall-wall-0 and hall-wall-3 on its way ({MOVE})"
    ]


def test_a_long_body_is_wide_where_it_turns():
    cart = "mover cart link body box 1 m x 0.3 m from 0 m to 1 m, mass 20 kg\nv is a cart at hall\n"
    assert found(cart, (-3.0, 1.6), (3.0, 1.6)) == []
    sideways = found(cart, (-3.0, 1.6), (3.0, 1.6), facing="sideways")
    assert sideways == [f"? v brushes hall-wall-0 on its way ({MOVE})"]
    assert found(cart, (-3.0, 1.6), (3.0, 1.6), facing="fixed") == []


# 1 m of cart ahead of the body, joined to it; the arm beside it folds out to the left.
NURSE = """
mover nurse
    link body circle radius 25 cm from 0 m to 1.7 m, mass 75 kg
    link cart box 1 m x 0.4 m at (0.8 m, 0 m) from 0 m to 1 m, mass 20 kg
    link arm box 10 cm x 10 cm at (0 m, 0.3 m) from 1 m to 1.2 m, mass 2 kg
    joint grip fixed from body to cart
    joint shoulder prismatic from body to arm along y, between 0 m and 1 m
v is a nurse in hall, x -3 m
"""


def test_what_a_mover_carries_goes_through_no_wall_unseen():
    brushes = f"? v brushes hall-wall-1 on its way ({MOVE})"
    assert found(NURSE, (-3.0, 0.0), (3.6, 0.0)) == []
    assert found(NURSE, (-3.0, 0.0), (3.95, 0.0)) == [brushes]


def test_what_a_mover_carries_meets_what_stands():
    for high, met in (("0.9 m", True), ("1.2 m", False)):
        low, top = ("0 m", high) if met else ("1 m", high)
        board = f"object board link top box 20 cm x 20 cm from {low} to {top}, mass 9 kg\n"
        texts = found(NURSE + board + "b is a board at hall", (-3, 0), (-1.2, 0))
        assert texts == [f"? v walks through b on its way ({MOVE})"] * met


def test_what_a_mover_carries_swings_where_it_turns_round():
    ends = ((-3.0, 0.9), (3.0, 0.9))
    assert found(NURSE, *ends) == []
    brushes = f"? v brushes hall-wall-0 on its way ({MOVE})"
    assert found(NURSE, *ends, manner="back-and-forth") == [brushes]
    assert found(NURSE, *ends, manner="back-and-forth", facing="sideways") == [brushes]
    fixed = {"manner": "back-and-forth", "facing": "fixed"}
    assert found(NURSE, *ends, **fixed) == []


def test_what_a_mover_carries_is_where_a_behaviour_sends_it():
    route = Walk("v", ((-3.0, 1.2), (3.0, 1.2)), 1.0)
    out = KeyFrames("v.shoulder", (KeyFrame(0.0, 0.0), KeyFrame(5.0, 0.8)), Jump())
    scene = scene_with(NURSE)
    assert messages(scene, TASK, route) == []
    (brushes,) = messages(scene, TASK, route, out)
    assert "v brushes hall-wall-0" in brushes


def test_nothing_is_missed_between_the_points_of_a_long_way():
    pin = "object pin link top box 4 cm x 4 cm from 0 m to 1 m, mass 1 kg\n"
    for x in (-3.1, -1.03, 0.02, 1.07, 3.1):
        texts = found(PERSON + pin + f"b is a pin in hall, x {x} m, y 0.22 m",
                      (-3.0, 0.0), (3.0, 0.0))  # fmt: skip
        assert texts == [f"? v walks through b on its way ({MOVE})"]


def test_a_doorway_is_a_room_to_a_mover_and_a_wall_is_not():
    assert found(PERSON, (0.5, 1.0), (0.5, 2.2), (0.5, 3.0)) == []
    (wrong,) = found(PERSON, (0.5, 1.0), (1.5, 2.1))
    assert wrong == "point 2 of the route of v (1.5, 2.1) is inside of hall-wall-0 (move it)"


def test_movers_that_cannot_walk_are_told_apart():
    line = ((0.0, 0.0), (1.0, 0.0))
    assert found(DOOR + "v is a slider in way_out, sliding left", *line) == [
        "v cannot walk, it is an object, not a mover"
    ]
    assert found(PERSON.rstrip() + ", frozen", *line) == ["v cannot walk, it is frozen"]
    assert found(PERSON.replace("v is", "w is"), *line) == [
        'there is no object "v" (known here: w)'
    ]


def test_one_body_has_one_behaviour():
    scene = scene_with(PERSON)
    walk = Walk("v", ((-4.0, 0.0), (0.0, 0.0)), 1.0)
    assert messages(scene, TASK, Hold("v.x", 0.0), walk) == ["v has two behaviours (one must go)"]
    assert messages(scene, TASK, walk, walk)[0] == "v has two behaviours (one must go)"


def test_a_door_that_stays_shut_is_walked_through_and_one_that_moves_is_not():
    scene, walk = scene_with(PERSON + DOOR), Walk("v", ((0.5, 1.0), (0.5, 3.0)), 1.0)
    assert messages(scene, TASK, walk) == []
    through = [f"? v walks through d on its way ({MOVE})"]
    assert messages(scene, TASK, walk, Hold("d.hinge", 0.0)) == through
    # Held open its leaf is out of the way.
    opened = next(b for b in scene.objects if b.name == "d").joints[0]
    far = max((opened.lower, opened.upper), key=abs)
    assert messages(scene, TASK, walk, Hold("d.hinge", far)) == []
