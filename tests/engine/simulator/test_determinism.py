"""The same seed gives the same run, however its steps are made and its behaviours are asked."""

import hashlib
import math
from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from daemon.simulator import World
from daemon.simulator import _chipmunk as chipmunk
from grammars.model.behaviour import (
    JointActs,
    Jump,
    KeyFrame,
    KeyFrames,
    LegBegins,
    Reaction,
    Servo,
    Trigger,
    Walk,
)
from grammars.model.geometry import Pose2, Twist2
from grammars.model.robot import OdometryNoise
from grammars.model.scene import Doorway
from tests.engine.simulator.scenes import (
    ROBOT,
    box,
    door,
    folding,
    person,
    scene,
    sliding_door,
    true_ranges,
    wall,
    world,
)


def digest(seed):
    """Hash everything a run produces."""
    robot = replace(
        ROBOT, laser=replace(ROBOT.laser, noise=0.01, dropout=0.02),
        odometry=OdometryNoise(20.0, 0.02, 0.02, 0.02),
    )  # fmt: skip
    parts = (
        wall("north", -2.0, 1.2, 20.0, 1.4), wall("south", -2.0, -1.4, 20.0, -1.2),
        *(door(f"door-{k}", Pose2(2.0 + 2.0 * k, 1.2, math.pi), friction=0.3) for k in range(5)),
        sliding_door("slider", Pose2(13.0, -0.5, 0.0)),
    )  # fmt: skip
    behaviours = (
        KeyFrames("door-1.hinge", (KeyFrame(2.0, 0.9), KeyFrame(4.0, 0.1)), Jump()),
        Trigger("door-3.hinge", 0.0, 1.2, 2.0, Servo(), of="leaf", to="footprint", rearm=3.0),
    )
    now = World(scene(*parts), robot, Pose2(), behaviours, np.random.SeedSequence(seed))
    state = hashlib.sha256()
    for step in range(400):
        now.command(Twist2(0.8, 0.0, 0.6 * math.sin(0.1 * step) - 0.5 * now.pose().yaw))
        now.advance(5)
        odometry = now.odometry()
        state.update(repr((now.pose(), now.twist(), odometry)).encode())
        state.update(b"".join(part.tobytes() for part in now.joint_states()))
        if step % 2 == 0:
            state.update(now.scan().tobytes() + true_ranges(now).tobytes())
        state.update(repr((now.take_contacts(), now.take_events())).encode())
    return state.hexdigest()


def test_the_seed_matters_and_is_not_used_up():
    assert digest(3) == digest(3)
    assert digest(3) != digest(4)
    seed = np.random.SeedSequence(5)
    World(scene(), ROBOT, Pose2(), (), seed)
    assert seed.n_children_spawned == 0


def test_a_world_is_the_same_by_the_steps_of_pymunk(monkeypatch):
    """With doors, contacts, triggers and jumps: callbacks reach Python in either kind of step."""
    direct = digest(5)
    monkeypatch.setattr(chipmunk, "stepper", lambda space: lambda: space.step(0.01))
    assert digest(5) == direct


TICKS = 160
times = st.floats(0.0, TICKS / 100.0)
MOTIONS = st.sampled_from([Jump(), Servo()])

key_frames = st.builds(
    lambda a, b, motion: KeyFrames(
        "timed.hinge", (KeyFrame(min(a, b), 1.2), KeyFrame(max(a, b), 0.1)), motion
    ),
    times, times, MOTIONS,
)  # fmt: skip
measured = st.sampled_from(
    [("near.hinge", of) for of in ("hinge", "foot", "leaf", "doorway")]
    + [(joint, "leaf") for joint in ("slider.rail", "folding.root", "folding.fold")]
)
triggers = st.builds(
    lambda what, to, near, rearm, motion: Trigger(
        what[0], 0.0, 0.6, near, motion, of=what[1], to=to,
        rearm=None if rearm is None else near + rearm,
    ),
    measured, st.sampled_from(["base", "footprint"]), st.floats(0.3, 2.5),
    st.none() | st.floats(0.05, 1.0), MOTIONS,
)  # fmt: skip
events = st.sampled_from(
    [
        LegBegins(2),
        JointActs(("timed.hinge",), "moves"),
        JointActs(("near.hinge",), "fires"),
        JointActs(("visitor.x",), "moves"),
    ]
)
reactions = st.builds(
    lambda event, delay, motion: Reaction("told.hinge", 1.0, 0.0, event, motion, delay),
    events, st.floats(0.0, 0.5), MOTIONS,
)  # fmt: skip
walks = st.builds(
    lambda start, pause, event: Walk(
        "visitor", ((1.0, -1.0), (1.0, -0.6), (1.4, -0.6)), 1.0,
        start=start, pause=pause, event=event,
    ),
    times, st.floats(0.0, 0.2), st.none() | st.just(LegBegins(2)),
)  # fmt: skip
some = st.tuples(*(st.none() | of for of in (key_frames, triggers, reactions, walks)))


def build(behaviours):
    return world(
        door("timed", Pose2(4.0, 2.0, 0.0)), door("near", Pose2(2.0, 0.5, 0.0), doorway="way"),
        Doorway("way", Pose2(2.0, 1.0, 0.0), box(1.9, 0.5, 2.1, 1.5), 1.0, 0.0, 2.0),
        sliding_door("slider", Pose2(1.5, -2.0, 0.0)), folding("folding", Pose2(2.2, -1.5, 0.1)),
        door("told", Pose2(0.0, 0.2, math.pi)), person(), wall("end", 2.6, -2.0, 2.8, 2.0),
        start=Pose2(0.0, -0.4, 0.0), behaviours=behaviours,
    )  # fmt: skip


def state(now):
    joints = (now.joint_positions().tobytes(), now.joint_states()[1].tobytes())
    return now.pose(), now.twist(), *joints, now.take_events(), now.take_contacts()


@given(some, st.integers(1, 9), st.integers(0, TICKS))
def test_asking_at_every_tick_changes_nothing(drawn, every, leg):
    behaviours = tuple(b for b in drawn if b is not None)
    """Behaviours that say when they are due do what they do when they are asked at every tick."""
    now, asked = build(behaviours), build(behaviours)
    for each in (now, asked):
        each.command(Twist2(1.0, 0.0, 0.1))
    # As if the robot were always where triggers have to be watched.
    asked._scheduler._way_since_check = lambda: math.inf
    told = False
    while now.tick < TICKS:
        if now.tick >= leg and not told:
            told = True
            for each in (now, asked):
                each.progress(1, 1)
        if now.tick > TICKS / 2:
            for each in (now, asked):
                each.command(Twist2(-1.0, 0.0, 0.1))
        now.advance(every)
        for _ in range(every):
            asked._scheduler.due = -math.inf
            asked.advance(1)
        assert state(now) == state(asked)
