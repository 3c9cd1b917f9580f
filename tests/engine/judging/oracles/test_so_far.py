"""Verdicts on a run that goes on: as if it ended now, and no failure is taken back."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.judging.live import least_margin
from daemon.judging.oracles import judge, judge_so_far
from daemon.model.spec import OracleText
from daemon.model.verdicts import Outcome, deciding_verdict
from daemon.trace import ContactRecord
from tests.engine.judging.oracles.test_properties import FORMS, oracles, traces
from tests.engine.judging.oracles.traces import along, cut, make_trace, mission, times, track


def so_far(trace, text):
    return judge_so_far(trace, (OracleText("it", text),))[0]


@pytest.mark.parametrize("form", FORMS)
@given(data=st.data())
def test_a_failure_is_never_taken_back(form, data):
    whole, text = data.draw(traces()), data.draw(oracles(form))
    at = data.draw(st.integers(0, len(whole.ground_truth.time) - 1)) / 4.0
    if so_far(cut(whole, at), text).outcome is Outcome.FAIL:
        (late,) = judge(whole, (OracleText("it", text),))
        assert late.outcome in (Outcome.FAIL, Outcome.ERROR)  # an error if it never moves


@pytest.mark.parametrize("form", FORMS)
@given(data=st.data())
def test_so_far_is_what_the_run_would_be_judged_if_it_ended_now(form, data):
    whole, text = data.draw(traces()), data.draw(oracles(form))
    found = so_far(cut(whole, whole.valid_until), text)
    (late,) = judge(whole, (OracleText("it", text),))
    mended = replace(late, outcome=Outcome.INCONCLUSIVE, upper=None)
    assert found in (late, mended) if late.outcome is Outcome.FAIL else found == late


@given(traces(), st.lists(oracles(), min_size=1, max_size=4))
def test_of_a_run_that_is_over_so_far_is_the_verdict(trace, texts):
    written = tuple(OracleText(str(i), text) for i, text in enumerate(texts))
    assert judge_so_far(trace, written) == judge(trace, written)


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
    ("text", "outcome"),
    [
        ("never(contact)", "fail"),
        ("always(loc.error <= 0.3 m)", "fail"),
        ("always(loc.error <= 0.5 m)", "pass"),
        ("always within 2 s (speed > 0.1 m/s)", "pass"),
        ("eventually(contact)", "pass"),
        ("eventually(speed > 2 m/s)", "inconclusive"),
        ("eventually within 1 s (contact)", "fail"),
        ("always(speed <= 1 m/s) until (contact)", "pass"),
        ("always(speed <= 1 m/s) until (speed > 2 m/s)", "inconclusive"),
        ("reached(mission, 0.3 m)", "inconclusive"),
        ("reached(mission, 3.3 m)", "pass"),
        ("fraction(loc.error <= 0.3 m) >= 80 %", "inconclusive"),
        ("fraction(loc.error <= 0.3 m) >= 40 %", "pass"),
        ("time(speed > 0.1 m/s) >= 10 s", "inconclusive"),
        ("count(contact) >= 1", "pass"),
        ("max(speed) <= 0.2 m/s", "fail"),
        ("final(speed) <= 0.2 m/s", "inconclusive"),
        ("mean(speed) <= 0.2 m/s", "inconclusive"),
        ("always(loc.error <= 0.3 m) on leg 1", "inconclusive"),
        ("always(nonsense)", "error"),
    ],
)
def test_a_failure_that_may_be_mended_is_none_yet(text, outcome):
    assert so_far(going_on(), text).outcome == outcome


def test_the_least_margin_is_none_that_waits_for_something():
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
