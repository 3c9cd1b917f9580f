import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.model.geometry import Pose2, Twist2
from tests.engine.simulator.scenes import DRIVE, ROBOT, differential, driven, wall, world
from tests.engine.simulator.test_imposed import IMPOSED

WALL = wall("wall", 2.0, -5.0, 2.2, 5.0)


def test_time_counts_hundredths_of_a_second_exactly():
    simulated = world()
    simulated.advance(7)
    simulated.advance()
    assert (simulated.tick, simulated.time) == (8, 0.08)


@pytest.mark.parametrize(("robot", "meets"), [(ROBOT, 2.16), (IMPOSED, 1.67)])
def test_a_wall_stops_every_base_within_millimetres_and_lets_it_go(robot, meets):
    simulated = world(WALL, robot=robot)
    simulated.command(Twist2(1.0, 0.0, 0.0))
    deepest = 0.0
    for _ in range(400):
        simulated.advance()
        deepest = max(deepest, simulated.pose().x + 0.35 - 2.0)
    assert deepest <= 0.010  # at most the way of one tick
    assert simulated.pose().x + 0.35 - 2.0 < 0.001
    assert abs(simulated.twist().vx) < 1e-6
    (contact,) = simulated.take_contacts()
    assert (contact.second, contact.time) == ("wall", pytest.approx(meets, abs=0.02))
    simulated.command(Twist2(-0.5098, 0.0, 0.0))
    simulated.advance(100)
    assert simulated.pose().x < 1.3


@pytest.mark.parametrize(("robot", "deepest"), [(ROBOT, 0.01), (IMPOSED, 0.025)])
@given(
    yaw=st.floats(-math.pi, math.pi),
    vx=st.floats(-1.0, 1.0), vy=st.floats(-1.0, 1.0), wz=st.floats(-2.75, 2.75),
)  # fmt: skip
def test_no_kind_of_base_leaves_a_room_of_thin_walls(robot, deepest, yaw, vx, vy, wz):
    thin = 0.05
    simulated = world(
        wall("e", 1.0, -1.0, 1.0 + thin, 1.0), wall("w", -1.0 - thin, -1.0, -1.0, 1.0),
        wall("n", -1.0, 1.0, 1.0, 1.0 + thin), wall("s", -1.0, -1.0 - thin, 1.0, -1.0),
        robot=robot, start=Pose2(0.0, 0.0, yaw),
    )  # fmt: skip
    simulated.command(Twist2(vx, vy, wz))
    for _ in range(30):
        simulated.advance(20)
        corners = simulated.pose().apply_ring(ROBOT.footprint)
        assert all(max(abs(x), abs(y)) < 1.0 + deepest for x, y in corners)


def test_the_robot_slides_along_a_wall_it_meets_at_an_angle():
    simulated = driven(Twist2(0.3, 0.5, 0.0), 600, WALL, start=Pose2(1.0, -2.0, 0.0))
    assert simulated.pose().y > -1.0
    assert simulated.pose().x + 0.35 < 2.002


def test_the_robot_does_not_catch_where_pieces_of_a_wall_meet():
    pieces = (wall(f"piece-{k}", 0.7 * k - 2.0, 0.5, 0.7 * k - 1.3, 0.7) for k in range(20))
    simulated = driven(Twist2(0.5, 0.2, 0.0), 200, *pieces)
    for _ in range(300):
        simulated.advance(5)
        assert simulated.twist().vx > 0.3
    assert simulated.pose().y == pytest.approx(0.5 - 0.233, abs=0.001)


def test_acceleration_and_speed_are_limited():
    simulated = driven(Twist2(5.0, -5.0, 9.0), 50)
    assert simulated.twist().vx == pytest.approx(0.5, abs=0.02)
    assert simulated.twist().vy == pytest.approx(-0.5, abs=0.02)
    assert simulated.twist().wz == pytest.approx(2.0, abs=1e-6)
    simulated.command(Twist2(5.0, 0.0, 0.0))
    simulated.advance(200)
    assert simulated.twist().vx == pytest.approx(1.0, abs=1e-6)


def test_a_differential_base_ignores_sideways_commands():
    simulated = driven(Twist2(0.5, 0.9, 0.0), 200, robot=differential())
    assert simulated.pose().y == pytest.approx(0.0, abs=1e-12)
    assert simulated.pose().x > 0.7


def test_a_steady_turn_is_a_circle():
    simulated = driven(Twist2(0.5, 0.0, 0.5), 200, robot=differential())
    begin = simulated.pose()
    centre = begin.apply((0.0, 1.0))
    for _ in range(100):
        simulated.advance(13)
        pose = simulated.pose()
        assert math.hypot(pose.x - centre[0], pose.y - centre[1]) == pytest.approx(1.0, abs=1e-4)
        assert abs(simulated.twist().vy) < 1e-6


def test_the_base_brakes_when_commands_stop_coming():
    simulated = world(robot=differential(timeout=0.5))
    for _ in range(10):
        simulated.command(Twist2(0.5, 0.0, 0.0))
        simulated.advance(20)
    assert simulated.twist().vx == pytest.approx(0.5)
    simulated.advance(29)
    assert simulated.twist().vx == pytest.approx(0.5)
    simulated.advance(60)
    assert simulated.twist().vx == pytest.approx(0.0, abs=1e-9)


def test_a_strong_drive_without_acceleration_limits_follows_at_once():
    ideal = replace(
        DRIVE, max_ax=math.inf, max_ay=math.inf, max_az=math.inf,
        max_force=math.inf, max_torque=math.inf,
    )  # fmt: skip
    simulated = driven(Twist2(0.3, 0.1, 0.2), 1, robot=replace(ROBOT, drive=ideal))
    twist = simulated.twist()
    assert (twist.vx, twist.vy, twist.wz) == pytest.approx((0.3, 0.1, 0.2), abs=1e-9)


def test_commands_that_are_not_numbers_are_refused():
    with pytest.raises(ValueError, match="finite"):
        world().command(Twist2(math.nan, 0.0, 0.0))


def test_low_and_high_walls_do_not_collide():
    simulated = driven(
        Twist2(1.0, 0.0, 0.0),
        400,
        replace(WALL, z_min=0.3, z_max=2.5),
        replace(WALL, z_min=-1.0, z_max=0.0),
    )
    assert simulated.pose().x > 3.0


def test_contacts_say_what_was_touched_where_and_how_long():
    simulated = driven(Twist2(0.5, 0.0, 0.0), 500, WALL, wall("side", -1.0, 0.5, 5.0, 0.6))
    (contact,) = simulated.take_contacts()
    assert (contact.first, contact.second) == ("robot", "wall")
    assert 3.0 < contact.time < 3.7
    assert contact.until == 5.0
    assert contact.normal == pytest.approx((1.0, 0.0), abs=1e-6)
    assert contact.point[0] == pytest.approx(2.0, abs=0.01)
    assert 0.0 < contact.depth < 0.01
    simulated.advance(10)
    (still,) = simulated.take_contacts()
    assert (still.time, still.until) == (contact.time, 5.1)
    simulated.command(Twist2(-0.5, 0.0, 0.0))
    simulated.advance(100)
    (last,) = simulated.take_contacts()
    assert last.time == contact.time
    assert 5.1 <= last.until < 5.4
    simulated.advance(10)
    assert simulated.take_contacts() == ()
    simulated.command(Twist2(0.5, 0.0, 0.0))
    simulated.advance(300)
    (again,) = simulated.take_contacts()
    assert again.time > 6.0


def test_no_touch_is_lost_however_seldom_contacts_are_taken():
    simulated = world(WALL, start=Pose2(1.5, 0.0, 0.0))
    for speed, ticks in ((0.5, 200), (-0.5, 100), (0.5, 400), (-0.5, 100)):
        simulated.command(Twist2(speed, 0.0, 0.0))
        simulated.advance(ticks)
    first, second = simulated.take_contacts()
    assert first.until + 0.1 < second.time
    assert first.second == second.second == "wall"
    assert first.depth > 0.0


def test_pieces_of_one_wall_are_one_contact():
    simulated = driven(
        Twist2(0.5, 0.0, 0.0),
        300,
        wall("wall", 1.0, -2.0, 1.2, 0.0),
        wall("wall", 1.0, 0.0, 1.2, 2.0),
    )
    assert [c.second for c in simulated.take_contacts()] == ["wall"]


def test_a_start_inside_a_wall_shows_as_a_contact():
    simulated = world(wall("wall", 0.2, -2.0, 0.5, 2.0))
    simulated.advance(1)
    (contact,) = simulated.take_contacts()
    assert contact.second == "wall"
    assert contact.depth > 0.1


def test_the_pose_is_wrapped():
    simulated = driven(Twist2(0.0, 0.0, 1.0), 200, start=Pose2(0.0, 0.0, 3.0))
    assert -math.pi < simulated.pose().yaw < 0.0
