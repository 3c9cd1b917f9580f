"""Leading margins: the verdict's sign, and down towards the failure where the verdict is flat.

``leads.txt`` has families of runs, each nearer to the failure than the one before, and what leads
in each; ``leading_kinds.txt`` what is known of oracles before anything runs.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.judging.leading_kind import LEADING_FLAGS, oracle_scale, why_flat
from daemon.judging.oracles import judge, judge_leading
from daemon.model.spec import OracleText
from daemon.model.verdicts import Outcome
from daemon.trace import ContactRecord, JointTrack, ProgressRecord
from grammars.model.scene import Region
from grammars.oracle import CustomOracle, CustomSignal, parse_oracle
from grammars.text.diagnostics import Where
from tests.engine.judging.test_properties import FORMS, PREDICATES, traces, written
from tests.engine.judging.test_verdicts import number
from tests.engine.judging.traces import (
    CORRIDOR,
    NOTHING,
    ROBOT,
    along,
    answers,
    box,
    cut,
    make_trace,
    mission,
    times,
    track,
)

ROOT = Path(__file__).parents[3]
HERE = Path(__file__).parent
TIME = times(10.0)
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


@pytest.mark.parametrize("every", range(4))
@given(data=st.data())
def test_the_sign_is_that_of_the_verdict(every, data):
    trace, texts = data.draw(traces()), data.draw(written(*ALL_FORMS[every::4]))
    if data.draw(st.booleans()):
        trace = cut(trace, data.draw(st.integers(0, 20)) / 4.0)
    verdicts, leads = judge_leading(trace, texts)
    assert verdicts == judge(trace, texts)
    for judged, found in zip(verdicts, leads, strict=True):
        if judged.outcome is Outcome.FAIL:
            assert found.margin <= -1e-6
        elif judged.outcome is Outcome.PASS:
            assert found.margin >= 0.0
        else:
            assert found.margin is None


@given(traces())
def test_of_what_never_happened_the_nearest_counts(trace):
    forms = [f"{word}({p.format(q=0.5)})" for p in PREDICATES for word in ("never", "eventually")]
    _, found = judge_leading(trace, [OracleText("it", text) for text in forms])
    for never, eventually in zip(found[::2], found[1::2], strict=True):
        if never.margin is not None and eventually.margin is not None:
            # What does not hold is a failure, by however little: at least 1e-6, or a share of it.
            assert abs(never.margin + eventually.margin) <= 1e-5


def passing(gap, depth=None, *, footprint=ROBOT.footprint, yaw=0.0):
    """Along a wall, ``gap`` [m] from it; with a ``depth`` [m] the robot touches it."""
    y = np.full(len(TIME), 1.0 - HALF_WIDTH - gap)
    hit = ContactRecord(5.0, "robot", "wall-north", (2.5, 1.0), (0.0, 1.0), depth)
    return make_trace(
        along(TIME, y=y, yaw=np.full(len(TIME), yaw)),
        robot=replace(ROBOT, footprint=footprint),
        contacts=() if depth is None else (hit,),
        goal=AROUND,
        progress=(ProgressRecord(0.0, 0, 0, "active"),),
    )


def to(end, **fields):
    """Along x to ``end`` [m]."""
    return make_trace(along(TIME, speed=end / 10.0), **{"goal": AROUND} | fields)


def stepping_aside():
    y = np.where(np.arange(len(TIME)) < 150, 0.0, 0.4)
    progress = tuple(ProgressRecord(at, n, n, "active") for n, at in enumerate((0.0, 2.0, 6.0)))
    return make_trace(along(TIME, y=y), goal=AROUND, progress=progress)


def sure(*errors):
    motion = along(TIME)
    return [make_trace(motion, estimate=track(TIME, motion.x, e, sigma=0.1)) for e in errors]


OCTAGON = tuple((0.35 * np.cos(a), 0.35 * np.sin(a)) for a in np.arange(8) * np.pi / 4)
ANGLES = -np.linspace(0.0, 1.2, len(TIME))[:, None]
SWINGS = JointTrack(("door-17.hinge",), TIME, ANGLES, np.zeros_like(ANGLES))
LAST = mission((0.0, 0.0), (4.0, 0.0))
KITCHEN = replace(CORRIDOR, regions=(Region("kitchen", box(3.0, -1.0, 6.0, 1.0)),))
LOW, ROUND = replace(ROBOT, height=0.01), replace(ROBOT, footprint=OCTAGON)
FAMILIES = {
    "wall": lambda: [
        *map(passing, (0.3, 0.1, 0.02)), passing(0.0, 0.0), passing(-0.01, 0.01)
    ],
    "far from the wall": lambda: [passing(0.3)],
    "octagon": lambda: [
        passing(gap, footprint=OCTAGON, yaw=np.pi / 8) for gap in (0.55, 0.5, 0.3, 0.2, 0.12)
    ],
    "door": lambda: [to(7.5), to(7.5, joints=SWINGS)],
    "door and octagon": lambda: [to(7.5, robot=ROUND), to(7.5, joints=SWINGS, robot=ROUND)],
    "empty scene": lambda: [to(5.0, scene=replace(CORRIDOR, solids=(), objects=()))],
    "low robot": lambda: [to(5.0, robot=LOW)],
    "mission": lambda: [to(end) for end in (9.0, 8.6, 8.0, 5.0, 4.0, 3.4, 1.0)],
    "forbidden": lambda: [to(9.0)],
    "to the last": lambda: [to(end, goal=LAST) for end in (3.8, 3.0)],
    "never came": lambda: [to(end) for end in (7.5, 6.0, 4.0, 1.0)],
    "aside": lambda: [stepping_aside()],
    "without progress": lambda: [to(5.0)],
    "to the kitchen": lambda: [to(end, scene=KITCHEN) for end in (4.0, 3.5, 2.0, 1.0)],
    "from the kitchen": lambda: [to(end, scene=KITCHEN) for end in (1.0, 2.0, 3.2, 3.9)],
    "two sigma": lambda: sure(0.0, 0.15, 0.19, 0.25),
    "no estimate": lambda: [make_trace(along(TIME), estimate=NOTHING)],
}  # fmt: skip


def leads(family, text):
    """Margins in a line, then what they are about and the waypoint ahead."""
    found = [lead(trace, text) for trace in family]
    margins = [one.margin for one in found]
    known = [margin for margin in margins if margin is not None]
    assert known == sorted(known, reverse=True)
    words = dict.fromkeys(word for one in found for word in (one.object, one.waypoint) if word)
    return "; ".join([f"{', '.join(map(number, margins))} {found[0].unit}", *words])


def kind_and_scale(_, text):
    oracle = parse_oracle("it", text, Where("o.yaml", 1, 1))
    if (flat := why_flat(oracle)) is not None:
        reason, better = flat
        for suggested in better.split(" or "):
            assert why_flat(parse_oracle("it", suggested, Where("o.yaml", 1, 1))) is None
        return f"flat: {reason}; better: {better}"
    scale = oracle_scale(oracle, ROBOT)
    if "busy" not in text:
        assert lead(to(5.0), text).unit == scale.unit
    return f"scale {number(scale.scale)} {scale.unit}"


busy = CustomSignal(lambda trace, time: time > 5.0, "bool")
tidy = CustomOracle(lambda trace: (1.0, 1.0), "bool")
smooth = CustomOracle(lambda trace: (0.25, 0.25), "m/s^2")


@pytest.mark.parametrize(
    ("name", "answer"), [("leads.txt", leads), ("leading_kinds.txt", kind_and_scale)]
)
def test_each_oracle_is_led_by_what_stands_below_it(name, answer, golden, plug_oracles):
    plug_oracles({"busy": f"{__name__}:busy"}, {n: f"{__name__}:{n}" for n in ("tidy", "smooth")})
    golden(name, answers(HERE / name, lambda family: FAMILIES.get(family, list)(), answer))


def test_measures_have_none_and_what_cannot_be_judged_has_no_number():
    written = (
        OracleText("near", "min(clearance)"),
        OracleText("typo", "always(sped < 1 m/s)"),
        OracleText("clear", "never(contact)"),
    )
    trace = passing(0.1)
    _, found = judge_leading(trace, written)
    assert [(one.oracle, one.unit) for one in found] == [("typo", ""), ("clear", "m")]
    assert found[0].margin is None
    verdicts, found = judge_leading(replace(trace, problems=("damaged",)), written)
    assert [one.margin for one in found] == [None, None]
    assert {one.outcome for one in verdicts} == {Outcome.ERROR}


def test_the_table_of_the_documentation_has_every_operator():
    section = (
        (ROOT / "docs" / "languages" / "oracles.md")
        .read_text("utf-8")
        .partition("## Margins that lead")[2]
        .partition("\n## ")[0]
    )
    rows = " ".join(row for row in section.split("\n") if row.startswith("| "))
    grammar = (ROOT / "grammars" / "oracle" / "oracle.tx").read_text("utf-8")
    rules = re.findall(r"(?:Temporal|Amount|Statistic)Operator:\s*(.*?);", grammar, re.DOTALL)
    words = {word for rule in rules for word in re.findall(r"[\"'](\w+)[\"']", rule)}
    assert {"always", "count", "p95"} < words
    told = {*words, "reached"}
    assert [word for word in sorted(told) if not re.search(rf"`{word}\b", rows)] == []
    assert "until" in rows
    assert "within" in rows
    assert [flag for flag in sorted(LEADING_FLAGS) if f"`{flag}" not in rows] == []
