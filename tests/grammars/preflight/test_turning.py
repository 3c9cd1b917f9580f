"""A body that has to pass and to turn: through gaps, round bends, by its drive."""

import dataclasses
import math
import re
from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.model.geometry import Pose2
from grammars.model.mission import Mission, Waypoint
from grammars.model.scene import Region, Scene
from grammars.preflight import check_run
from tests.grammars.preflight.samples import messages, mission

Kind = Literal["omnidirectional", "differential"]


def box(length, width, ahead=0.0):
    half, side = length / 2, width / 2
    return (
        (half + ahead, side), (ahead - half, side), (ahead - half, -side), (half + ahead, -side),
    )  # fmt: skip


def with_body(robot, footprint, kind="differential"):
    drive = dataclasses.replace(robot.drive, kind=kind)
    return dataclasses.replace(robot, footprint=footprint, drive=drive)


def building(outline):
    return Scene("s", (Region("floor", outline),), (), ())


def bend(width):
    """Return an L of two corridors, from (0, w/2) to (6 - w/2, 6)."""
    inner = 6.0 - width
    return building(
        ((0.0, 0.0), (6.0, 0.0), (6.0, 6.0), (inner, 6.0), (inner, width), (0.0, width))
    )


def gap(width):
    """Return two rooms of 4 m x 4 m that a passage of 1 m joins."""
    low, high = -width / 2, width / 2
    return building((
        (-4.5, -2.0), (-0.5, -2.0), (-0.5, low), (0.5, low), (0.5, -2.0), (4.5, -2.0),
        (4.5, 2.0), (0.5, 2.0), (0.5, high), (-0.5, high), (-0.5, 2.0), (-4.5, 2.0),
    ))  # fmt: skip


def round_the_bend(robot, width):
    return messages(robot, bend(width), mission((6 - width / 2, 4.5), start=Pose2(1.5, width / 2)))


def through_the_gap(robot, width, yaw=0.0):
    return messages(robot, gap(width), mission((2.5, 0.0), start=Pose2(-2.5, 0.0, yaw)))


@given(width=st.floats(0.6, 1.2), share=st.floats(0.4, 0.8), beyond=st.floats(-0.3, 0.4))
def test_a_long_robot_gets_round_a_bend_as_geometry_says(robile, width, share, beyond):
    # A box of this length touches both outer walls and the inner corner, at 45 degrees.
    body = share * width
    longest = 2.0 * (math.sqrt(2.0) * width - body)
    length = longest + beyond
    if not width + 0.05 < length < 2.5:
        return
    said = round_the_bend(with_body(robile, box(length, body)), width)
    # Never a false alarm; what is missed is missed by little.
    if length <= longest:
        assert said == []
    if length > longest + 0.15:
        (text,) = said
        said_near = re.search(
            r"get round to waypoint w0: it cannot turn near \((.+), (.+)\) in", text
        )
        assert said_near
        near = (float(said_near[1]), float(said_near[2]))
        assert math.dist(near, (6.0 - width / 2, width / 2)) < width
        assert text.endswith("in floor (make room for it to turn there or take a shorter robot)")


@pytest.mark.parametrize(
    ("kind", "body", "width", "passes"),
    [
        ("differential", box(0.3, 0.6), 0.58, False),
        ("differential", box(0.3, 0.6), 0.62, True),
        ("omnidirectional", box(0.3, 0.6), 0.32, True),
        ("omnidirectional", box(0.3, 0.6), 0.28, False),
        # The base frame at the front: its nearest side is near, but the robot is as wide.
        ("differential", box(0.7, 0.4, ahead=-0.25), 0.38, False),
        ("differential", box(0.7, 0.4, ahead=-0.25), 0.42, True),
        # A square that drives over its corner is wider across than it is thick.
        ("differential", ((0.3, 0.0), (0.0, 0.3), (-0.3, 0.0), (0.0, -0.3)), 0.55, False),
        ("omnidirectional", ((0.3, 0.0), (0.0, 0.3), (-0.3, 0.0), (0.0, -0.3)), 0.45, True),
    ],
)
def test_how_wide_a_robot_is_depends_on_its_drive(robile, kind, body, width, passes):
    said = through_the_gap(with_body(robile, body, kind), width)
    if passes:
        assert said == []
    else:
        (text,) = said
        assert text.startswith("the way to waypoint w0 is too narrow, robile is 0.")


def test_a_robot_that_fits_only_sideways_is_told_so(robile):
    (text,) = through_the_gap(with_body(robile, box(0.3, 0.6)), 0.5)
    assert "robile is 0.60 m wide across the way it drives" in text


def test_waypoints_that_one_place_keeps_from_the_robot_are_told_together(robile):
    robot = with_body(robile, box(0.3, 0.6))
    task = mission((-1.5, 1.0), (2.5, 0.0), (1.5, 1.0), (3.5, 1.0), start=Pose2(-2.5, 0.0))
    (text,) = messages(robot, gap(0.5), task)
    assert text.startswith("the way to waypoint w1 and 2 more is too narrow")


def test_an_omnidirectional_robot_drives_sideways_round_a_bend_that_it_cannot_turn_in(robile):
    robot = with_body(robile, box(0.9, 0.5), "omnidirectional")
    assert round_the_bend(robot, 0.95) == []


@given(
    width=st.floats(0.2, 1.5),
    length=st.floats(0.2, 1.5),
    room=st.floats(0.2, 1.6),
    yaw=st.floats(-math.pi, math.pi),
)
def test_no_robot_that_passes_is_refused(robile, width, length, room, yaw):
    robot = with_body(robile, box(length, width))
    task = Mission("m", Pose2(-2.5, 0.0, yaw), (Waypoint("w", 2.5, 0.0),))
    said = check_run(gap(room), robot, task, ())
    # Straight through, after turning in rooms that are larger than it.
    if width < room - 0.01:
        assert said == ()
    if width > room + 0.01:
        assert len(said) == 1
