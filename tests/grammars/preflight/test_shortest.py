"""The least time of a mission: shortest ways through the floor at top speed."""

import math

from hypothesis import given
from hypothesis import strategies as st

from grammars.model.geometry import Pose2
from grammars.model.scene import Region, Scene
from grammars.preflight import check_limit
from grammars.text.diagnostics import Where
from tests.grammars.preflight.samples import mission, scene_with

PLACE = Where("campaign.yaml", 4, 1)
# A U of corridors 2 m wide: its ends are 2 m apart through the wall, and far by the way round.
HORSESHOE = Scene(
    "u",
    (Region("u", ((0.0, 0.0), (6.0, 0.0), (6.0, 10.0), (4.0, 10.0), (4.0, 2.0), (2.0, 2.0),
                  (2.0, 10.0), (0.0, 10.0))),),
    (),
    (),
)  # fmt: skip


def said(robot, scene, limit, speed, *points,
         start):  # fmt: skip
    task = mission(*points, start=start)
    found = check_limit(scene, robot, task, {"pilot": speed}, limit=limit, where=PLACE)
    assert all((d.where, d.severity) == (PLACE, "warning") for d in found)
    return [d.message for d in found]


def horseshoe_way(robot):
    """Return the shortest way from (1, 9) to (5, 9): round two corners, at the robot's radius."""
    radius = min(abs(y) for _, y in robot.footprint)
    # Down to the corner's circle, a quarter round it, and across; twice.
    tangent = math.acos(radius / math.hypot(1.0, 7.0)) + math.atan2(1.0, 7.0)
    down = math.sqrt(1.0 + 49.0 - radius**2)
    return 2.0 * (down + radius * (math.pi - tangent)) + 2.0


def test_the_way_round_is_counted_not_the_straight_one(robile):
    start, goal = Pose2(1.0, 9.0), (5.0, 9.0)
    least = horseshoe_way(robile) - 0.5  # near to the waypoint is enough
    (message,) = said(robile, HORSESHOE, 0.98 * least, 1.0, goal, start=start)
    assert message.startswith(f"{0.98 * least:g} s are too short for mission m: it takes pilot")
    assert said(robile, HORSESHOE, least, 1.0, goal, start=start) == []
    assert said(robile, HORSESHOE, 0.98 * least, 2.0, goal, start=start) == []


@given(x=st.floats(0.5, 1.5), y=st.floats(4.0, 9.0), speed=st.floats(0.1, 2.0))
def test_a_limit_that_a_driven_way_keeps_is_never_too_short(robile, x, y, speed):
    # Through the middle of the corridors: longer than the shortest way, by not very much.
    driven = (y - 1.0) + math.dist((x, 0), (1, 0)) + 4.0 + (9.0 - 1.0)
    start = Pose2(x, y)
    assert said(robile, HORSESHOE, driven / speed, speed, (5.0, 9.0), start=start) == []
    (message,) = said(robile, HORSESHOE, 0.7 * driven / speed, speed, (5.0, 9.0), start=start)
    assert f"at {speed:.2f} m/s" in message


def test_ways_lead_through_doorways(robile):
    # From hall to kitchen: 1.4 m through the wall, about 4.7 m through the doorway at x = 0.5.
    start, goal = Pose2(-1.5, 1.5), (-1.5, 2.9)
    (message,) = said(robile, scene_with(""), 3.0, 1.0, goal, start=start)
    assert "at least 3." in message
    assert said(robile, scene_with(""), 5.0, 1.0, goal, start=start) == []


def test_a_system_without_a_speed_says_nothing(robile):
    assert said(robile, HORSESHOE, 0.1, math.inf, (5.0, 9.0), start=Pose2(1.0, 9.0)) == []
    task = mission((5.0, 9.0), start=Pose2(1.0, 9.0))
    assert check_limit(HORSESHOE, robile, task, {}, limit=0.1, where=PLACE) == []
