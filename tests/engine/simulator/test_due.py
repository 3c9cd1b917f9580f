"""Behaviours that say when they are due do what they do when they are asked at every tick."""

import math

from hypothesis import given
from hypothesis import strategies as st

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
from grammars.model.scene import Doorway
from tests.engine.simulator.scenes import box, door, folding, person, sliding_door, wall, world

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
