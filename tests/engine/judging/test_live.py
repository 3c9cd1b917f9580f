"""Judgement of a run that goes on: signals, verdicts and log so far, the least margin."""

import functools
import itertools
import math
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.judging.live import (
    MOST_COLUMNS,
    MOST_LINES,
    door_motions,
    judge_running,
    least_margin,
    limits_of,
    sample_run_signals,
)
from daemon.judging.oracles import DOOR_CLEARANCE, SignalSampler, judge, judge_so_far
from daemon.judging.signals import RunSignal, merge_spans, received_signal, thin_signal
from daemon.model.live_judgement import (
    LiveJudgement,
    LiveSignal,
    SignalLimit,
    pack_judgement,
    unpack_judgement,
)
from daemon.model.spec import OracleText
from daemon.model.sut import CollisionMonitorState, SpeedLimit
from daemon.model.verdicts import deciding_verdict
from daemon.trace import ContactRecord, EventRecord, JointTrack, ProgressRecord
from grammars import oracle as language
from grammars.text import codec
from tests.engine.judging.test_verdicts import TRACES, number
from tests.engine.judging.test_verdicts import told as verdict_line
from tests.engine.judging.traces import (
    CORRIDOR,
    along,
    answers,
    cut,
    door,
    make_trace,
    mission,
    times,
    track,
    with_tree,
)


@functools.cache
def goes_on():
    return cut(TRACES["going on"](), 4.0)


ORACLES = {
    "arrives": "reached(mission, 0.3 m)",
    "contact": "never(contact)",
    "accuracy": "always(loc.error <= 0.3 m)",
    "share": "fraction(speed > 0.1 m/s) >= 50 %",
}


def whole():
    """Ten seconds at 0.5 m/s; wrong by 0.4 m for a second, three touches of which two are one."""
    time = times(10.0)
    motion = along(time)
    wrong = np.where((time >= 4.0) & (time < 5.0), 0.4, 0.1)
    hits = [
        ContactRecord(at, "robot", "wall-north", (at, 1.0), (0.0, 1.0), 0.01)
        for at in (6.0, 6.05, 8.0)
    ]
    trace = make_trace(
        motion,
        estimate=track(time, motion.x, wrong),
        contacts=tuple(hits),
        progress=(ProgressRecord(0.0, 0, 0, "active"), ProgressRecord(5.0, 1, 1, "succeeded")),
        goal=mission((2.5, 0.0)),
    )
    events = (EventRecord(1.0, "sut", "starts\x1b[2J\nnow"), EventRecord(7.0, "door-17", "opens"))
    spec = replace(trace.spec, oracles=tuple(OracleText(k, v) for k, v in ORACLES.items()))
    return replace(trace, spec=spec, events=events)


def intervened():
    """Ten seconds with a behaviour tree, a monitor of collisions and limits of speed."""
    trace = with_tree(
        make_trace(along(times(10.0))),
        (1.0, "FollowPath 1 IDLE>RUNNING", "GoalUpdated 2 IDLE>FAILURE"),
        (2.0, "FollowPath 1 RUNNING>FAILURE", "Spin 3 IDLE>RUNNING"),
    )
    others = (
        CollisionMonitorState(3.0, "approach", "Footprint"),
        SpeedLimit(4.0, 0.25, False),
        CollisionMonitorState(5.0, "none", ""),
        SpeedLimit(6.0, 0.0, False),
    )
    return replace(trace, reports=(*trace.reports, *others))


def untouched():
    """A run whose least margin is not that of an oracle which waits for something."""
    written = {
        "arrives": "reached(mission, 0.3 m)",
        "contact": "never(speed > 9 m/s or contact)",
        "accuracy": "always(loc.error <= 0.5 m)",
        "speed": "always(speed <= 1 m/s)",
    }
    spec = replace(goes_on().spec, oracles=tuple(OracleText(k, v) for k, v in written.items()))
    return replace(goes_on(), spec=spec, contacts=())


RUNS = {"whole": whole, "intervened": intervened, "untouched": untouched}


def told(trace, line):
    judgement = judge_running(cut(trace, float(line.removesuffix(" s"))))
    lines = [f"{one.oracle}: {verdict_line(one)}" for one in judgement.verdicts]
    if (margin := least_margin(judgement.verdicts)) is not None:
        lines.append(f"least margin: {margin.oracle}, {number(margin.margin)} {margin.unit}")
    for one in judgement.signals:
        known = [value for value in (*one.low, *one.high) if value is not None]
        words = [f"{number(min(known))} to {number(max(known))} {one.unit}"]
        words += [f"limit {number(each.value)} {each.side}" for each in one.limits]
        words += [f"read by {reader}" for reader in one.readers]
        words += [f"against {number(begin)} to {number(end)} s" for begin, end in one.against]
        lines.append(f"{one.name}: {', '.join(words)}")
        assert len(one.low) <= MOST_COLUMNS
    lines += [f"{each.time:g} s {each.level} {each.source}: {each.text}" for each in judgement.log]
    return "\n    ".join([f"judged at {judgement.time:g} s", *map(str.rstrip, lines)])


def test_each_run_is_judged_so_far_as_stands_below_it(golden):
    golden(
        "running.txt",
        answers(Path(__file__).with_name("running.txt"), lambda name: RUNS[name](), told),
    )


def test_a_long_log_is_told_by_its_end():
    events = tuple(EventRecord(i / 100.0, "sut", f"line {i}") for i in range(900))
    judgement = judge_running(cut(replace(whole(), events=events), 3.9))
    assert (len(judgement.log), judgement.log_before) == (MOST_LINES, 391 - MOST_LINES)
    assert judgement.log[-1].text == "line 390"


def test_the_last_judgement_is_what_the_run_is_judged_by():
    trace = whole()
    judgement = judge_running(trace)
    assert judgement.verdicts == judge(trace, trace.spec.oracles)


def test_a_trace_that_cannot_be_trusted_has_error_verdicts_and_no_signals():
    judgement = judge_running(replace(cut(whole(), 4.5), problems=("broken",)))
    assert judgement.signals == ()
    assert {one.outcome for one in judgement.verdicts} == {"error"}


def test_a_judgement_travels_small():
    judgement = replace(judge_running(cut(whole(), 9.0)), run="c.0")
    packed = pack_judgement(judgement)
    assert unpack_judgement(packed) == judgement
    assert len(packed) < 4000


EMPTY = LiveJudgement("c.0", 1.0, (), (), (), (), ())
UNEVEN = LiveSignal("speed", "m/s", 0.0, 1.0, (0.0, 0.1), (0.2,))


def test_what_is_no_judgement_is_refused():
    packed = pack_judgement(EMPTY)
    for data, reason in (
        (packed[:-5], None),
        (b"x" + packed, None),
        (b"", None),
        (pack_judgement(replace(EMPTY, signals=(UNEVEN,))), "speed"),
        (zlib.compress(b" " * 2**24 + codec.to_json(EMPTY)), "more than"),
    ):
        with pytest.raises(ValueError, match=reason):
            unpack_judgement(data)


def test_a_limit_has_the_side_on_which_a_signal_speaks_against_oracles():
    compared = [
        language.ComparedLimit(name, value, side)
        for name, value, side in (
            ("speed", 0.5, "above"), ("speed", 0.2, "below"), ("clearance", 0.1, "below"),
            ("speed", 0.5, ""), ("speed", 1.0, "above"), ("speed", 1.0, "below"),
        )
    ]  # fmt: skip
    assert limits_of("speed", compared) == (
        SignalLimit(0.2, "below"),
        SignalLimit(0.5, "above"),
        SignalLimit(1.0),
    )


def test_doors_open_when_they_leave_how_they_are_drawn():
    position = np.array([[0.0], [0.04], [0.5], [0.5], [0.01], [-0.2]])
    track = JointTrack(("door-1.hinge",), np.arange(6.0), position, np.zeros((6, 1)))
    found = [(event.time, event.opens) for event in door_motions(track)]
    assert found == [(2.0, True), (4.0, False), (5.0, True)]


def test_stretches_that_touch_become_one():
    assert merge_spans([(3.0, 4.0), (0.0, 1.0), (1.0, 2.0), (3.5, 3.6)]) == ((0.0, 2.0), (3.0, 4.0))


@given(
    st.lists(st.floats(-9.0, 9.0) | st.just(math.nan), min_size=1, max_size=60),
    st.integers(1, 20),
)
def test_a_thinned_signal_keeps_the_extremes_of_each_of_its_parts(values, parts):
    values, limits = np.array(values), (SignalLimit(0.5, "below"),)
    time, end = np.arange(len(values)) + 0.0, float(len(values))
    signal = RunSignal("it", "m", time, values, values, limits)
    received = received_signal(thin_signal(signal, 0.0, end, parts))
    assert (received.limits, received.time[0], received.time[-1]) == (limits, 0.0, end)
    for begin, after in itertools.pairwise(received.time.tolist()):
        inside = values[(time >= begin - 1e-9) & (time < after - 1e-9)]
        known = inside[np.isfinite(inside)]
        if len(known):
            assert received.at(begin) == pytest.approx((known.min(), known.max()), rel=5.1e-4)
        elif len(inside):
            assert np.isnan(received.at(begin)).all()


def test_a_part_without_samples_holds_the_value_before_it():
    values = np.array([2.0, 5.123456, 4.0])
    signal = RunSignal("it", "m", np.array([0.0, 1.0, 9.0]), values, values)
    thin = thin_signal(signal, 0.0, 10.0, 10)
    assert thin.low == thin.high == (2.0, *(5.123,) * 8, 4.0)


def test_a_thinned_signal_has_no_more_stretches_than_parts():
    time = np.arange(0.0, 100.0, 0.05)
    against = tuple((float(at), float(at) + 0.05) for at in time[::2])
    thin = thin_signal(RunSignal("it", "bool", time, time, time, (), against), 0.0, 100.0, 20)
    assert thin.against == ((0.0, pytest.approx(99.95)),)
    few = RunSignal("it", "bool", time, time, time, (), ((1.0, 2.0), (50.0, 60.0)))
    assert thin_signal(few, 0.0, 100.0, 20).against == few.against


def test_the_clearance_of_doors_is_the_least_of_every_object():
    scene = replace(CORRIDOR, objects=tuple(door(f"door-{i}", 2.0 * i, 1.0) for i in range(1, 5)))
    trace = make_trace(along(times(15.0)), scene=scene)
    sampler = SignalSampler(trace)
    (found,) = (s for s in sample_run_signals(sampler) if s.name == DOOR_CLEARANCE)
    each = [
        sampler.sample(language.Signal("clearance", (language.Signal(o.name),))).values
        for o in scene.objects
    ]
    assert np.array_equal(found.low, np.min(each, axis=0))
    assert 0.0 < found.low.min() < 1.0


@pytest.mark.parametrize(
    ("texts", "shown"),
    [
        # As a share of its limit the margin of the time is less, 1 of 5 s.
        (("time(speed > 0.1 m/s) <= 5 s", "always(speed <= 1 m/s)"), 1),
        (("always(speed <= 1 m/s)", "time(speed > 0.1 m/s) <= 5 s"), 0),
        # The first that fails, though another fails by more.
        (("always(speed <= 0.4 m/s)", "always(speed <= 0.1 m/s)"), 0),
        (("always(speed <= 0.6 m/s)", "always(speed <= 0.1 m/s)"), 1),
        # What only is true or false, and what measures.
        (("never(contact)", "always(loc.error <= 0.3 m)"), 0),
        (("max(speed)", "always(speed <= 1 m/s)"), 1),
    ],
)
def test_a_list_shows_the_same_oracle_of_a_run_before_and_after_its_end(texts, shown):
    trace = goes_on()
    written = tuple(OracleText(str(i), text) for i, text in enumerate(texts))
    least = least_margin(judge_so_far(trace, written))
    assert least.oracle == str(shown)
    over = replace(trace, complete=True, ended="limit")
    assert deciding_verdict(judge(over, written)) == least
