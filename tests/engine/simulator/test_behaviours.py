import math

import pytest

from grammars.model.behaviour import (
    Jump,
    KeyFrame,
    KeyFrames,
    LegBegins,
    Reaction,
    Servo,
    Spring,
    Trigger,
)
from grammars.model.geometry import Pose2, Twist2
from grammars.model.scene import Doorway
from tests.engine.simulator.scenes import box, door, driven, folding, sliding_door, world

AWAY, TILTED = Pose2(5.0, 0.0, 0.0), Pose2(5.0, 0.0, 0.4)
MOTIONS = (Jump(), Servo(1.0, 40.0), Spring(30.0, 15.0))


def frames(motion, *points, joint="d.hinge"):
    return KeyFrames(joint, tuple(KeyFrame(t, q) for t, q in points), motion)


def position_at(simulated, time):
    simulated.advance(round(time * 100) - simulated.tick)
    return float(simulated.joint_positions()[0])


SLIDES = (Jump(), Servo(0.5, 100.0), Spring(100.0, 100.0))


@pytest.mark.parametrize(
    ("part", "joint", "motion", "most"),
    [
        *((door("d", AWAY), "d.hinge", motion, 1.4) for motion in MOTIONS),
        *((sliding_door("s", TILTED), "s.rail", motion, 0.8) for motion in SLIDES),
    ],
)
def test_every_motion_reaches_its_key_frames(part, joint, motion, most):
    behaviour = frames(motion, (1.0, most), (8.0, 0.3), joint=joint)
    simulated = world(part, behaviours=(behaviour,))
    assert position_at(simulated, 1.0) == pytest.approx(0.0, abs=1e-6)
    assert position_at(simulated, 7.9) == pytest.approx(most, abs=0.02)
    assert position_at(simulated, 16.0) == pytest.approx(0.3, abs=0.02)
    events = simulated.take_events()
    assert [(e.time, e.source) for e in events] == [(1.0, joint), (8.0, joint)]
    assert simulated.take_events() == ()


@pytest.mark.parametrize("motion", MOTIONS)
def test_a_frame_at_time_zero_is_where_the_joint_starts(motion):
    simulated = world(door("d", AWAY), behaviours=(frames(motion, (0.0, 0.8)),))
    assert simulated.joint_positions().tolist() == pytest.approx([0.8])
    assert position_at(simulated, 1.0) == pytest.approx(0.8, abs=1e-3)


def test_a_jump_takes_one_step():
    simulated = world(door("d", AWAY), behaviours=(frames(Jump(), (0.5, 1.7)),))
    assert position_at(simulated, 0.5) == pytest.approx(0.0, abs=1e-9)
    assert position_at(simulated, 0.51) == pytest.approx(1.7, abs=1e-9)


def test_frames_out_of_order_are_played_one_a_step():
    behaviour = frames(Jump(), (1.0, 0.2), (0.7, 1.0), (0.8, 0.4), (1.0, 0.6), (2.0, 1.7))
    simulated = world(door("d", AWAY), behaviours=(behaviour,))
    assert position_at(simulated, 1.0) == pytest.approx(0.0, abs=1e-6)
    for k, angle in enumerate((0.2, 1.0, 0.4, 0.6, 0.6), start=1):
        assert position_at(simulated, 1.0 + 0.01 * k) == pytest.approx(angle, abs=1e-6)
    assert position_at(simulated, 2.0) == pytest.approx(0.6, abs=1e-6)
    assert position_at(simulated, 2.01) == pytest.approx(1.7, abs=1e-6)
    times = [event.time for event in simulated.take_events()]
    assert times == pytest.approx([1.0, 1.01, 1.02, 1.03, 2.0])


def test_a_servo_keeps_its_rate():
    simulated = world(
        door("d", AWAY), behaviours=(frames(Servo(0.5, 40.0), (0.0, 0.0), (1.0, 1.5)),)
    )
    assert position_at(simulated, 2.0) == pytest.approx(0.5, abs=0.06)
    assert simulated.joint_states()[1][0] == pytest.approx(0.5, abs=0.01)
    assert position_at(simulated, 3.0) == pytest.approx(1.0, abs=0.06)
    trail = [position_at(simulated, 3.0 + k / 10) for k in range(1, 40)]
    assert max(trail) < 1.505


def test_a_weak_servo_does_not_move_a_robot_that_a_strong_one_pushes():
    def pushed(effort):
        simulated = world(
            door("d", Pose2(1.0, -0.5, 0.0), initial=0.0), start=Pose2(0.4, 0.0, 0.0),
            behaviours=(frames(Servo(0.5, effort), (0.2, 1.2)),),
        )  # fmt: skip
        simulated.advance(400)
        return simulated.pose().x

    assert pushed(40.0) == pytest.approx(0.4, abs=0.01)
    assert pushed(4000.0) < 0.3


def near(motion, **options):
    values = {"start": 0.0, "end": 1.4, "distance": 1.3} | options
    return Trigger("d.hinge", motion=motion, **values)


def approach(*behaviours, start=Pose2(0.0, -0.2, 0.0)):  # noqa: B008
    """A robot beside a door at x = 3 whose leaf stands away from the robot's way."""
    return world(
        door("d", Pose2(3.0, 0.5, 0.0), doorway="way"),
        Doorway("way", Pose2(3.0, 0.0, 0.0), box(2.9, 0.5, 3.1, 1.5), 1.0, 0.0, 2.0),
        start=start, behaviours=behaviours,
    )  # fmt: skip


@pytest.mark.parametrize("motion", MOTIONS)
def test_a_trigger_fires_below_its_distance_and_latches(motion):
    simulated = approach(near(motion))
    simulated.command(Twist2(0.5, 0.0, 0.0))
    fired = []
    for _ in range(800):
        pose = simulated.pose()
        distance = math.hypot(pose.x - 2.975, pose.y - 0.525)
        simulated.advance(1)
        fired += [(event.time, distance) for event in simulated.take_events()]
    ((time, distance),) = fired
    assert 1.29 < distance < 1.3
    assert 2.0 < time < 5.0
    assert simulated.joint_positions()[0] == pytest.approx(1.4, abs=0.05)


@pytest.mark.parametrize("motion", MOTIONS)
def test_before_it_fires_a_trigger_holds_the_start(motion):
    simulated = approach(near(motion, start=0.9))
    assert simulated.joint_positions().tolist() == pytest.approx([0.9])
    simulated.advance(300)
    assert simulated.joint_positions()[0] == pytest.approx(0.9, abs=1e-6)
    assert simulated.take_events() == ()


def test_exactly_at_the_distance_a_trigger_does_not_fire():
    hinge = (2.975, 0.525)
    for shift, count in ((0.0, 0), (1e-6, 1)):
        start = Pose2(hinge[0], hinge[1] - 1.25 + shift, 0.0)
        simulated = approach(near(Jump(), distance=1.25), start=start)
        simulated.advance(10)
        assert len(simulated.take_events()) == count


def test_a_rearming_trigger_returns_with_hysteresis_and_fires_again():
    simulated = approach(near(Servo(2.0, 40.0), rearm=1.8))
    for speed in (0.5, -0.5, 0.5):
        simulated.command(Twist2(speed, 0.0, 0.0))
        simulated.advance(500)
    texts = [event.text.split()[0] for event in simulated.take_events()]
    assert texts[:3] == ["triggered", "re-armed", "triggered"]


def test_a_held_chain_link_follows_its_moving_parent():
    behaviour = Trigger("f.fold", 0.8, 0.0, 0.01, Jump())
    simulated = driven(
        Twist2(0.4, 0.0, 0.0), 250, folding("f", Pose2(1.0, -0.5, 0.2)), behaviours=(behaviour,)
    )
    fold, root = simulated.joint_positions()
    assert fold == pytest.approx(0.8, abs=0.02)
    assert abs(root) > 0.05


BLOCKED = Pose2(1.0, 0.5, math.pi)


def test_a_jump_into_the_robot_stops_at_it_and_is_reported():
    behaviour = frames(Jump(), (0.0, 1.5), (0.5, 0.0))
    simulated = world(
        door("d", BLOCKED, friction=1.0), start=Pose2(0.9, 0.0, 0.0), behaviours=(behaviour,)
    )
    simulated.advance(60)
    assert simulated.joint_positions()[0] > 0.3
    assert simulated.pose().x == pytest.approx(0.9, abs=0.01)
    _, second, third = simulated.take_events()
    assert "stopped at" in third.text
    assert third.time == second.time == 0.5
    assert [c.second for c in simulated.take_contacts()] == ["d.leaf"]


def test_a_jump_over_the_robot_to_a_free_place_succeeds():
    behaviour = frames(Jump(), (0.0, 2.0), (0.5, 0.0))
    simulated = world(door("d", BLOCKED), start=Pose2(1.45, 0.2, 0.0), behaviours=(behaviour,))
    assert position_at(simulated, 0.6) == pytest.approx(0.0, abs=1e-6)
    assert simulated.take_contacts() == ()


SLIDING = sliding_door("d", Pose2(0.9, -1.0, 0.0), 1.0)


@pytest.mark.parametrize(
    ("part", "behaviour", "way", "first"),
    [
        (door("d", BLOCKED), near(Jump(), start=1.5, end=0.0, distance=5.0), 0.3, "triggered"),
        (door("d", BLOCKED), Reaction("d.hinge", 1.5, 0.0, LegBegins(1), Jump()), 0.3, "reacts:"),
        (SLIDING, Reaction("d.rail", 1.0, 0.3, LegBegins(1), Jump()), 0.7, "reacts:"),
    ],
)
def test_a_blocked_jump_completes_when_the_robot_makes_way(part, behaviour, way, first):
    simulated = world(part, start=Pose2(0.9, 0.0, 0.0), behaviours=(behaviour,))
    simulated.progress(0, 0)
    simulated.advance(50)
    assert simulated.joint_positions()[0] > way
    simulated.command(Twist2(-0.5, 0.0, 0.0))
    simulated.advance(300)
    assert simulated.joint_positions()[0] == pytest.approx(behaviour.end, abs=1e-6)
    texts = [event.text.split()[0] for event in simulated.take_events()]
    assert texts == [first, "stopped", "reached"]
