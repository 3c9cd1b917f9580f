"""Verdicts on a run that goes on: which stand, which wait, and none is taken back."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.judging.oracles import judge, judge_so_far, least_margin
from daemon.model.spec import OracleText
from daemon.model.verdicts import Outcome, deciding_verdict
from daemon.trace import ContactRecord
from tests.daemon.judging.oracles.test_properties import FORMS, oracles, traces
from tests.daemon.judging.oracles.traces import along, cut, make_trace, mission, times, track

DECIDED = (Outcome.PASS, Outcome.FAIL)


def so_far(trace, text):
    return judge_so_far(trace, (OracleText("it", text),))[0]


@pytest.mark.parametrize("form", FORMS)
@given(data=st.data())
def test_what_is_final_is_never_taken_back(form, data):
    whole, text = data.draw(traces()), data.draw(oracles(form))
    at = data.draw(st.integers(0, len(whole.ground_truth.time) - 1)) / 4.0
    early = so_far(arriving_late(whole, at, data.draw(st.integers(0, 3)) / 4.0), text)
    (late,) = judge(whole, (OracleText("it", text),))
    if early.final:
        assert early.verdict.outcome in DECIDED
        assert late.outcome is early.verdict.outcome
    assert not (early.final and early.open)
    assert not (early.open and early.verdict.outcome is Outcome.PASS)


FLAGS = st.lists(st.booleans(), min_size=6, max_size=6)


@given(FLAGS, FLAGS, st.integers(1, 5), st.integers(1, 3))
def test_estimates_that_come_late_take_nothing_back(wrong, fast, at, delay):
    time = np.arange(6) / 4.0
    motion = along(time, vx=np.where(fast, 0.5, 0.1))
    estimate = track(time, motion.x, np.where(wrong, 0.5, 0.0))
    whole = make_trace(motion, estimate=estimate, goal=mission((5.0, 0.0)))
    # An error is held until the next estimate: alone it says nothing new of later moments.
    text = "never(loc.error > 0.3 m and speed > 0.3 m/s)"
    early = so_far(arriving_late(whole, at / 4.0, delay / 4.0), text)
    (late,) = judge(whole, (OracleText("it", text),))
    assert not early.final or late.outcome is early.verdict.outcome


def arriving_late(trace, at, delay):
    """Return what is recorded at ``at`` [s] when estimates come ``delay`` after their stamps."""
    known = int(np.searchsorted(trace.estimate.time, at - delay + 1e-9, side="right"))
    names = ("time", "x", "y", "yaw", "covariance")
    kept = {name: getattr(trace.estimate, name)[:known] for name in names}
    return cut(replace(trace, estimate=replace(trace.estimate, **kept)), at)


@pytest.mark.parametrize("form", FORMS)
@given(data=st.data())
def test_so_far_is_what_the_run_would_be_judged_if_it_ended_now(form, data):
    whole, text = data.draw(traces()), data.draw(oracles(form))
    found = so_far(cut(whole, whole.valid_until), text)
    (late,) = judge(whole, (OracleText("it", text),))
    assert found.verdict == late


@given(traces(), st.lists(oracles(), min_size=1, max_size=4))
def test_of_a_run_that_is_over_everything_is_final(trace, texts):
    written = tuple(OracleText(str(i), text) for i, text in enumerate(texts))
    found = judge_so_far(trace, written)
    assert tuple(one.verdict for one in found) == judge(trace, written)
    assert all(one.final and not one.open for one in found)


def going_on(seconds=4.0, **fields):
    """A robot at 0.5 m/s along x; it is wrong by 0.4 m from 2 s on and hits a wall at 3 s."""
    time = times(seconds)
    motion = along(time)
    wrong = np.where(time >= 2.0, 0.4, 0.1)
    hit = ContactRecord(3.0, "robot", "wall-north", (0.0, 0.0), (1.0, 0.0), 0.01)
    made = make_trace(
        motion, estimate=track(time, motion.x, wrong), contacts=(hit,), goal=mission((5.0, 0.0))
    )
    return replace(cut(made, seconds), **fields)


@pytest.mark.parametrize(
    ("text", "outcome", "final", "waits"),
    [
        ("never(contact)", "fail", True, False),
        ("always(loc.error <= 0.3 m)", "fail", True, False),
        ("always(loc.error <= 0.5 m)", "pass", False, False),
        ("always within 2 s (speed > 0.1 m/s)", "pass", True, False),
        ("eventually(contact)", "pass", True, False),
        ("eventually(speed > 2 m/s)", "fail", False, True),
        ("eventually within 1 s (contact)", "fail", True, False),
        ("always(speed <= 1 m/s) until (contact)", "pass", True, False),
        ("always(speed <= 1 m/s) until (speed > 2 m/s)", "fail", False, True),
        ("reached(mission, 0.3 m)", "fail", False, True),
        ("reached(mission, 3.3 m)", "pass", True, False),
        ("fraction(loc.error <= 0.3 m) >= 80 %", "fail", False, False),
        ("fraction(loc.error <= 0.3 m) >= 40 %", "pass", False, False),
        ("time(speed > 0.1 m/s) >= 10 s", "fail", False, True),
        ("count(contact) >= 1", "pass", True, False),
        ("max(speed) <= 0.2 m/s", "fail", True, False),
        ("final(speed) <= 0.2 m/s", "fail", False, True),
        ("mean(speed) <= 0.2 m/s", "fail", False, False),
        ("always(loc.error <= 0.3 m) on leg 1", "inconclusive", False, True),
        ("always(nonsense)", "error", False, False),
    ],
)
def test_what_stands_and_what_waits(text, outcome, final, waits):
    found = so_far(going_on(), text)
    assert (found.verdict.outcome, found.final, found.open) == (outcome, final, waits)


def test_an_estimate_that_is_to_come_may_still_mend_a_failure():
    # The last one is of a second ago; those of since then are on their way.
    early = replace(going_on(), estimate=track(times(3.0), 0.5 * times(3.0), 0.1))
    found = so_far(early, "max(loc.age) <= 0.5 s")
    assert (found.verdict.outcome, found.final) == (Outcome.FAIL, False)


def test_nothing_is_final_of_a_robot_that_has_not_moved():
    time = times(4.0)
    motion = along(time, speed=0.0)
    trace = cut(make_trace(motion, goal=mission((5.0, 0.0))), 4.0)
    found = so_far(trace, "always(clearance >= 10 m)")
    assert (found.verdict.outcome, found.final) == (Outcome.FAIL, False)


def test_the_least_margin_is_that_of_who_waits_for_nothing():
    trace = going_on()
    texts = {
        "arrives": "reached(mission, 0.3 m)",
        "contact": "never(speed > 9 m/s or contact)",
        "accuracy": "always(loc.error <= 0.5 m)",
        "speed": "always(speed <= 1 m/s)",
    }
    spec = replace(trace.spec, oracles=tuple(OracleText(k, v) for k, v in texts.items()))
    trace = replace(trace, spec=spec)
    least = least_margin(judge_so_far(trace, spec.oracles))
    assert least is not None
    assert least.oracle == "contact"  # it has failed
    quiet = replace(trace, contacts=())
    least = least_margin(judge_so_far(quiet, spec.oracles))
    assert least is not None
    assert (least.oracle, least.unit, least.margin) == ("accuracy", "m", pytest.approx(0.1))


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
    trace = going_on()
    written = tuple(OracleText(str(i), text) for i, text in enumerate(texts))
    least = least_margin(judge_so_far(trace, written))
    assert least is not None
    assert least.oracle == str(shown)
    over = replace(trace, complete=True, ended="limit")
    assert deciding_verdict(judge(over, written)) == least
