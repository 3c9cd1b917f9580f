"""What happens in small worlds a person can follow: ``worlds/*.txt``.

A section of a file begins with ``== name: description``, where the name is that of a world below.
Each line is a program; below it stands the state of the world after each of its parts, with what
happened and what was touched until then. A part is made of steps: ``0.5 0 0 for 2 s`` commands a
twist, ``progress 1 1`` tells the leg and the waypoints reached. ``every 0.5 s`` looks so often.
``pytest --update`` writes states anew.
"""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from daemon.simulator import World
from grammars.floorplan import load_floorplan
from grammars.model.behaviour import (
    Hold,
    JointActs,
    Jump,
    KeyFrame,
    KeyFrames,
    LegBegins,
    Reaction,
    Servo,
    Spring,
    Trigger,
    Walk,
    WaypointReached,
)
from grammars.model.geometry import Pose2, Twist2
from grammars.model.scene import Doorway
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene, resolve_behaviours
from tests.engine.judging.traces import answers
from tests.engine.simulator.scenes import (
    DRIVE,
    FAR,
    IMPOSED,
    LINE,
    ORIGIN,
    ROBOT,
    box,
    differential,
    door,
    folding,
    person,
    sliding_door,
    wall,
    world,
)

FILES = sorted((Path(__file__).parent / "worlds").glob("*.txt"))
INF = math.inf
WALL = wall("wall", 2.0, -5.0, 2.2, 5.0)
AHEAD = Pose2(1.0, 0.5, math.pi)
"""Of a closed door across the robot's way that opens away from it."""
AWAY, OTHER = Pose2(5.0, 5.0), Pose2(0.0, -6.0)
BESIDE, ASIDE = Pose2(0.9, 0.0), Pose2(0.0, -0.2)
JUMP = Jump()
SLOW = replace(DRIVE, timeout=0.5, kind="differential")
IDEAL = replace(DRIVE, max_ax=INF, max_ay=INF, max_az=INF, max_force=INF, max_torque=INF)
BOUND = replace(IMPOSED.drive, max_vx=0.5, timeout=0.1, friction_loss=0.0, kind="differential")


def with_drive(drive, robot=ROBOT):
    return replace(robot, drive=drive)


def frames(motion, *points, joint="d.hinge"):
    return KeyFrames(joint, tuple(KeyFrame(t, q) for t, q in points), motion)


def moved(part, motion, *points, joint="d.hinge", **options):
    """A world of one part that moves by key frames."""
    return world(part, behaviours=(frames(motion, *points, joint=joint),), **options)


def near(motion=JUMP, **options):
    """A trigger of the door, that of a robot that comes nearer than 1.3 m."""
    values = {"start": 0.0, "end": 1.4, "distance": 1.3} | options
    return Trigger("d.hinge", motion=motion, **values)


def approach(behaviour, start=ASIDE):
    """A robot beside a door at x = 3 whose leaf stands away from the robot's way."""
    way = Doorway("way", Pose2(3.0), box(2.9, 0.5, 3.1, 1.5), 1.0, 0.0, 2.0)
    leaf = door("d", Pose2(3.0, 0.5), doorway="way")
    return world(leaf, way, start=start, behaviours=(behaviour,))


def closes(event, delay=0.0, joint="door.hinge"):
    return Reaction(joint, 1.5, 0.0, event, Jump(), delay)


def told(event, delay=0.0):
    """A door that closes by news of a mission."""
    places = ("a", "b", "b")
    return world(door(), start=AWAY, behaviours=(closes(event, delay),), waypoints=places)


def two(*behaviours, start=AWAY, **options):
    return world(door(), door("other", OTHER, **options), start=start, behaviours=behaviours)


MOVES = closes(JointActs(("other.hinge",), "moves"))


def row():
    doors = (door(), door("other", OTHER), door("last", Pose2(0.0, 9.0)))
    first = Trigger("other.hinge", 0.0, 1.0, 1.0, Jump())
    second = closes(JointActs(("other.hinge",), "fires"), 0.2)
    third = closes(JointActs(("door.hinge",), "fires"), 0.0, "last.hinge")
    return world(*doors, start=Pose2(2.0, -6.0), behaviours=(first, second, third))


def walking(*parts, at=FAR, **changes):
    """Somebody who walks along a line, and a robot."""
    return world(person(), *parts, start=at, behaviours=(replace(LINE, **changes),))


def light(behaviour, start=FAR, pose=ORIGIN, opening=0.0, **other):
    """A door of the published worlds: a kilogram on a frictionless hinge."""
    leaf = door("d", pose, opening, mass=1.0, **other)
    behaviours = () if behaviour is None else (behaviour,)
    return world(leaf, robot=IMPOSED, start=start, behaviours=behaviours)


def falls(rest=1.4, distance=1.3, **options):
    return Trigger("d.hinge", rest, 0.0, distance, Spring(0.5), of="foot", **options)


def published():
    """The building of the published worlds with its doors."""
    folder = Path(__file__).parents[3] / "campaigns" / "ortega2024"
    layers = [load_scenery(folder / f"{name}.scenery") for name in ("doors_s2", "doors_timed_era")]
    scene = compile_scene(load_floorplan(folder / "building_c.fpm"), layers)
    seed = np.random.SeedSequence(1)
    behaviours = resolve_behaviours(scene, layers, seed=seed, limit=1800.0).behaviours
    return World(scene, IMPOSED, Pose2(), behaviours, seed)


DOOR, SLIDER = door("d", Pose2(5.0)), sliding_door("s", Pose2(5.0, 0.0, 0.4))
MOTIONS = {"jump": Jump(), "servo": Servo(1.0, 40.0), "spring": Spring(30.0, 15.0)}
SLIDES = {"jump": Jump(), "servo": Servo(0.5, 100.0), "spring": Spring(100.0, 100.0)}
FOLDING = folding("f", Pose2(1.0, -0.5, 0.2))
GUEST = Walk(
    "guest", ((0.0, 4.0), (0.0, 8.0)), 1.0, event=JointActs(("visitor.x",), "moves"), start=1.0
)
WORLDS = {
    "wall": lambda: world(WALL),
    "wall, imposed": lambda: world(WALL, robot=IMPOSED),
    "along a wall": lambda: world(WALL, start=Pose2(1.0, -2.0)),
    "pieces": lambda: world(
        *(wall(f"piece-{k}", 0.7 * k - 2.0, 0.5, 0.7 * k - 1.3, 0.7) for k in range(20))
    ),
    "open": world,
    "differential": lambda: world(robot=differential()),
    "times out": lambda: world(robot=with_drive(SLOW)),
    "ideal": lambda: world(robot=with_drive(IDEAL)),
    "low and high": lambda: world(replace(WALL, z_min=0.3), replace(WALL, z_min=-1.0, z_max=0.0)),
    "corner": lambda: world(WALL, wall("side", -1.0, 0.5, 5.0, 0.6)),
    "near a wall": lambda: world(WALL, start=Pose2(1.5)),
    "wall in two": lambda: world(
        wall("wall", 1.0, -2.0, 1.2, 0.0), wall("wall", 1.0, 0.0, 1.2, 2.0)
    ),
    "inside a wall": lambda: world(wall("wall", 0.2, -2.0, 0.5, 2.0)),
    "turned": lambda: world(start=Pose2(0.0, 0.0, 3.0)),
    "imposed": lambda: world(robot=IMPOSED),
    "imposed, turned": lambda: world(robot=IMPOSED, start=Pose2(0.0, 0.0, math.radians(55.0))),
    "imposed, bound": lambda: world(robot=with_drive(BOUND, IMPOSED)),
    "imposed, a free door": lambda: light(None, Pose2(), AHEAD),
    "imposed, a held door": lambda: light(Hold("d.hinge", 0.0), Pose2(), AHEAD),
    "imposed, hit": lambda: light(None, BESIDE, AHEAD, 1.5, stiffness=5.0),
    "opens the other way": lambda: world(door("d", Pose2(1.0, -0.5))),
    "held": lambda: world(door("d", AHEAD), behaviours=(Hold("d.hinge", 0.0),)),
    "frozen": lambda: world(door("d", AHEAD, initial=0.4, frozen=True)),
    "dry friction": lambda: world(door("d", AHEAD, friction=4.0)),
    "closer": lambda: world(door("d", AHEAD, initial=1.5, stiffness=10.0, damping=15.0)),
    "beside a rail": lambda: world(sliding_door("s", Pose2(0.6, 0.1), initial=0.3)),
    "along a rail": lambda: world(sliding_door("s", Pose2(0.0, 0.5))),
    "across a rail": lambda: world(sliding_door("s", Pose2(1.0, -0.5), friction=20.0)),
    "jamb": lambda: world(door("d", AHEAD), wall("jamb", 0.9, 0.45, 1.3, 3.0)),
    "two leaves": lambda: world(door("a", AHEAD), door("b", Pose2(1.5, 0.45, math.pi))),
    "held link": lambda: world(FOLDING, behaviours=(Hold("f.fold", 1.2),)),
    "triggered link": lambda: world(
        FOLDING, behaviours=(Trigger("f.fold", 0.8, 0.0, 0.01, Jump()),)
    ),
    **{f"door, {k}": lambda m=m: moved(DOOR, m, (1, 1.4), (8, 0.3)) for k, m in MOTIONS.items()},
    **{
        f"slider, {k}": lambda m=m: moved(SLIDER, m, (1, 0.8), (8, 0.3), joint="s.rail")
        for k, m in SLIDES.items()
    },
    **{f"from the start, {k}": lambda m=m: moved(DOOR, m, (0, 0.8)) for k, m in MOTIONS.items()},
    "out of order": lambda: moved(
        DOOR, Jump(), (1.0, 0.2), (0.7, 1.0), (0.8, 0.4), (1.0, 0.6), (2.0, 1.7)
    ),
    "rate": lambda: moved(DOOR, Servo(0.5, 40.0), (0.0, 0.0), (1.0, 1.5)),
    "weak": lambda: moved(
        door("d", Pose2(1.0, -0.5)), Servo(0.5, 40.0), (0.2, 1.2), start=Pose2(0.4)
    ),
    "strong": lambda: moved(
        door("d", Pose2(1.0, -0.5)), Servo(0.5, 4000.0), (0.2, 1.2), start=Pose2(0.4)
    ),
    **{f"trigger, {k}": lambda m=m: approach(near(m)) for k, m in MOTIONS.items()},
    **{f"at rest, {k}": lambda m=m: approach(near(m, start=0.9)) for k, m in MOTIONS.items()},
    "at the distance": lambda: approach(near(distance=1.25), Pose2(2.975, 0.525 - 1.25)),
    "within the distance": lambda: approach(near(distance=1.25), Pose2(2.975, 0.525 - 1.249999)),
    "rearms": lambda: approach(near(Servo(2.0, 40.0), rearm=1.8)),
    "into the robot": lambda: moved(
        door("d", AHEAD, friction=1.0), Jump(), (0.0, 1.5), (0.5, 0.0), start=BESIDE
    ),
    "over the robot": lambda: moved(
        door("d", AHEAD), Jump(), (0.0, 2.0), (0.5, 0.0), start=Pose2(1.45, 0.2)
    ),
    "blocked trigger": lambda: world(
        door("d", AHEAD), start=BESIDE, behaviours=(near(start=1.5, end=0.0, distance=5.0),)
    ),
    "blocked reaction": lambda: world(
        door("d", AHEAD), start=BESIDE, behaviours=(closes(LegBegins(1), joint="d.hinge"),)
    ),
    "blocked slider": lambda: world(
        sliding_door("d", Pose2(0.9, -1.0), 1.0), start=BESIDE,
        behaviours=(Reaction("d.rail", 1.0, 0.3, LegBegins(1), Jump()),),
    ),
    "leg": lambda: told(LegBegins(2), 0.5),
    "first leg": lambda: told(LegBegins(1)),
    "waypoint": lambda: told(WaypointReached("b")),
    "one after another": row,
    "by a servo": lambda: two(frames(Servo(1.0, 40.0), (1.0, 1.0), joint="other.hinge"), MOVES),
    "by the robot": lambda: two(MOVES, start=Pose2(1.0, -5.5)),
    "never": lambda: two(MOVES, start=Pose2(), frozen=True),
    "walk into the robot": lambda: walking(at=Pose2()),
    "walk to a wall": lambda: walking(wall("wall", 0.4, -2.0, 0.6, 2.0), at=Pose2()),
    "yields": lambda: walking(at=Pose2(), yielding=1.0),
    "robot behind": lambda: walking(at=Pose2(-4.5), yielding=1.0),
    "robot far away": lambda: walking(at=Pose2(0.0, 2.0), yielding=1.0),
    "stands": lambda: world(person(pose=Pose2(1.0))),
    "walk through a door": lambda: walking(door(pose=Pose2(0.0, -0.5))),
    "walk on leg 2": lambda: walking(event=LegBegins(2), start=0.5),
    "two walk": lambda: world(
        person(), person("guest"), start=FAR,
        behaviours=(replace(LINE, start=1.0), GUEST),
    ),
    **{
        f"falls shut from {rest} rad": lambda rest=rest: light(falls(rest), Pose2(1.28))
        for rest in (0.8, 1.4, 2.0)
    },
    "falls shut": lambda: light(falls(), Pose2(0.0, -20.0, math.pi / 2)),
    "pushed at rest": lambda: light(falls(distance=0.2), Pose2(-0.7, 1.2, -math.pi / 2)),
    "thrown": lambda: light(falls(begin=0.0)),
    "published": published,
    "loose": lambda: light(
        frames(Jump(), (1.0, 1.7), (20.0, 0.0)), Pose2(-0.6, -1.5, math.pi / 2)
    ),
}  # fmt: skip


def numbers(values):
    return " ".join(f"{round(float(value), 3) + 0.0:g}" for value in values)


def state(now):
    """The world in a line, then a line for each event and each contact since the last look."""
    pose, twist = now.pose(), now.twist()
    words = [
        f"{now.time:g} s: at {numbers((pose.x, pose.y, pose.yaw))}",
        f"moves {numbers((twist.vx, twist.vy, twist.wz))}",
    ]
    if now.joint_names:
        positions, velocities = now.joint_states()
        words += [f"joints {numbers(positions)}", f"turn {numbers(velocities)}"]
    lines = [", ".join(words)]
    lines += [f"    {e.time:g} s {e.source}: {e.text}" for e in now.take_events()]
    for c in now.take_contacts():
        way = f"at {numbers(c.point)} towards {numbers(c.normal)}, {numbers([c.depth])} m deep"
        lines.append(f"    {c.time:g} to {c.until:g} s: {c.first} touches {c.second} {way}")
    return lines


STEP = re.compile(r"(?:every (\S+) s )?(?:(\S+) (\S+) (\S+) )?for (\S+) s")


def happens(build, program):
    now, lines = build(), []
    for part in program.split(", "):
        for step in part.split(" then "):
            if step.startswith("progress"):
                now.progress(*map(int, step.split()[1:]))
                continue
            every, *twist, seconds = STEP.fullmatch(step).groups()
            if twist[0]:
                now.command(Twist2(*map(float, twist)))
            end = now.tick + round(float(seconds) * 100)
            while every and now.tick + round(float(every) * 100) < end:
                now.advance(round(float(every) * 100))
                lines += state(now)
            if end > now.tick:
                now.advance(end - now.tick)
        lines += state(now)
    return "\n    ".join(lines)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_each_world_goes_on_as_stands_below_its_program(path, golden):
    golden(f"worlds/{path.name}", answers(path, WORLDS.__getitem__, happens))


def test_each_world_goes_on_somewhere():
    names = {line for path in FILES for line in path.read_text("utf-8").splitlines()}
    assert {n.removeprefix("== ").partition(":")[0] for n in names if n[:3] == "== "} == {*WORLDS}


FOLD, ROOT = FOLDING.joints
WEIGHTLESS = tuple(replace(link, mass=0.0) for link in FOLDING.links)
SHUT = door("d")


@pytest.mark.parametrize(
    ("part", "behaviours", "message"),
    [
        (replace(FOLDING, joints=(FOLD, replace(ROOT, parent="b"))), (), "form a loop"),
        (replace(FOLDING, joints=(FOLD, replace(ROOT, parent="nothing"))), (), "unknown link"),
        (replace(FOLDING, links=WEIGHTLESS), (), "has no mass"),
        (SHUT, (Hold("d.lock", 0.0),), "no joint 'd.lock'"),
        (SHUT, (Hold("d.hinge", 0.0), Hold("d.hinge", 1.0)), "more than one"),
        (
            SHUT,
            (Trigger("d.hinge", 0.0, 1.4, 1.3, Jump(), of="doorway"),),
            "stands in no doorway",
        ),
        (replace(SHUT, frozen=True), (Hold("d.hinge", 0.0),), "frozen"),
        (
            SHUT,
            (Reaction("d.hinge", 1.5, 0.0, WaypointReached("x"), Jump(), 0.0),),
            "no waypoint 'x'",
        ),
        (SHUT, (replace(LINE, object="d"),), "'d' is not a mover"),
        (person(), (replace(LINE, object="nobody"),), "not a mover"),
        (person(), (KeyFrames("visitor.x", (KeyFrame(0, 0),), Servo()),), "belongs to a mover"),
        (person(), (Trigger("visitor.yaw", 0.0, 1.0, 1.0, Servo()),), "belongs to a mover"),
    ],
)
def test_what_cannot_be_is_refused(part, behaviours, message):
    with pytest.raises(ValueError, match=message):
        world(part, behaviours=behaviours)
