"""``until`` and ``on leg``: judging a part of a run, on traces a person can follow."""

import numpy as np
import pytest

from daemon.model.verdicts import Outcome
from daemon.trace import ContactRecord, ProgressRecord
from tests.engine.judging.oracles.traces import (
    along,
    cut,
    make_trace,
    mission,
    times,
    track,
    verdict,
)

TOUCH = (ContactRecord(6.0, "robot", "door-17.leaf", (3.0, 0.2), (0.0, 1.0), 0.004),)


def journey(*changes, seconds=10.0, **fields):
    """Along x at 0.5 m/s past waypoints w1, w2, ..., each reached at one of ``changes`` [s]."""
    time = times(seconds)
    motion = along(time)
    goal = mission(*((0.5 * t, 0.0) for t in changes))
    progress = [ProgressRecord(0.0, 0, 0, "active")]
    progress += [ProgressRecord(t, n, n, "active") for n, t in enumerate(changes, start=1)]
    error = np.where((time >= 6.0) & (time < 7.0), 0.5, 0.1)
    estimate = track(time, motion.x, error)
    return make_trace(
        motion, goal=goal, progress=tuple(progress), estimate=estimate, contacts=TOUCH, **fields
    )


def test_until_judges_only_what_comes_before():
    found = verdict(journey(4.0, 8.0), "always(loc.error <= 0.3 m) until (mission.reached >= 1)")
    assert (found.outcome, found.unit) == (Outcome.PASS, "m")
    assert found.lower == found.upper == pytest.approx(0.2)
    assert "until 4.00 s" in found.evidence.note
    found = verdict(journey(4.0, 8.0), "always(loc.error <= 0.3 m) until (mission.reached >= 2)")
    assert (found.outcome, found.margin) == (Outcome.FAIL, pytest.approx(-0.2))
    assert found.evidence.time == pytest.approx(6.0)
    assert found.evidence.limit == pytest.approx(0.3)


def test_never_until_names_what_was_touched():
    found = verdict(journey(8.0), "never(contact) until (mission.reached >= 1)")
    assert (found.outcome, found.evidence.object) == (Outcome.FAIL, "door-17.leaf")
    assert verdict(journey(5.0), "never(contact) until (mission.reached >= 1)").outcome == "pass"


def test_what_ends_it_must_come():
    text = "always(loc.error <= 1 m) until (speed >= 0.9 m/s)"
    found = verdict(journey(4.0), text)
    assert found.outcome is Outcome.FAIL
    assert found.evidence.value == pytest.approx(0.5)
    assert found.evidence.limit == pytest.approx(0.9)
    assert "speed >= 0.9 m/s never came" in found.evidence.note
    early = verdict(cut(journey(4.0), 5.0), text)
    assert (early.outcome, early.lower) == (Outcome.INCONCLUSIVE, None)


@pytest.mark.parametrize(("within", "outcome"), [("4 s", "pass"), ("3.9 s", "fail")])
def test_what_ends_it_may_have_to_hurry(within, outcome):
    text = f"always(loc.error <= 1 m) until within {within} (mission.reached >= 1)"
    assert verdict(journey(4.0), text).outcome == outcome
    assert verdict(cut(journey(4.0), 6.0), text).outcome == outcome
    assert verdict(cut(journey(4.0), 3.0), text).outcome is Outcome.INCONCLUSIVE


def test_until_something_that_held_all_along_is_vacuous():
    found = verdict(journey(4.0), "always(loc.error <= 0.01 m) until (mission.reached >= 0)")
    assert found.outcome is Outcome.INCONCLUSIVE
    assert "vacuous" in found.evidence.note


def test_a_guard_does_not_hide_what_ends_it():
    text = "always(loc.error <= 0.3 m) until (mission.reached >= 1) when mission.reached == 0"
    assert verdict(journey(4.0), text).outcome is Outcome.PASS


@pytest.mark.parametrize("leg", ["2", "w2"])
def test_a_leg_is_the_way_to_its_waypoint(leg):
    trace = journey(4.0, 9.0)
    assert verdict(trace, f"max(loc.error) on leg {leg}").evidence.value == pytest.approx(0.5)
    assert verdict(trace, "max(loc.error) on leg 1").evidence.value == pytest.approx(0.1)
    assert verdict(trace, f"time(speed > 0 m/s) on leg {leg}").evidence.value == pytest.approx(5.0)
    assert verdict(trace, f"never(contact) on leg {leg}").outcome is Outcome.FAIL
    assert verdict(trace, "never(contact) on leg 1").outcome is Outcome.PASS


def test_a_leg_that_is_over_is_decided_while_the_run_goes_on():
    trace = cut(journey(4.0, 9.0), 5.0)
    assert verdict(trace, "never(contact) on leg 1").outcome is Outcome.PASS
    assert verdict(trace, "never(contact) on leg 2").outcome is Outcome.INCONCLUSIVE
    assert verdict(trace, "fraction(contact) <= 0 % on leg 1").outcome is Outcome.PASS
    assert verdict(trace, "max(speed) <= 1 m/s on leg 1").outcome is Outcome.PASS
    assert verdict(trace, "longest(speed > 0 m/s) <= 4.1 s on leg 1").outcome is Outcome.PASS


def test_within_counts_from_the_start_of_the_leg():
    trace = journey(4.0, 9.0)
    assert verdict(trace, "eventually within 2 s (contact) on leg w2").outcome is Outcome.PASS
    assert verdict(trace, "eventually within 1.9 s (contact) on leg w2").outcome is Outcome.FAIL


def test_a_leg_that_was_never_begun_is_vacuous():
    goal = mission((2.0, 0.0), (4.0, 0.0), (40.0, 0.0), (50.0, 0.0))
    found = verdict(journey(4.0, 8.0), "never(contact) on leg 2")
    assert found.outcome is Outcome.FAIL
    trace = make_trace(along(times(5.0)), goal=goal)
    found = verdict(trace, "never(contact) on leg 3")
    assert found.outcome is Outcome.INCONCLUSIVE
    assert found.evidence.note == "vacuous: leg 3 was never begun"


def test_coming_back_to_a_leg_does_not_reopen_it():
    changes = ((0.0, 0), (2.0, 1), (5.0, 0), (8.0, 2))
    progress = tuple(ProgressRecord(t, n, n, "active") for t, n in changes)
    goal = mission((1.0, 0.0), (4.0, 0.0))
    trace = make_trace(along(times(10.0)), goal=goal, progress=progress, contacts=TOUCH)
    assert verdict(trace, "never(contact) on leg 1").outcome is Outcome.PASS


def test_a_leg_has_its_own_clock_and_distance():
    trace = journey(4.0, 9.0)
    found = verdict(trace, "final(mission.leg.elapsed) on leg 2")
    assert found.evidence.value == pytest.approx(4.95)
    assert verdict(trace, "min(mission.distance) on leg 1").evidence.value < 0.03
    assert verdict(trace, "max(mission.distance)").evidence.value == pytest.approx(2.5)
