"""Verdicts on traces a person can follow, whole and cut short: ``verdicts/*.txt``.

A section of a file begins with ``== name: description``, where the name is that of a trace below.
Under each oracle stands its verdict. ``[8 s]`` in front of an oracle cuts the trace there;
``[8 s so far]`` judges such a run as one that goes on. ``[against]`` asks when the run spoke
against the oracle, and for the limits of its signals. ``pytest --update`` writes verdicts anew.
"""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from daemon.judging.oracles import (
    SignalSampler,
    judge,
    judge_so_far,
    oracle_timeline,
    overall_outcome,
    trace_problems,
)
from daemon.model.spec import OracleText
from daemon.model.verdicts import Outcome
from daemon.trace import CommandTrack, ContactRecord, JointTrack, LatencyTrack, ProgressRecord
from grammars.model.geometry import Pose2
from grammars.model.scene import Doorway, Region
from grammars.oracle import SIGNALS, Signal, object_signals, obstacle_names
from grammars.text.expressions import render
from tests.engine.judging.traces import (
    CORRIDOR,
    ROBOT,
    along,
    answers,
    box,
    cut,
    make_trace,
    mission,
    still,
    times,
    track,
    verdict,
    with_tree,
)

FILES = sorted((Path(__file__).parent / "verdicts").glob("*.txt"))


def with_error(error, rate=20.0, **fields):
    """A robot whose position estimate is off by ``error`` to its left, sample by sample."""
    time = np.arange(len(error)) / rate
    motion = along(time)
    return make_trace(motion, estimate=track(time, motion.x, error), **fields)


def bump(end=6.0, **fields):
    time = times(20.0)
    return with_error(np.where((time >= 5.0 - 1e-9) & (time < end - 1e-9), 0.5, 0.05), **fields)


def irregular():
    time = np.array([0.0, 1.0, 4.0, 5.0])
    motion = along(time)
    error = np.array([0.5, 0.0, 0.5, 0.5])
    return make_trace(motion, estimate=track(time, motion.x, error), valid_until=6.0)


def known_late():
    time = times(5.0)
    return make_trace(along(time), estimate=track(time[40:], time[40:] * 0.5, 0.1))


def journey(corners, *waypoints):
    """A robot that drives from corner to corner at 0.5 m/s, in 20 Hz samples."""
    points = np.array(corners)
    reach = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    time = times(math.ceil(reach[-1] / 0.5))
    way = np.minimum(time * 0.5, reach[-1])
    x, y = (np.interp(way, reach, points[:, axis]) for axis in (0, 1))
    motion = replace(along(time), x=x, y=y)
    return make_trace(motion, limit=600.0, goal=mission(*waypoints))


def touching(*touches):
    """Ten seconds along x with contacts: time, both things, depth."""
    contacts = tuple(
        ContactRecord(time, first, second, (1.5, 0.2), (0.0, 1.0), depth)
        for time, first, second, depth in touches
    )
    return make_trace(along(times(10.0)), contacts=contacts)


def progress(*reached, state="active"):
    return tuple(ProgressRecord(time, n, n, state) for n, time in enumerate(reached))


def legs(*changes, **fields):
    """Along x at 0.5 m/s past waypoints, each reached at one of ``changes`` [s]; a touch at 6 s."""
    time = times(10.0)
    motion = along(time)
    touch = ContactRecord(6.0, "robot", "door-17.leaf", (3.0, 0.2), (0.0, 1.0), 0.004)
    values = {
        "goal": mission(*((0.5 * t, 0.0) for t in changes)),
        "progress": progress(0.0, *changes),
        "estimate": track(time, motion.x, np.where((time >= 6.0) & (time < 7.0), 0.5, 0.1)),
        "contacts": (touch,),
    }
    return make_trace(motion, **values | fields)


def back_to_a_leg():
    changes = ((0.0, 0), (2.0, 1), (5.0, 0), (8.0, 2))
    reports = tuple(ProgressRecord(t, n, n, "active") for t, n in changes)
    return legs(goal=mission((1.0, 0.0), (4.0, 0.0)), progress=reports, estimate=track(*TWICE))


TWICE = np.array([0.0, 10.0]), np.array([0.0, 5.0])


def full():
    """A trace in which everything was recorded."""
    trace = touching((3.0, "robot", "door-17.leaf", 0.004), (4.0, "wall-north", "robot", 0.009))
    time = trace.ground_truth.time
    estimate = track(time[2:], trace.ground_truth.x[2:], 0.2)
    command = CommandTrack(time[10:12], np.array([0.4, 0.6]), np.zeros(2), np.array([0.1, -0.2]))
    return with_tree(
        replace(
            trace,
            estimate=estimate,
            cloud=estimate,
            cloud_count=np.full(len(estimate.time), 500),
            progress=progress(0.0),
            command=command,
            latency=LatencyTrack(time[20:], np.full(len(time) - 20, 0.012)),
        )
    )


def backwards():
    trace = full()
    truth = trace.ground_truth
    return replace(trace, ground_truth=replace(truth, vx=-truth.vx))


def between_places():
    """From a hall through a doorway to a room, x = 0 to 5 m, while the door swings shut."""
    time = times(10.0)
    angles = np.linspace(0.0, 1.5, len(time))[:, None]
    scene = replace(
        CORRIDOR,
        regions=(Region("hall", box(-5, -1, 4, 1)), Region("room", box(4.2, -1, 9, 1))),
        doorways=(Doorway("doorway", Pose2(4.0, 0.0), box(4, -0.5, 4.2, 0.5), 1.0, 0.0, 2.0),),
    )
    joints = JointTrack(("door-17.hinge",), time, angles, np.zeros_like(angles))
    return make_trace(along(time), scene=scene, joints=joints)


def estimated(stamps, x, y=0.0, *, yaw=0.0, motion=None, sigma=0.1, **fields):
    """A robot that stands still, or moves as is said, and its estimate."""
    estimate = track(stamps, x, y, sigma=sigma)
    estimate = replace(estimate, yaw=yaw + 0.0 * stamps)
    return make_trace(motion or still(times(4.0)), estimate=estimate, **fields)


def across_the_seam():
    time = times(2.0, rate=2.0)
    yaw = math.pi - 0.1 + 0.2 * time
    motion = replace(still(time), yaw=np.where(yaw > math.pi, yaw - math.tau, yaw))
    return estimated(np.array([0.75]), 0.0, yaw=0.05 - math.pi, motion=motion)


def half_turned():
    time = times(1.0)
    motion = replace(still(time), yaw=np.full(len(time), math.pi - 0.05))
    return estimated(time, 0.0, yaw=0.05 - math.pi, motion=motion)


def unsure():
    time = times(9.95)
    return make_trace(still(time), cloud=track(time, np.where(time < 1.0, 0.21, 0.19), 0.19))


def answered(time, seconds):
    latency = LatencyTrack(np.array(time), np.array(seconds))
    return make_trace(along(times(10.0)), latency=latency)


def busy(slow):
    """Answers every 10 ms, five to each sample of the true pose, a slow one amid them."""
    seconds = np.full(1000, 0.010)
    seconds[512] = slow
    return answered(np.arange(1000) / 100, seconds)


def plain(**fields):
    return make_trace(along(times(10.0)), **fields)


def recoveries():
    return with_tree(
        plain(),
        (2.0, "Spin 1 IDLE>RUNNING", "Spin-2 7 IDLE>RUNNING", "RecoveryActions 3 IDLE>RUNNING"),
        (3.0, "Spin 1 RUNNING>FAILURE", "Spin 1 FAILURE>IDLE"),
        # A service that answers within a tick is never RUNNING.
        (4.0, "ClearLocalCostmap-Subtree 4 IDLE>SUCCESS", "WaitForDoor 5 IDLE>RUNNING"),
        (5.0, "Spin 1 IDLE>RUNNING", "Wait 6 RUNNING>SUCCESS"),
    )


def nodes():
    return with_tree(
        plain(),
        (1.0, "FollowPath 1 IDLE>RUNNING", "FollowPath 2 IDLE>RUNNING"),
        (2.0, "FollowPath 1 RUNNING>IDLE"),
        (3.0, "FollowPath 2 RUNNING>SUCCESS", "Compute Path 1 IDLE>RUNNING"),
        (5.0, "Compute Path 1 RUNNING>SUCCESS"),
        (6.01, "Wait 1 IDLE>RUNNING", "Wait 1 RUNNING>SUCCESS"),
    )


def twice_off():
    time = times(10.0, 2.0)
    motion = along(time)
    off = ((time >= 3.0) & (time < 5.0)) | ((time >= 7.0) & (time < 8.0))
    estimate = track(time, motion.x, np.where(off, 0.5, 0.1))
    goal = mission((3.0, 0.0), (5.0, 0.0))
    return make_trace(motion, goal=goal, estimate=estimate, progress=progress(0.0, 6.0))


def without_motion():
    nothing = np.empty(0)
    command = CommandTrack(nothing, nothing, nothing, nothing)
    return make_trace(still(nothing), goal=mission((1.0, 0.0)), command=command)


def going_on():
    time = times(4.0)
    motion = along(time)
    estimate = track(time, motion.x, np.where(time >= 2.0, 0.4, 0.1))
    hit = ContactRecord(3.0, "robot", "wall-north", (0.0, 0.0), (1.0, 0.0), 0.01)
    return make_trace(motion, estimate=estimate, contacts=(hit,), goal=mission((5.0, 0.0)))


def standing(vx=0.0, wz=0.0, vy=0.0, count=201, **fields):
    """A robot that stays where it is, whatever it is told last, and should be 2 m further."""
    time = times(10.0)
    given = CommandTrack(time[201 - count :], *(np.full(count, v) for v in (vx, vy, wz)))
    return make_trace(still(time), **{"goal": mission((2.0, 0.0)), "command": given} | fields)


def back_and_forth():
    time, zero = times(10.0), np.zeros(201)
    command = CommandTrack(time, np.where(np.arange(201) % 2, 0.3, -0.3), zero, zero)
    return standing(command=command)


def ended_at_once(state):
    start = ProgressRecord(0.0, 0, 0, "active")
    return standing(progress=(start, ProgressRecord(0.1, 0, 0, state)))


def turning():
    time = times(10.0)
    motion = replace(still(time), yaw=0.3 * time, wz=np.full(len(time), 0.3))
    return make_trace(motion, goal=mission((2.0, 0.0)))


def leaping():
    trace = along(times(10.0))
    return make_trace(replace(trace, x=np.where(trace.time >= 3.0, trace.x + 4.0, trace.x)))


def driven(**changes):
    """A robot whose drive is otherwise."""
    return replace(ROBOT, drive=replace(ROBOT.drive, **changes))


HELD = ContactRecord(0.0, "robot", "wall-north", (0.0, 1.0), (0.0, 1.0), 0.01)
TEN = times(10.0)
STRAIGHT = ((0, 0), (4, 0))
BACK = ((0, 0), (4, 0), (0, 0))
TRACES = {
    "bump": bump,
    "bump of 20 s": lambda: bump(limit=20.0),
    "long bump": lambda: bump(end=6.5),
    "two steps": lambda: with_error(np.where(TEN >= 4.0, 0.5, np.where(TEN >= 2.0, 0.4, 0.0))),
    "irregular": irregular,
    "four times": lambda: with_error(np.where(np.floor(TEN) % 3 == 0, 0.5, 0.0)),
    "ramp": lambda: with_error(np.arange(101) / 100.0, rate=1.0, limit=200.0),
    "exact": lambda: with_error(np.full(21, 0.25)),
    "plain": plain,
    "known late": known_late,
    "nothing": lambda: cut(make_trace(along(np.zeros(1))), -1.0),
    "empty scene": lambda: plain(scene=replace(CORRIDOR, solids=(), objects=())),
    "round a corner": lambda: journey(
        ((0, 0), (4, 0), (4, 4)), (2.0, 0.1), (4.0, 0.0), (4.0, 4.0)
    ),
    "wrong order": lambda: journey(STRAIGHT, (3.0, 0.0), (1.0, 0.0)),
    "near miss": lambda: journey(
        ((0, 0.26), (4, 0.0), (8, 0.0), (0, 0.0)), (0, 0), (4, 0), (8, 0), (0, 0)
    ),
    "left undone": lambda: journey(STRAIGHT, (1.0, 0.0), (6.0, 0.0), (0.0, 9.0), (5.0, 3.0)),
    "circuit": lambda: journey(BACK, *BACK),
    "half a circuit": lambda: journey(STRAIGHT, *BACK),
    "straight": lambda: journey(STRAIGHT, (2.0, 0.1), (3.0, 0.0)),
    "one waypoint": lambda: journey(STRAIGHT, (2.0, 0.0)),
    "touches": lambda: touching(
        (3.01, "robot", "wall-north", 0.004),
        (3.02, "door-17.leaf", "robot", 0.009),
        (3.03, "robot", "wall-south", 0.002),
        (3.04, "door-17.leaf", "wall-north", 0.5),
        (99.0, "robot", "wall-south", 0.7),
    ),
    "reports": lambda: plain(goal=mission((2, 0), (4, 0)), progress=progress(0.0, 4.0, 8.0)),
    "reports until the limit": lambda: plain(
        goal=mission((2, 0), (4, 0)), progress=progress(0.0, 4.0), ended="limit"
    ),
    "late reports": lambda: plain(
        goal=mission((2.0, 0.0), (2.5, 3.0)),
        progress=tuple(ProgressRecord(t, n, n, "active") for n, t in enumerate((1.0, 4.0, 8.0))),
    ),
    "two legs": lambda: legs(4.0, 9.0),
    "never begun": lambda: plain(goal=mission((2, 0), (4, 0), (40, 0), (50, 0))),
    "back to a leg": back_to_a_leg,
    "driving": lambda: estimated(
        np.array([0.5, 1.525, 2.513]), np.array([0.5, 1.525, 2.513]),
        motion=along(times(4.0), speed=1.0),
    ),
    "off": lambda: estimated(times(4.0), -0.3, 0.4, yaw=0.1),
    "half turned": half_turned,
    "across the seam": across_the_seam,
    "unsure": unsure,
    "without particles": lambda: estimated(times(4.0), 0.1, sigma=0.2),
    "with particles": lambda: estimated(
        times(4.0), 0.0, sigma=0.2, cloud=track(times(4.0), 0.0, sigma=0.3)
    ),
    "old": lambda: estimated(np.array([0.0, 1.0]), 0.0),
    "full": full,
    "backwards": backwards,
    "between places": between_places,
    "slow": lambda: busy(0.150),
    "just in time": lambda: busy(0.100),
    "three answers": lambda: answered([2.0, 2.2, 4.0], [0.030, 0.120, 0.010]),
    "late answers": lambda: answered([1.0, 2.0, 9.0], [0.030, 0.120, 0.300]),
    "recoveries": recoveries,
    "nodes": nodes,
    "going on": going_on,
    "doubted": lambda: plain(problems=("the clock jumped at 3.20 s",)),
    "leaping": leaping,
    "told to drive": lambda: standing(0.3),
    "told to reverse": lambda: standing(-0.3),
    "told to move sideways": lambda: standing(vy=0.3),
    "told to turn": lambda: standing(wz=0.3),
    "told to stand": standing,
    "told nothing": lambda: standing(count=0),
    "given up": lambda: ended_at_once("aborted"),
    "called done": lambda: ended_at_once("succeeded"),
    "held": lambda: standing(0.3, contacts=(HELD,)),
    "no sideways drive": lambda: standing(vy=0.3, robot=driven(kind="differential")),
    "stiff": lambda: standing(0.3, robot=driven(friction_loss=0.4)),
    "back and forth": back_and_forth,
    "told at the end": lambda: standing(0.3, count=1),
    "there already": lambda: standing(goal=mission((0.05, 0.0))),
    "nowhere to go": lambda: standing(goal=mission()),
    "turning": turning,
    "twice off": twice_off,
    "without motion": without_motion,
}  # fmt: skip


def number(value):
    return "…" if value is None else f"{round(value, 9) + 0.0:.7g}"


def told(found):
    """A verdict in one line: margin or its bounds, decisive moment, value, limit, thing, note."""
    words = [found.outcome.value]
    if found.outcome is not Outcome.MEASURE:
        bounds = number(found.lower)
        if found.lower != found.upper:
            bounds = f"{bounds} to {number(found.upper)}"
        words.append(f"{bounds} {found.unit}".rstrip())
    seen = found.evidence
    if seen.time is not None:
        words.append(f"at {number(seen.time)} s")
    if seen.value is not None:
        words.append(f"value {number(seen.value)}")
    if seen.limit is not None:
        words.append(f"limit {number(seen.limit)}")
    return ", ".join([*words, *filter(None, (seen.object, seen.note))])


def spoke_against(trace, text):
    found = oracle_timeline(OracleText("it", text), SignalSampler(trace))
    spans = [f"{number(begin)} to {number(end)} s" for begin, end in found.against]
    limits = [f"limit of {one.signal} {number(one.value)}" for one in found.limits]
    signals = [f"reads {', '.join(map(render, found.signals))}"] if found.signals else []
    return "; ".join([", ".join(spans) or "never", *limits, *signals])


def judged(trace, line):
    if line.startswith("[against] "):
        return spoke_against(trace, line.removeprefix("[against] "))
    at, so_far, text = re.fullmatch(r"(?:\[(\S+) s( so far)?\] )?(.*)", line).groups()
    trace = trace if at is None else cut(trace, float(at))
    (found,) = (judge_so_far if so_far else judge)(trace, (OracleText("it", text),))
    return told(found)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_each_verdict_is_the_one_below_its_oracle(path, golden):
    golden(f"verdicts/{path.name}", answers(path, lambda name: TRACES[name](), judged))


def test_each_trace_is_judged():
    names = {line for path in FILES for line in path.read_text("utf-8").splitlines()}
    assert {n.removeprefix("== ").partition(":")[0] for n in names if n[:3] == "== "} == {*TRACES}


ALONE = [name for name, declared in SIGNALS.items() if not declared.relates]


@pytest.mark.parametrize("name", [*ALONE, *object_signals(CORRIDOR)])
def test_every_signal_of_the_registry_is_sampled(name):
    trace = full()
    arguments = (Signal("Spin"),) if name == "bt.node" else ()
    found = SignalSampler(trace).sample(Signal(name, arguments))
    assert found.values.shape == trace.ground_truth.time.shape
    assert np.isfinite(found.values).any()


def test_the_nearest_of_all_things_is_the_nearest_of_each():
    def least(*of):
        return verdict(full(), f"min(clearance({', '.join(of)}))").evidence.value

    box = "0.4 m", "0.3 m"
    each = [least(name, *box) for name in obstacle_names(CORRIDOR) if name != "lintel"]
    assert least(*box) == min(each)


def test_a_long_sum_is_judged_like_a_short_one():
    assert ", value 481" in judged(full(), f"final({'1+' * 480}1)")


@pytest.mark.parametrize(
    ("trace", "text", "outcome", "overall"),
    [
        (replace(bump(), ended="crashed"), "always(loc.error <= 0.6 m)", "inconclusive", "error"),
        (replace(bump(), ended="crashed"), "always(loc.error <= 0.35 m)", "fail", "error"),
        (standing(), "reached(mission, 0.1 m)", "fail", "fail"),
        (standing(0.3), "reached(mission, 0.1 m)", "error", "error"),
    ],
)
def test_a_crash_is_an_error_whatever_was_seen_before(trace, text, outcome, overall):
    found = judge(trace, (OracleText("a", text),))
    assert found[0].outcome == outcome
    assert overall_outcome(trace, found) == overall
    assert (trace_problems(trace) == ()) == (outcome != "error")
