"""Leading margins: the verdict's sign, and down towards the failure where the verdict is flat."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.judging.oracles import judge, judge_leading
from daemon.model.spec import OracleText
from daemon.model.verdicts import Outcome
from daemon.trace import ContactRecord, JointTrack, ProgressRecord
from grammars.model.scene import Region
from tests.engine.judging.test_properties import FORMS, PREDICATES, oracles, traces
from tests.engine.judging.traces import (
    CORRIDOR,
    NOTHING,
    ROBOT,
    along,
    box,
    cut,
    make_trace,
    mission,
    times,
    track,
    verdict,
)

TIME = times(10.0)
NORTH = 1.0
HALF_WIDTH = 0.233
AROUND = mission((0.0, 0.0), (4.0, 0.0), (9.0, 0.0), (9.0, 3.0))
ALL_FORMS = (
    *FORMS,
    *("always(contact.depth <= {q} cm)", "max(contact.depth) <= 5 mm", "max(contact.depth) < 0 m"),
    *("mean(contact.depth) <= 1 mm", "min(contact.depth) >= {q} m", "p95(contact.depth) <= 1 cm"),
    *("always(distance(robot, wall-north) >= {q} m)", "min(distance(robot, door-17)) >= {q} m"),
    *("never(contact(wall-north))", "eventually(contact)", "always(contact or {p})"),
    *("count({p}) > 2", "count({p}) < 0", "fraction(contact) > 0 %", "time({p}) < 0 s"),
    *("longest(contact) >= 1 s", "max(-contact.depth) <= {q} m", "never(contact) until ({p})"),
    *("always({p}) until within 1 s (contact)", "never(not contact and {p})"),
    "reached(mission, 2 m)",
)  # fmt: skip


def lead(trace, text):
    _, (found,) = judge_leading(trace, (OracleText("it", text),))
    return found


def margin(trace, text):
    return lead(trace, text).margin


def passing(gap, depth=None, *, footprint=ROBOT.footprint, yaw=0.0):
    """Along a wall, ``gap`` [m] from it; with a ``depth`` [m] the robot touches it."""
    y = np.full(len(TIME), NORTH - HALF_WIDTH - gap)
    hits = [] if depth is None else [depth]
    contacts = tuple(
        ContactRecord(5.0, "robot", "wall-north", (2.5, NORTH), (0.0, 1.0), d) for d in hits
    )
    return make_trace(
        along(TIME, y=y, yaw=np.full(len(TIME), yaw)),
        robot=replace(ROBOT, footprint=footprint),
        contacts=contacts,
        goal=AROUND,
        progress=(ProgressRecord(0.0, 0, 0, "active"),),
    )


NEARER = (passing(0.3), passing(0.1), passing(0.02), passing(0.0, 0.0), passing(-0.01, 0.01))
"""Passes a wall at 30, 10 and 2 cm, touches it, digs 1 cm into it."""


def falls(margins):
    return all(later < former for former, later in itertools.pairwise(margins))


@pytest.mark.parametrize("form", ALL_FORMS)
@given(data=st.data())
def test_the_sign_is_that_of_the_verdict(form, data):
    trace, text = data.draw(traces()), data.draw(oracles(form))
    if data.draw(st.booleans()):
        trace = cut(trace, data.draw(st.integers(0, 20)) / 4.0)
    judged, found = verdict(trace, text), lead(trace, text)
    if judged.outcome is Outcome.FAIL:
        assert found.margin <= -1e-6
    elif judged.outcome is Outcome.PASS:
        assert found.margin >= 0.0
    else:
        assert found.margin is None


@pytest.mark.parametrize("predicate", PREDICATES)
@given(trace=traces())
def test_of_what_never_happened_the_nearest_counts(predicate, trace):
    p = predicate.format(q=0.5)
    never, eventually = (lead(trace, f"{word}({p})").margin for word in ("never", "eventually"))
    if never is not None and eventually is not None:
        # What does not hold is a failure, by however little: at least 1e-6, or a share of it.
        assert abs(never + eventually) <= 1e-5


@given(traces(), st.lists(oracles(), min_size=1, max_size=5))
def test_verdicts_are_the_same_with_and_without(trace, texts):
    written = tuple(OracleText("it", text) for text in texts)
    verdicts, leads = judge_leading(trace, written)
    assert verdicts == judge(trace, written)
    assert leads == tuple(lead(trace, text) for text in texts)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("never(contact)", "m"),
        ("never(contact(wall-north))", "m"),
        ("always(not contact)", "m"),
        ("never(contact) when speed > 0.1 m/s", "m"),
        ("never(contact) until (elapsed >= 8 s)", "m"),
        ("never(contact and clearance < 0.5 m)", "m"),
        ("never(contact or speed > 10 m/s)", "1"),
        ("max(contact.depth) < 1 mm", "m"),
        ("always(contact.depth <= 1 mm)", "m"),
        ("always(distance(robot, wall-north) > 0 m)", "m"),
        ("min(distance(robot, wall-north)) > 0 m", "m"),
    ],
)
def test_a_robot_that_comes_nearer_has_a_smaller_margin(text, unit):
    assert falls([margin(trace, text) for trace in NEARER])
    found = lead(NEARER[2], text)
    assert (found.unit, found.object) == (unit, "wall-north")
    assert [margin(trace, text) < 0.0 for trace in NEARER[::4]] == [False, True]


@pytest.mark.parametrize(
    "text",
    [
        "time(contact) <= 1 s",
        "count(contact) <= 2",
        "fraction(contact) < 5 %",
        "longest(contact) < 2 s",
        "mean(contact.depth) < 1 cm",
    ],
)
def test_an_amount_of_nothing_leads_to_what_is_counted(text):
    assert falls([margin(trace, text) for trace in NEARER[:4]])


def test_contact_is_led_by_the_clearance_and_then_by_the_depth():
    found = [margin(trace, "never(contact)") for trace in NEARER]
    assert found == pytest.approx([0.3, 0.1, 0.02, -1e-6, -0.01])
    assert verdict(NEARER[0], "never(contact)").margin == 1.0
    assert margin(NEARER[4], "never(contact(door-17))") == pytest.approx(2.65)


def test_the_margin_of_a_quantity_is_the_verdicts_own():
    trace = passing(0.02)
    own = (
        "always(clearance >= 5 cm)",
        "max(speed) <= 1 m/s",
        "final(elapsed) <= 20 s",
        "time(pose.x < 3 m) <= 20 s",
        "always(speed <= 1 m/s and speed >= 0.1 m/s)",
    )
    for text in own:
        assert margin(trace, text) == verdict(trace, text).margin


def test_unlike_quantities_are_shares_of_their_limits():
    trace = passing(0.02)
    assert lead(trace, "always(clearance >= 1 cm and speed <= 1 m/s)").unit == "1"
    assert margin(trace, "always(clearance >= 1 cm and speed <= 1 m/s)") == pytest.approx(0.5)
    assert margin(trace, "always(clearance >= 1 cm and speed <= 0.6 m/s)") == pytest.approx(1 / 6)
    # A contact is a share of the robot's inscribed radius.
    assert margin(trace, "never(contact or speed > 1 m/s)") == pytest.approx(0.02 / HALF_WIDTH)


def test_the_outline_counts_where_it_is_not_a_box():
    octagon = tuple((0.35 * np.cos(a), 0.35 * np.sin(a)) for a in np.arange(8) * np.pi / 4)
    # Its box turns with the robot and reaches 0.145 m farther than its flat sides do.
    side = 0.35 * np.cos(np.pi / 8)
    trace = passing(0.2, footprint=octagon, yaw=np.pi / 8)
    assert margin(trace, "never(contact)") == pytest.approx(0.2 + HALF_WIDTH - side)
    assert falls([margin(passing(gap, footprint=octagon, yaw=np.pi / 8), "never(contact)")
                  for gap in (0.55, 0.5, 0.3, 0.12)])  # fmt: skip
    door = passing(-0.2, footprint=octagon)
    assert lead(door, "never(contact(door-17))").object == "door-17.leaf"


def test_a_door_that_comes_is_led_to():
    angles = -np.linspace(0.0, 1.2, len(TIME))[:, None]
    swings = JointTrack(("door-17.hinge",), TIME, angles, np.zeros_like(angles))
    octagon = tuple((0.35 * np.cos(a), 0.35 * np.sin(a)) for a in np.arange(8) * np.pi / 4)
    for footprint in (ROBOT.footprint, octagon):
        robot = replace(ROBOT, footprint=footprint)
        shut, open_ = (
            make_trace(along(TIME, speed=0.75), joints=joints, robot=robot)
            for joints in (None, swings)
        )
        text = "never(contact(door-17))"
        assert margin(open_, text) < margin(shut, text)


def test_where_there_is_nothing_to_run_into_nothing_is_said():
    trace = make_trace(along(TIME))
    low = replace(trace, spec=replace(trace.spec, robot=replace(ROBOT, height=0.01)))
    scene = replace(CORRIDOR, solids=(), objects=())
    assert lead(make_trace(along(TIME), scene=scene), "never(contact)").margin is None
    assert verdict(low, "never(contact(lintel))").outcome is Outcome.PASS
    assert lead(low, "never(contact(lintel))").margin is None


def to(goal, ends_at):
    return make_trace(along(TIME, speed=ends_at / 10.0), goal=goal)


def test_a_mission_that_failed_has_the_way_that_was_missing():
    text = "reached(mission, 0.5 m)"
    assert margin(to(AROUND, 5.0), text) == pytest.approx(-(4.0 - 0.5) - 3.0)
    assert margin(to(AROUND, 1.0), text) == pytest.approx(-(3.0 - 0.5) - 5.0 - 3.0)
    assert falls([margin(to(AROUND, way), text) for way in (9.0, 8.6, 8.0, 5.0, 4.0, 3.4, 1.0)])
    assert lead(to(AROUND, 5.0), text).object == "w3"
    last = mission((0.0, 0.0), (4.0, 0.0))
    assert margin(to(last, 3.8), text) == verdict(to(last, 3.8), text).margin
    assert margin(to(last, 3.0), text) == pytest.approx(-0.5)


def test_a_waypoint_the_guard_forbids_to_count_is_missing():
    text = "reached(mission, 0.5 m) when pose.x < 2 m"
    assert margin(to(AROUND, 9.0), text) == pytest.approx(-1.5 - 5.0 - 3.0, abs=0.1)


@pytest.mark.parametrize(
    "text",
    [
        "eventually(clearance(door-17) <= 0.1 m)",
        "eventually(contact(door-17))",
        "always(speed <= 1 m/s) until (contact(door-17))",
        "time(contact(door-17)) >= 1 s",
        "count(contact(door-17)) >= 1",
        "fraction(contact(door-17)) > 10 %",
    ],
)
def test_what_never_came_is_as_near_as_it_was(text):
    found = [margin(to(AROUND, way), text) for way in (7.5, 6.0, 4.0, 1.0)]
    assert falls(found)
    assert max(found) < 0.0


def test_a_release_in_another_unit_is_missed_in_that_of_the_predicate():
    found = lead(passing(0.3), "always(clearance >= 0.1 m) until (elapsed >= 20 s)")
    # 10 of 20 s are missing: half of its limit, and so half of the other.
    assert (found.margin, found.unit) == (pytest.approx(-0.05), "m")


def test_the_waypoint_ahead_is_that_of_the_decisive_moment():
    y = np.where(np.arange(len(TIME)) < 150, 0.0, 0.4)
    progress = tuple(ProgressRecord(at, n, n, "active") for n, at in enumerate((0.0, 2.0, 6.0)))
    trace = make_trace(along(TIME, y=y), goal=AROUND, progress=progress)
    assert lead(trace, "never(contact)").waypoint == "w3"
    assert lead(trace, "never(contact) when abs(elapsed - 4 s) <= 1 s").waypoint == "w2"
    assert lead(trace, "always(clearance >= 5 cm)").waypoint == "w3"
    assert lead(trace, "reached(mission, 0.5 m)").waypoint == "w3"
    assert lead(trace, "mean(speed) <= 1 m/s").waypoint == ""
    assert lead(make_trace(along(TIME), goal=AROUND), "never(contact)").waypoint == ""


KITCHEN = replace(CORRIDOR, regions=(Region("kitchen", box(3.0, -1.0, 6.0, 1.0)),))


@pytest.mark.parametrize(
    ("text", "ways"),
    [
        ("eventually(in(robot, kitchen))", (4.0, 3.5, 2.0, 1.0)),
        ("never(in(robot, kitchen))", (1.0, 2.0, 3.2, 3.9)),
    ],
)
def test_places_are_led_to_by_the_way_to_their_border(text, ways):
    runs = [make_trace(along(TIME, speed=way / 10.0), scene=KITCHEN) for way in ways]
    assert falls([margin(run, text) for run in runs])
    assert lead(runs[0], text).unit == "m"
    assert abs(margin(runs[0], text)) == pytest.approx(1.0 if ways[0] == 4.0 else 2.0)


def test_confidence_is_led_by_what_is_left_of_two_sigma():
    motion = along(TIME)
    estimates = [track(TIME, motion.x, error, sigma=0.1) for error in (0.0, 0.15, 0.25)]
    text = "always(loc.inside_2sigma)"
    found = [margin(make_trace(motion, estimate=estimate), text) for estimate in estimates]
    assert found == pytest.approx([0.2, 0.05, -0.05])
    assert lead(make_trace(motion, estimate=NOTHING), text).margin is None


def test_an_amount_that_cannot_grow_leads_to_its_end():
    motion = along(TIME)
    runs = [make_trace(motion, estimate=track(TIME, motion.x, e)) for e in (0.0, 0.15, 0.19)]
    assert falls([margin(run, "fraction(loc.inside_2sigma) >= 95 %") for run in runs])


def test_measures_have_none_and_what_cannot_be_judged_has_no_number():
    written = (
        OracleText("near", "min(clearance)"),
        OracleText("typo", "always(sped < 1 m/s)"),
        OracleText("vain", "never(contact) when speed > 9 m/s"),
        OracleText("clear", "never(contact)"),
    )
    trace = passing(0.1)
    _, found = judge_leading(trace, written)
    assert [(one.oracle, one.unit) for one in found] == [
        ("typo", ""),
        ("vain", "m"),
        ("clear", "m"),
    ]
    assert [one.margin for one in found[:2]] == [None, None]
    invalid = replace(trace, problems=("damaged",))
    verdicts, found = judge_leading(invalid, written)
    assert [one.margin for one in found] == [None, None, None]
    assert {one.outcome for one in verdicts} == {Outcome.ERROR}
