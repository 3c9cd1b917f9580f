import math
from dataclasses import replace

import numpy as np
import pymunk
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from grammars.model.geometry import Pose2, Twist2
from grammars.model.robot import Mount
from grammars.model.scene import Link, SceneObject, Solid
from tests.engine.simulator.scenes import (
    LASER,
    ORIGIN,
    ROBOT,
    box,
    cast_by_broadcast,
    door,
    near_an_end,
    ray_angles,
    sliding_door,
    true_ranges,
    wall,
    world,
    world_segments,
)

ROOM = (
    wall("south", -5.0, -4.0, 5.0, -3.8),
    wall("north", -5.0, 3.8, 5.0, 4.0),
    wall("west", -5.0, -3.8, -4.8, 3.8),
    wall("east", 4.8, -3.8, 5.0, 3.8),
    Solid("column", "column", ((1.0, 1.0), (1.4, 0.8), (1.6, 1.3)), 0.0, 2.5),
    door("ajar", Pose2(-2.0, 1.0, 0.7), 0.9),
    door("shut", Pose2(2.5, -2.0, -1.1), frozen=True),
    sliding_door("slider", Pose2(-3.0, -2.5, 0.3), 0.4),
)


def room(laser, start=ORIGIN, seed=7):
    return world(*ROOM, robot=replace(ROBOT, laser=laser), start=start, seed=seed)


def inside_something(simulated, point):
    place = shapely.Point(point)
    walls = [shapely.Polygon(part.polygon) for part in ROOM if isinstance(part, Solid)]
    links = [s for s in simulated._space.shapes if isinstance(s, pymunk.Poly)]
    links.remove(simulated._base.shape)
    # On a surface it is neither inside nor outside.
    return any(wall.covers(place) for wall in walls) or any(
        link.point_query(point).distance <= 0.0 for link in links
    )


lasers = st.builds(
    lambda low, span, rays, reach: replace(
        LASER, angle_min=low, angle_max=low + span, rays=rays, range_max=reach
    ),
    st.floats(-math.pi, math.pi),
    st.floats(0.1, 2.0 * math.pi),
    st.integers(2, 400),
    st.sampled_from([2.0, 5.6, 30.0]),
)
poses = st.builds(Pose2, st.floats(-4.5, 4.5), st.floats(-3.5, 3.5), st.floats(-10.0, 10.0))


@given(laser=lasers, start=poses)
def test_every_ray_is_exact_from_every_pose(laser, start):
    simulated = room(laser, start)
    segments, angles = world_segments(simulated), ray_angles(laser, start)
    sensor = start @ laser.mount
    origin = (sensor.x, sensor.y)
    assume(not inside_something(simulated, origin))
    expected = cast_by_broadcast(segments, origin, angles)
    expected[expected > laser.range_max] = np.inf
    sure = ~near_an_end(segments, origin, angles) & (np.abs(expected - laser.range_max) > 1e-9)
    ranges = true_ranges(simulated)
    np.testing.assert_allclose(ranges[sure], expected[sure], rtol=0.0, atol=1e-9)


@given(start=st.builds(Pose2, st.floats(-1.5, 0.5), st.floats(-1.5, 0.5)), corner=st.integers(0, 2))
def test_no_ray_slips_through_a_corner(start, corner):
    x, y = ROOM[4].polygon[corner]
    bearing = math.atan2(y - start.y, x - start.x)
    laser = replace(LASER, mount=Mount(0.0), angle_min=bearing, angle_max=bearing + 1.0, rays=3)
    ranges = true_ranges(room(laser, start))
    assert ranges[0] <= math.hypot(x - start.x, y - start.y) + 1e-6


def test_clockwise_polygons_are_seen_like_counter_clockwise_ones():
    ring = box(1.0, -1.0, 1.2, 1.0)
    for polygon in (ring, ring[::-1]):
        link = Link("block", (polygon,), 5.0, 0.0, 1.0)
        simulated = world(SceneObject("o", "o", Pose2(), (link,), (), ()))
        assert true_ranges(simulated)[30] == pytest.approx(0.7)
        solid = Solid("s", "wall", polygon, 0.0, 1.0)
        assert true_ranges(world(solid))[30] == pytest.approx(0.7)


def test_the_scan_plane_passes_over_low_and_under_high_things():
    low = Solid("sill", "wall", box(1.0, -1.0, 1.2, 1.0), 0.0, 0.3)
    high = Solid("lintel", "wall", box(1.5, -1.0, 1.7, 1.0), 0.31, 2.5)
    table = Link("top", (box(1.8, -1.0, 2.0, 1.0),), 5.0, 0.7, 0.75)
    leg = Link("leg", (box(2.2, -0.5, 2.3, 0.5),), 5.0, 0.0, 0.7)
    furniture = SceneObject("table", "table", Pose2(), (table, leg), (), ())
    simulated = world(low, high, furniture)
    ranges = true_ranges(simulated)
    assert ranges[30] == pytest.approx(2.2 - 0.3)


def test_a_sweep_from_where_nothing_has_moved_is_the_one_a_fresh_laser_takes():
    """Cast once, reported again: with the noise of the next scan, and never for too long."""
    laser = replace(LASER, noise=0.02, dropout=0.1)
    here, elsewhere = room(laser), room(laser)
    for twist, ticks in ((Twist2(), 5), (Twist2(), 5), (Twist2(0.4, 0.0, 0.2), 5), (Twist2(), 60)):
        for simulated in (here, elsewhere):
            simulated.command(twist)
            simulated.advance(ticks)
        # Forgotten before every scan: cast anew each time.
        elsewhere._lasers[""]._cast_state = (0, b"")
        assert here.scan().tobytes() == elsewhere.scan().tobytes()
        assert true_ranges(here).tobytes() == true_ranges(elsewhere).tobytes()
    assert not np.array_equal(here.scan(), here.scan())


@pytest.mark.parametrize(("too_near", "nearest"), [("infinite", -math.inf), ("clamped", 0.5)])
def test_special_values_follow_rep_117(too_near, nearest):
    laser = replace(
        LASER, mount=Mount(0.0), angle_min=0.0, angle_max=math.pi, rays=3, range_min=0.5,
        too_near=too_near,
    )  # fmt: skip
    simulated = world(
        wall("near", 0.4, -0.1, 0.5, 0.1), wall("far", -4.2, -1.0, -4.0, 1.0),
        robot=replace(ROBOT, laser=laser),
    )  # fmt: skip
    assert simulated.scan().tolist() == [nearest, math.inf, 4.0]
    assert simulated.scan().dtype == np.float32


def test_noise_is_gaussian_and_clamped_to_the_range():
    laser = replace(LASER, noise=0.02, rays=400, angle_min=-0.9, angle_max=0.9, range_max=4.51)
    simulated = room(laser)
    truth = true_ranges(simulated)
    scans = np.array([simulated.scan() for _ in range(400)], dtype=np.float64)
    edge, inner = (truth > 4.505) & (truth < 4.51), truth < 4.4
    assert scans[:, edge].max() == np.float32(4.51)
    errors = scans[:, inner] - truth[inner]
    assert errors.size > 5000
    assert errors.mean() == pytest.approx(0.0, abs=4 * 0.02 / math.sqrt(errors.size))
    assert errors.std() == pytest.approx(0.02, rel=0.02)
    lag_one = float((errors[:-1] * errors[1:]).mean()) / 0.02**2
    assert abs(lag_one) < 0.02


def test_rays_drop_out_at_the_given_rate():
    simulated = room(replace(LASER, dropout=0.1, rays=500))
    lost = np.isnan([simulated.scan() for _ in range(100)]).mean()
    assert lost == pytest.approx(0.1, abs=0.005)


def test_noise_does_not_depend_on_what_is_seen():
    laser = replace(LASER, noise=0.01, dropout=0.05, mount=Mount(0.0))
    robot = replace(ROBOT, laser=laser)
    near = world(wall("w", 2.0, -50.0, 2.2, 50.0), robot=robot)
    busy = world(wall("w", 2.0, -50.0, 2.2, 50.0), door("d", Pose2(1.0, 0.5)), robot=robot)
    near.scan(), busy.scan()
    a, b = near.scan(), busy.scan()
    np.testing.assert_array_equal(np.isnan(a), np.isnan(b))
    both = np.isfinite(a) & np.isfinite(b)
    noise_a = a[both] - true_ranges(near)[both]
    noise_b = b[both] - true_ranges(busy)[both]
    assert np.any(a[both] != b[both])
    np.testing.assert_allclose(noise_a, noise_b, atol=1e-5)


FRONT = replace(LASER, name="front", noise=0.02, dropout=0.05)
REAR = replace(
    LASER, name="rear", mount=Mount(-0.3, 0.1, math.pi), rays=33, range_max=6.0, noise=0.01
)


def with_lasers(*lasers, start=ORIGIN):
    robot = replace(ROBOT, laser=lasers[0], other_lasers=lasers[1:])
    return world(*ROOM, robot=robot, start=start)


def test_each_laser_sees_from_where_it_is_mounted():
    start = Pose2(0.4, -0.3, 0.8)
    both = with_lasers(FRONT, REAR, start=start)
    for laser in (FRONT, REAR):
        alone = room(replace(laser, name=""), start=start)
        np.testing.assert_array_equal(true_ranges(both, laser.name), true_ranges(alone))
    np.testing.assert_array_equal(true_ranges(both), true_ranges(both, "front"))


def test_another_laser_leaves_the_noise_of_the_first_alone():
    alone, both = with_lasers(FRONT), with_lasers(FRONT, REAR)
    turned = with_lasers(REAR, FRONT)
    for _ in range(3):
        rear = both.scan("rear")
        scan = alone.scan("front")
        np.testing.assert_array_equal(scan, both.scan("front"))
        np.testing.assert_array_equal(scan, turned.scan("front"))
        np.testing.assert_array_equal(rear, turned.scan("rear"))
    with pytest.raises(KeyError):
        both.scan("left")


def test_lasers_at_other_heights_meet_other_things():
    low, high = replace(LASER, name="low", z=0.2), replace(LASER, name="high", z=1.2)
    simulated = world(
        wall("step", 2.0, -9.0, 2.2, 9.0, z=0.5), wall("end", 4.0, -9.0, 4.2, 9.0),
        robot=replace(ROBOT, laser=low, other_lasers=(high,)),
    )  # fmt: skip
    seen = {name: true_ranges(simulated, name)[30] for name in ("low", "high")}
    assert seen == {"low": pytest.approx(1.7), "high": pytest.approx(3.7)}
