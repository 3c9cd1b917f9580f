"""The doors of the published worlds: a kilogram on a frictionless hinge, plugins of Gazebo Classic.

Figures derived from the plugins' settings: a spring of 0.5 N m/rad on 0.30 kg m^2.
"""

import math

import numpy as np
import pytest

from daemon.simulator import World
from grammars.floorplan import load_floorplan
from grammars.model.behaviour import Jump, KeyFrame, KeyFrames, Spring, Trigger
from grammars.model.geometry import Pose2, Twist2
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene, resolve_behaviours
from tests.engine.simulator.scenes import door, world
from tests.engine.simulator.test_imposed import IMPOSED

INERTIA = (0.93**2 + 0.05**2) / 12.0 + 0.475**2 + 0.025**2
QUARTER = 0.5 * math.pi * math.sqrt(INERTIA / 0.5)
"""A quarter of the period of the swinging door [s]: 1.22, as published."""

FAR = Pose2(-10.0, 0.0, 0.0)


def leaf(behaviour, *, start=FAR, pose=Pose2()):  # noqa: B008
    return world(
        door("d", pose, mass=1.0), robot=IMPOSED, start=start, behaviours=(behaviour,)
    )  # fmt: skip


def angles(simulated, seconds):
    """The angle of the door at every tick of some seconds, from now on."""
    found = []
    for _ in range(round(seconds * 100)):
        found.append(float(simulated.joint_positions()[0]))
        simulated.advance(1)
    return found


def triggered(**options):
    return Trigger("d.hinge", 1.4, 0.0, 1.3, Spring(0.5), of="foot", **options)


@pytest.mark.parametrize("rest", [0.8, 1.4, 2.0])
def test_a_door_at_rest_falls_shut_in_a_quarter_of_a_period_from_any_angle(rest):
    behaviour = Trigger("d.hinge", rest, 0.0, 1.3, Spring(0.5), of="foot")
    trail = angles(leaf(behaviour, start=Pose2(1.28, 0.0, 0.0)), 3.0)
    assert trail[0] == rest
    shut = next(k for k, angle in enumerate(trail) if angle <= 0.0)
    assert shut / 100 == pytest.approx(1.22, abs=0.03)
    # The stop gives way a little.
    assert max(abs(angle) for angle in trail[shut + 5 :]) < 0.08 * rest


def test_a_door_at_rest_stays_so_until_the_robot_is_nearer_than_its_distance():
    # As close_on_approach_era.scenery has it; the robot comes straight towards the foot.
    simulated = leaf(triggered(), start=Pose2(0.0, -20.0, math.pi / 2))
    simulated.command(Twist2(0.2298, 0.0, 0.0))
    trail, distances = [], []
    while not (events := simulated.take_events()):
        pose = simulated.pose()
        distances.append(math.hypot(pose.x, pose.y))
        trail += angles(simulated, 0.01)
    (event,) = events
    assert event.text.startswith("triggered at 1.29")
    assert max(abs(angle - 1.4) for angle in trail) < 1e-9
    assert min(distances[:-1]) >= 1.3 > distances[-1]


def test_a_door_at_rest_is_not_fixed_where_it_rests():
    # A distance less than the published one, at which it would have begun to fall shut before.
    behaviour = Trigger("d.hinge", 1.4, 0.0, 0.2, Spring(0.5), of="foot")
    simulated = leaf(behaviour, start=Pose2(-0.7, 1.2, -math.pi / 2))
    simulated.command(Twist2(0.2298, 0.0, 0.0))
    pushed = angles(simulated, 4.0)
    assert max(pushed) > 1.6
    assert {contact.second for contact in simulated.take_contacts()} == {"d.leaf"}


def test_a_door_that_begins_shut_is_thrown_to_its_stop_and_swings_for_ever():
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


def test_a_jumped_door_hangs_loose_until_its_next_key_frame():
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


def test_the_published_doors_jump_when_their_files_say_and_as_they_are_listed(campaigns):
    folder = campaigns / "ortega2024"
    layers = [load_scenery(folder / f"{name}.scenery") for name in ("doors_s2", "doors_timed_era")]
    scene = compile_scene(load_floorplan(folder / "building_c.fpm"), layers)
    seed = np.random.SeedSequence(1)
    behaviours = resolve_behaviours(scene, layers, seed=seed, limit=1800.0).behaviours
    simulated = World(scene, IMPOSED, Pose2(), behaviours, seed)

    def after(time):
        """The angles of doors 1 to 11 once the step that begins then is over."""
        simulated.advance(round(time * 100) + 1 - simulated.tick)
        return [float(angle) for angle in simulated.joint_positions()]

    assert after(9.99) == pytest.approx([0.0] * 11, abs=1e-6)
    # The second frame of door 2 is for 7 s: late, it comes one step after the first one.
    assert after(10.00) == pytest.approx([0.0] * 11, abs=1e-6)
    for time in (10.01, 60.0, 89.99):
        assert after(time) == pytest.approx([0.0, 1.0, *[0.0] * 9], abs=1e-6)
    assert after(90.0)[8] == pytest.approx(1.7, abs=1e-6)
    assert after(97.99)[1] == pytest.approx(1.0, abs=1e-6)
    assert after(98.0)[1] == pytest.approx(1.7, abs=1e-6)
    texts = [event.text for event in simulated.take_events() if event.source == "door_2.hinge"]
    assert texts == [
        "key frame 1 at 10 s: to 0",
        "key frame 2 at 7 s: to 1",
        "key frame 3 at 98 s: to 1.7",
    ]
