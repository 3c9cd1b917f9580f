"""The doors of the published worlds: a kilogram on a frictionless hinge, plugins of Gazebo Classic.

Figures derived from the plugins' settings: a spring of 0.5 N m/rad on 0.30 kg m^2.
"""

from __future__ import annotations

import math

import pytest

from daemon.simulator import World
from grammars.model.behaviour import Behaviour, Jump, KeyFrame, KeyFrames, Spring, Trigger
from grammars.model.geometry import Pose2, Twist2
from tests.daemon.simulator.scenes import door, world
from tests.daemon.simulator.test_imposed import IMPOSED

INERTIA = (0.93**2 + 0.05**2) / 12.0 + 0.475**2 + 0.025**2
QUARTER = 0.5 * math.pi * math.sqrt(INERTIA / 0.5)
"""A quarter of the period of the swinging door [s]."""

FAR = Pose2(-10.0, 0.0, 0.0)


def leaf(behaviour: Behaviour, *, start: Pose2 = FAR, pose: Pose2 = Pose2()) -> World:  # noqa: B008
    return world(
        door("d", pose, mass=1.0), robot=IMPOSED, start=start, behaviours=(behaviour,)
    )  # fmt: skip


def angles(simulated: World, seconds: float) -> list[float]:
    """The angle of the door at every tick of some seconds, from now on."""
    found = []
    for _ in range(round(seconds * 100)):
        found.append(float(simulated.joint_positions()[0]))
        simulated.advance(1)
    return found


def triggered(**options: float | None) -> Trigger:
    return Trigger("d.hinge", 1.4, 0.0, 1.3, Spring(0.5), of="foot", **options)  # type: ignore[arg-type]


def test_the_quarter_period_is_that_of_the_published_door() -> None:
    assert pytest.approx(1.22, abs=0.01) == QUARTER


def test_a_door_at_rest_falls_shut_in_a_quarter_of_a_period() -> None:
    simulated = leaf(triggered(), start=Pose2(1.28, 0.0, 0.0))
    trail = angles(simulated, 3.0)
    assert trail[0] == 1.4
    shut = next(k for k, angle in enumerate(trail) if angle <= 0.0)
    assert shut / 100 == pytest.approx(1.22, abs=0.03)
    assert max(abs(angle) for angle in trail[shut + 5 :]) < 0.1  # the stop gives way a little


def test_it_falls_shut_from_any_angle_in_the_same_time() -> None:
    for start in (0.8, 2.0):
        behaviour = Trigger("d.hinge", start, 0.0, 1.3, Spring(0.5), of="foot")
        trail = angles(leaf(behaviour, start=Pose2(1.28, 0.0, 0.0)), 2.0)
        shut = next(k for k, angle in enumerate(trail) if angle <= 0.0)
        assert shut / 100 == pytest.approx(1.22, abs=0.03)


def test_a_door_that_begins_shut_is_thrown_to_its_stop_and_swings_for_ever() -> None:
    trail = angles(leaf(triggered(begin=0.0)), 120.0)
    assert trail[0] == 0.0
    passed = next(k for k, angle in enumerate(trail) if angle >= 1.4)
    stopped = next(k for k, angle in enumerate(trail) if angle >= 1.99)
    assert passed / 100 == pytest.approx(1.22, abs=0.03)
    assert stopped / 100 == pytest.approx(1.56, abs=0.03)
    for part in (trail[200:700], trail[-500:]):
        assert min(part) == pytest.approx(0.8, abs=0.05)
        assert max(part) == pytest.approx(2.0, abs=0.05)
    rising = [k for k in range(200, len(trail)) if trail[k - 1] < 1.4 <= trail[k]]
    period = (rising[-1] - rising[0]) / (len(rising) - 1) / 100
    assert period == pytest.approx(4.0 * QUARTER, abs=0.02)


def test_the_distance_counts_from_the_foot_of_the_post() -> None:
    simulated = leaf(triggered(), start=Pose2(0.0, -2.0, 0.0))
    simulated.command(Twist2(0.0, 0.5098, 0.0))
    while not (events := simulated.take_events()):
        before = simulated.pose()
        simulated.advance(1)
    assert math.hypot(before.x, before.y) == pytest.approx(1.3, abs=0.006)
    assert len(events) == 1
    simulated.command(Twist2(0.0, -0.5098, 0.0))
    simulated.advance(1000)
    assert simulated.take_events() == ()
    assert simulated.joint_positions()[0] == pytest.approx(0.0, abs=0.1)


def test_a_jumped_door_hangs_loose_until_its_next_key_frame() -> None:
    frames = (KeyFrame(1.0, 1.7), KeyFrame(20.0, 0.0))
    behaviour = KeyFrames("d.hinge", frames, Jump())
    # Open at 1.7 rad the leaf stands across the way of a robot that comes along the corridor.
    simulated = leaf(behaviour, start=Pose2(-0.6, -1.5, math.pi / 2))
    assert angles(simulated, 1.5)[-1] == 1.7
    simulated.command(Twist2(0.2298, 0.0, 0.0))
    pushed = angles(simulated, 10.0)
    assert min(pushed) < 0.5
    assert simulated.pose().y == pytest.approx(-1.5 + 0.22 * 10.0, abs=0.02)
    assert {contact.second for contact in simulated.take_contacts()} == {"d.leaf"}
    simulated.advance(round(20.0 * 100) + 1 - simulated.tick)
    assert simulated.joint_positions()[0] == 0.0
