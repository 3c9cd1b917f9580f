"""Each operator on traces a person can follow, whole and cut short."""

import math
from dataclasses import replace

import numpy as np
import pytest

from daemon.judging.oracles import judge, overall_outcome
from daemon.model.spec import OracleText
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


def with_error(error, rate=20.0, **fields):
    """A robot whose position estimate is off by ``error`` to its left, sample by sample."""
    time = np.arange(len(error)) / rate
    motion = along(time)
    return make_trace(motion, estimate=track(time, motion.x, error), **fields)


def bump(height=0.5, start=5.0, end=6.0, seconds=20.0):
    """Error 0.05 m, but ``height`` from ``start`` up to ``end`` [s]."""
    time = times(seconds)
    return with_error(np.where((time >= start - 1e-9) & (time < end - 1e-9), height, 0.05))


def test_always_fails_at_the_worst_moment_with_evidence():
    found = verdict(bump(), "always(loc.error <= 0.35 m)")
    assert (found.outcome, found.unit) == (Outcome.FAIL, "m")
    assert found.margin == pytest.approx(-0.15)
    assert found.evidence.time == pytest.approx(5.0)
    assert found.evidence.value == pytest.approx(0.5)
    assert found.evidence.limit == 0.35


def test_always_passes_by_its_smallest_margin():
    found = verdict(bump(), "always(loc.error <= 0.6 m)")
    assert found.outcome is Outcome.PASS
    assert found.lower == found.upper == pytest.approx(0.1)


def test_the_first_violation_is_told_when_it_is_not_the_worst():
    time = times(10.0)
    error = np.where(time >= 4.0, 0.5, np.where(time >= 2.0, 0.4, 0.0))
    found = verdict(with_error(error), "always(loc.error <= 0.35 m)")
    assert found.evidence.time == pytest.approx(4.0)
    assert "first at 2.00 s" in found.evidence.note


def test_never_is_always_not():
    found = verdict(bump(), "never(loc.error > 0.35 m)")
    assert found.margin == pytest.approx(-0.15)
    assert verdict(bump(), "never(loc.error > 0.6 m)").outcome is Outcome.PASS


def test_eventually_passes_by_its_best_moment():
    found = verdict(bump(), "eventually(loc.error > 0.3 m)")
    assert found.outcome is Outcome.PASS
    assert found.margin == pytest.approx(0.2)
    assert verdict(bump(), "eventually(loc.error > 0.6 m)").margin == pytest.approx(-0.1)


@pytest.mark.parametrize(
    ("text", "outcome"),
    [
        ("eventually within 5 s (loc.error > 0.3 m)", "pass"),
        ("eventually within 4.9 s (loc.error > 0.3 m)", "fail"),
        ("always within 4.9 s (loc.error < 0.3 m)", "pass"),
        ("never within 5 s (loc.error > 0.3 m)", "fail"),
    ],
)
def test_a_window_counts_from_the_start_of_the_run(text, outcome):
    assert verdict(bump(), text).outcome == outcome


def test_a_window_that_is_over_is_decided_on_a_cut_trace():
    trace = cut(bump(), 8.0)
    assert verdict(trace, "always within 4.9 s (loc.error < 0.3 m)").outcome is Outcome.PASS
    assert verdict(trace, "eventually within 4.9 s (loc.error > 0.3 m)").outcome is Outcome.FAIL
    assert verdict(trace, "always within 9 s (loc.error < 1 m)").outcome is Outcome.INCONCLUSIVE


def test_a_cut_trace_keeps_what_was_seen_and_claims_nothing_else():
    before, after = cut(bump(), 4.0), cut(bump(), 8.0)
    found = verdict(before, "always(loc.error <= 0.35 m)")
    assert (found.outcome, found.lower) == (Outcome.INCONCLUSIVE, None)
    assert found.upper == pytest.approx(0.3)
    assert "ends at 4.00 s" in found.evidence.note
    assert verdict(after, "always(loc.error <= 0.35 m)").outcome is Outcome.FAIL
    assert verdict(before, "eventually(loc.error > 0.3 m)").outcome is Outcome.INCONCLUSIVE
    assert verdict(after, "eventually(loc.error > 0.3 m)").outcome is Outcome.PASS


def test_amounts_weigh_samples_by_time():
    trace = bump(end=6.5)
    assert verdict(trace, "time(loc.error > 0.3 m)").evidence.value == pytest.approx(1.5)
    assert verdict(trace, "fraction(loc.error > 0.3 m)").evidence.value == pytest.approx(0.075)
    found = verdict(trace, "longest(loc.error > 0.3 m) <= 1 s")
    assert (found.outcome, found.unit) == (Outcome.FAIL, "s")
    assert found.margin == pytest.approx(-0.5)
    assert found.evidence.time == pytest.approx(5.0)


def test_irregular_samples_count_until_the_next_one():
    time = np.array([0.0, 1.0, 4.0, 5.0])
    motion = along(time)
    error = np.array([0.5, 0.0, 0.5, 0.5])
    trace = make_trace(motion, estimate=track(time, motion.x, error), valid_until=6.0)
    assert verdict(trace, "time(loc.error > 0.3 m)").evidence.value == pytest.approx(3.0)
    assert verdict(trace, "fraction(loc.error > 0.3 m)").evidence.value == pytest.approx(0.5)
    assert verdict(trace, "longest(loc.error > 0.3 m)").evidence.value == pytest.approx(2.0)
    assert verdict(trace, "mean(loc.error)").evidence.value == pytest.approx(0.25)


def test_count_counts_how_often_it_became_true():
    time = times(10.0)
    trace = with_error(np.where(np.floor(time) % 3 == 0, 0.5, 0.0))
    assert verdict(trace, "count(loc.error > 0.3 m)").evidence.value == 4.0
    assert verdict(trace, "count(loc.error > 0.3 m) == 4").outcome is Outcome.PASS
    assert verdict(trace, "count(loc.error > 0.3 m) != 4").outcome is Outcome.FAIL
    assert verdict(trace, "count(loc.error > 0.3 m) < 4").outcome is Outcome.FAIL
    assert verdict(trace, "count(loc.error > 0.3 m) <= 4").outcome is Outcome.PASS


def test_amounts_on_a_cut_trace_use_that_the_run_ends_at_its_limit():
    trace = cut(replace_limit(bump(seconds=20.0), 20.0), 19.0)
    assert verdict(trace, "fraction(loc.error < 0.3 m) >= 85 %").outcome is Outcome.PASS
    assert verdict(trace, "fraction(loc.error < 0.3 m) >= 93 %").outcome is Outcome.INCONCLUSIVE
    assert verdict(trace, "fraction(loc.error < 0.3 m) >= 99 %").outcome is Outcome.FAIL
    assert verdict(trace, "time(loc.error > 0.3 m) <= 2.1 s").outcome is Outcome.PASS
    assert verdict(trace, "time(loc.error > 0.3 m) <= 1.5 s").outcome is Outcome.INCONCLUSIVE
    assert verdict(trace, "longest(loc.error > 0.3 m) <= 0.9 s").outcome is Outcome.FAIL
    assert verdict(trace, "count(loc.error > 0.3 m) <= 1").outcome is Outcome.INCONCLUSIVE
    assert verdict(trace, "count(loc.error > 0.3 m) >= 1").outcome is Outcome.PASS


def test_a_stretch_that_is_still_going_on_may_last_until_the_limit():
    trace = cut(replace_limit(bump(seconds=20.0), 20.0), 5.8)
    assert verdict(trace, "longest(loc.error > 0.3 m) <= 15.1 s").outcome is Outcome.PASS
    assert verdict(trace, "longest(loc.error > 0.3 m) <= 14.9 s").outcome is Outcome.INCONCLUSIVE


def replace_limit(trace, limit):
    return replace(trace, spec=replace(trace.spec, limit=limit))


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("max(loc.error)", 0.5),
        ("min(loc.error)", 0.05),
        ("mean(loc.error)", 0.0725),
        ("median(loc.error)", 0.05),
        ("final(loc.error)", 0.05),
        ("p95(loc.error)", 0.05),
        ("max(abs(-loc.error.y) * 2 - loc.error / 2)", 0.75),
    ],
)
def test_statistics_sum_up_a_signal(text, value):
    found = verdict(bump(), text)
    assert found.outcome is Outcome.MEASURE
    assert (found.lower, found.upper) == (None, None)
    assert found.evidence.value == pytest.approx(value)


def test_p95_is_the_value_not_exceeded_for_95_percent_of_the_time():
    time = np.arange(101) / 1.0
    trace = with_error(time / 100.0, rate=1.0, limit=200.0)
    assert verdict(trace, "p95(loc.error)").evidence.value == pytest.approx(0.94)
    assert verdict(trace, "time(loc.error <= 0.94 m)").evidence.value == pytest.approx(95.0)


def test_a_maximum_can_only_grow():
    trace = cut(bump(), 8.0)
    assert verdict(trace, "max(loc.error) <= 0.35 m").outcome is Outcome.FAIL
    assert verdict(trace, "max(loc.error) <= 0.6 m").outcome is Outcome.INCONCLUSIVE
    assert verdict(trace, "max(loc.error) >= 0.4 m").outcome is Outcome.PASS
    assert verdict(trace, "min(loc.error) >= 0.1 m").outcome is Outcome.FAIL
    assert verdict(trace, "mean(loc.error) <= 1 m").outcome is Outcome.INCONCLUSIVE
    assert verdict(trace, "final(loc.error) <= 1 m").outcome is Outcome.INCONCLUSIVE


def test_strict_and_weak_limits_differ_when_met_exactly():
    trace = with_error(np.full(21, 0.25))
    exact = "loc.error.y"
    assert verdict(trace, f"always({exact} <= 0.25 m)").outcome is Outcome.PASS
    assert verdict(trace, f"always({exact} < 0.25 m)").outcome is Outcome.FAIL
    assert verdict(trace, f"never({exact} >= 0.25 m)").outcome is Outcome.FAIL
    assert verdict(trace, f"always(not ({exact} > 0.25 m))").outcome is Outcome.PASS
    assert verdict(trace, f"max({exact}) < 0.25 m").outcome is Outcome.FAIL


def test_a_guard_narrows_what_is_judged():
    guarded = "when elapsed < 5 s or elapsed > 7 s"
    assert verdict(bump(), f"always(loc.error <= 0.35 m) {guarded}").outcome is Outcome.PASS
    assert verdict(bump(), f"max(loc.error) {guarded}").evidence.value == pytest.approx(0.05)


@pytest.mark.parametrize("operator", ["always", "never", "eventually"])
def test_what_was_never_put_to_the_test_is_inconclusive(operator):
    found = verdict(bump(), f"{operator}(contact) when speed > 9 m/s")
    assert found.outcome is Outcome.INCONCLUSIVE
    assert "vacuous" in found.evidence.note


def test_vacuous_amounts_statistics_and_missions_are_inconclusive_too():
    guard = "when speed > 9 m/s"
    for text in ("fraction(contact) <= 1 %", "max(speed) < 1 m/s", "reached(mission, 1 m)"):
        assert verdict(bump(), f"{text} {guard}").outcome is Outcome.INCONCLUSIVE
    measured = verdict(bump(), f"time(contact) {guard}")
    assert (measured.outcome, measured.evidence.value) == (Outcome.MEASURE, None)


def test_a_signal_that_was_not_recorded_decides_nothing():
    found = verdict(make_trace(along(times(5.0))), "always(loc.error <= 0.35 m)")
    assert found.outcome is Outcome.INCONCLUSIVE
    assert "not recorded" in found.evidence.note


def test_a_signal_is_judged_from_when_it_is_known():
    time = times(5.0)
    late = track(time[40:], time[40:] * 0.5, 0.1)
    found = verdict(make_trace(along(time), estimate=late), "always(loc.error <= 0.35 m)")
    assert found.outcome is Outcome.PASS
    assert "known from 2.00 s" in found.evidence.note


def test_unknown_and_false_is_false_but_unknown_and_true_is_unknown():
    trace = make_trace(along(times(5.0), speed=0.5))
    assert verdict(trace, "always(loc.error < 1 m and speed > 1 m/s)").outcome is Outcome.FAIL
    assert verdict(trace, "always(loc.error < 1 m or speed < 1 m/s)").outcome is Outcome.PASS
    unknown = verdict(trace, "always(loc.error < 1 m and speed < 1 m/s)")
    assert unknown.outcome is Outcome.INCONCLUSIVE


def test_division_by_zero_is_unknown_not_a_crash():
    trace = make_trace(along(times(1.0), speed=0.5))
    found = verdict(trace, "max(path.length / elapsed) <= 0.6 m/s")
    assert found.outcome is Outcome.PASS
    assert found.evidence.value == pytest.approx(0.5)


def test_margins_in_one_unit_combine_and_others_keep_their_sign():
    same = verdict(bump(), "always(loc.error <= 0.6 m and loc.error.y <= 0.9 m)")
    assert (same.unit, same.margin) == ("m", pytest.approx(0.1))
    assert "decided by loc.error <= 0.6 m" in same.evidence.note
    mixed = verdict(bump(), "always(loc.error <= 0.35 m and speed <= 9 m/s)")
    assert (mixed.unit, mixed.margin) == ("", -1.0)
    assert mixed.evidence.value == pytest.approx(0.5)


def journey(*corners, speed=0.5, limit=600.0):
    """A robot that drives from corner to corner at constant speed, in 20 Hz samples."""
    points = np.array(corners)
    reach = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    time = times(math.ceil(reach[-1] / speed))
    way = np.minimum(time * speed, reach[-1])
    motion = replace(
        along(time), x=np.interp(way, reach, points[:, 0]), y=np.interp(way, reach, points[:, 1])
    )
    return make_trace(motion, limit=limit)


def heading_for(trace, *points):
    return replace(trace, spec=replace(trace.spec, mission=mission(*points)))


def test_waypoints_are_reached_in_order_by_the_closest_approach_of_each_visit():
    trace = heading_for(journey((0, 0), (4, 0), (4, 4)), (2.0, 0.1), (4.0, 0.0), (4.0, 4.0))
    found = verdict(trace, "reached(mission, 0.25 m)")
    assert (found.outcome, found.unit) == (Outcome.PASS, "m")
    assert found.margin == pytest.approx(0.15)
    assert found.evidence.object == "w1"
    assert found.evidence.time == pytest.approx(4.0)
    assert "all 3 waypoints visited, the last at 15.50 s" in found.evidence.note


def test_the_wrong_order_is_a_failure_that_names_the_waypoint():
    trace = heading_for(journey((0, 0), (4, 0)), (3.0, 0.0), (1.0, 0.0))
    found = verdict(trace, "reached(mission, 0.25 m)")
    assert found.outcome is Outcome.FAIL
    assert "waypoint 2 of 2 is not visited nearer" in found.evidence.note
    assert found.margin == pytest.approx(0.25 - 1.0)  # halfway between both, for both


def test_a_waypoint_passed_a_little_too_far_misses_by_that_little():
    circuit = journey((0, 0.26), (4, 0.0), (8, 0.0), (0, 0.0))
    trace = heading_for(circuit, (0, 0), (4, 0), (8, 0), (0, 0))
    found = verdict(trace, "reached(mission, 0.25 m)")
    assert found.outcome is Outcome.FAIL
    assert found.margin == pytest.approx(-0.01, abs=1e-3)
    assert (found.evidence.object, found.evidence.time) == ("w1", pytest.approx(0.0, abs=0.1))


def test_a_circuit_visits_its_first_waypoint_twice():
    there_and_back = journey((0, 0), (4, 0), (0, 0))
    assert verdict(
        heading_for(there_and_back, (0, 0), (4, 0), (0, 0)), "reached(mission, 0.25 m)"
    ).outcome is Outcome.PASS  # fmt: skip
    assert verdict(
        heading_for(journey((0, 0), (4, 0)), (0, 0), (4, 0), (0, 0)), "reached(mission, 0.25 m)"
    ).outcome is Outcome.FAIL  # fmt: skip


def test_a_cut_mission_is_open_until_all_waypoints_are_visited():
    trace = heading_for(journey((0, 0), (4, 0)), (2.0, 0.1), (3.0, 0.0))
    early = verdict(cut(trace, 5.0), "reached(mission, 0.25 m)")
    assert (early.outcome, early.upper) == (Outcome.INCONCLUSIVE, None)
    assert early.lower == pytest.approx(0.25 - 0.5)
    late = verdict(cut(trace, 7.0), "reached(mission, 0.25 m)")
    assert late.outcome is Outcome.PASS


def test_a_visit_that_is_not_over_can_still_come_closer():
    trace = heading_for(journey((0, 0), (4, 0)), (2.0, 0.0))
    found = verdict(cut(trace, 3.6), "reached(mission, 0.25 m)")
    assert (found.outcome, found.upper) == (Outcome.PASS, None)
    assert found.lower == pytest.approx(0.05)
    assert verdict(trace, "reached(mission, 0.25 m)").lower == pytest.approx(0.25)


def test_contacts_name_what_was_touched():
    touches = (
        ContactRecord(3.02, "robot", "door-17.leaf", (1.5, 0.2), (0.0, 1.0), 0.004),
        ContactRecord(3.03, "wall-north", "robot", (1.5, 0.2), (0.0, 1.0), 0.009),
        ContactRecord(7.0, "door-17.leaf", "wall-north", (8.0, 1.0), (0.0, 1.0), 0.5),
    )
    trace = make_trace(along(times(10.0)), contacts=touches)
    found = verdict(trace, "never(contact)")
    assert (found.outcome, found.unit) == (Outcome.FAIL, "")
    assert found.evidence.time == pytest.approx(3.05)
    assert found.evidence.object == "wall-north"
    assert verdict(trace, "count(contact)").evidence.value == 1.0
    assert verdict(trace, "max(contact.depth)").evidence.value == 0.009


def test_when_nothing_happened_no_moment_is_singled_out():
    trace = make_trace(along(times(10.0)))
    for text in ("never(contact)", "eventually(contact)"):
        found = verdict(trace, text)
        assert (found.evidence.time, found.evidence.value) == (None, None)


def test_the_mission_signals_say_what_the_system_reports():
    progress = (
        ProgressRecord(0.0, 0, 0, "active"),
        ProgressRecord(4.0, 1, 1, "active"),
        ProgressRecord(8.0, 2, 2, "succeeded"),
    )
    trace = make_trace(along(times(10.0)), goal=mission((2, 0), (4, 0)), progress=progress)
    assert verdict(trace, "max(mission.leg)").evidence.value == 2.0
    assert verdict(trace, "time(mission.leg == 1)").evidence.value == pytest.approx(4.0)
    assert verdict(trace, "final(mission.reached)").evidence.value == 2.0
    assert verdict(trace, "time(mission.remaining == 1)").evidence.value == pytest.approx(4.0)
    assert verdict(trace, "eventually(mission.remaining <= 0)").outcome == "pass"


def test_a_mission_that_lasts_until_the_limit_has_waypoints_left():
    progress = (ProgressRecord(0.0, 0, 0, "active"), ProgressRecord(4.0, 1, 1, "active"))
    trace = make_trace(along(times(10.0)), goal=mission((2, 0), (4, 0)), progress=progress)
    ended = replace(trace, ended="limit")
    assert verdict(ended, "reached(mission, 0.5 m)").outcome == "pass"
    found = verdict(ended, "eventually(mission.remaining <= 0)")
    assert (found.outcome, found.margin) == ("fail", -1.0)


def test_an_oracle_that_cannot_be_read_or_bound_is_an_error_of_its_own():
    trace = bump()
    written = (
        OracleText("typo", "always(loc.eror <= 1 m)"),
        OracleText("elsewhere", "min(door-99.distance) > 1 m"),
        OracleText("fine", "never(contact)"),
    )
    found = judge(trace, written)
    assert [v.outcome for v in found] == [Outcome.ERROR, Outcome.ERROR, Outcome.PASS]
    assert 'unknown signal "loc.eror"' in found[0].evidence.note
    assert 'no "door-99.distance"' in found[1].evidence.note


def test_a_crash_is_an_error_whatever_was_seen_before():
    crashed = replace(bump(), ended="crashed")
    kept = judge(crashed, (OracleText("a", "always(loc.error <= 0.6 m)"),))
    assert kept[0].outcome is Outcome.INCONCLUSIVE
    assert overall_outcome(crashed, kept) is Outcome.ERROR
    broken = judge(crashed, (OracleText("a", "always(loc.error <= 0.35 m)"),))
    assert broken[0].outcome is Outcome.FAIL
    assert overall_outcome(crashed, broken) is Outcome.ERROR


def test_a_trace_without_samples_is_inconclusive():
    empty = make_trace(along(np.zeros(1)))
    nothing = cut(empty, -1.0)
    texts = ("never(contact)", "reached(mission, 1 m)", "time(contact) < 1 s", "max(speed) > 0 m/s")
    for text in texts:
        assert verdict(nothing, text).outcome is Outcome.INCONCLUSIVE


@pytest.mark.parametrize(
    ("guard", "counts"), [("speed >= 0.5 m/s", True), ("speed > 0.5 m/s", False)]
)
def test_a_visit_counts_where_its_guard_just_holds(guard, counts):
    trace = make_trace(along(times(10.0)), goal=mission((2.0, 0.0)))
    found = verdict(trace, f"reached(mission, 0.1 m) when {guard}")
    assert found.outcome is (Outcome.PASS if counts else Outcome.INCONCLUSIVE)
