"""The least time of a mission: straight ways from waypoint to waypoint at top speed."""

import math

import pytest

from grammars.model.geometry import Pose2
from grammars.preflight import check_limit
from grammars.text.diagnostics import Where
from tests.scene.preflight.samples import mission

PLACE = Where("campaign.yaml", 4, 1)
# 3 m and 4 m, of which half a metre less at the first waypoint and twice half a metre less then.
TASK = mission((3.0, 0.0), (3.0, 4.0), start=Pose2(0.0, 0.0))


def said(limit, **speeds):
    found = check_limit(TASK, speeds, limit=limit, where=PLACE)
    assert all((d.where, d.severity) == (PLACE, "warning") for d in found)
    return [d.message for d in found]


@pytest.mark.parametrize("speed", [0.5, 1.0, 2.0])
def test_a_limit_is_too_short_for_straight_ways_at_top_speed(speed):
    assert said(5.5 / speed, pilot=speed) == []
    (message,) = said(5.4 / speed, pilot=speed)
    assert message.startswith(f"{5.4 / speed:g} s are too short for mission m: it takes pilot")
    assert message.endswith(f"{5.5 / speed:.1f} s for 5.5 m at {speed:.2f} m/s")


def test_each_system_that_is_too_slow_is_named():
    (message,) = said(5.0, slow=0.5, quick=2.0, walking=1.0)
    assert "slow at least 11.0 s" in message
    assert "walking at least 5.5 s" in message
    assert "quick" not in message


def test_a_system_without_a_speed_says_nothing():
    assert said(0.1, pilot=math.inf) == []
    assert said(0.1) == []


def test_waypoints_side_by_side_take_no_time():
    near = mission((0.4, 0.0), (0.4, 0.9), start=Pose2(0.0, 0.0))
    assert check_limit(near, {"pilot": 0.1}, limit=0.0, where=PLACE) == ()
