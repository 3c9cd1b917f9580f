"""Signals: of named objects, recorded as they are; every one of the registry can be sampled."""

from dataclasses import replace

import numpy as np
import pytest

from daemon.judging.oracles import SignalSampler
from daemon.model.verdicts import Outcome
from daemon.trace import CommandTrack, ContactRecord, LatencyTrack, ProgressRecord
from grammars.oracle import SIGNALS, Signal, object_signals, obstacle_names
from tests.engine.judging.oracles.traces import (
    CORRIDOR,
    along,
    cut,
    make_trace,
    mission,
    times,
    track,
    verdict,
    with_tree,
)


def value(trace, text):
    found = verdict(trace, text).evidence.value
    assert found is not None
    return found


def full():
    """A trace in which everything was recorded."""
    time = times(10.0)
    motion = along(time)
    touches = (
        ContactRecord(3.0, "robot", "door-17.leaf", (1.5, 0.2), (0.0, 1.0), 0.004),
        ContactRecord(4.0, "wall-north", "robot", (1.5, 0.2), (0.0, 1.0), 0.009),
    )
    estimate = track(time[2:], motion.x[2:], 0.2)
    trace = make_trace(
        motion,
        estimate=estimate,
        cloud=estimate,
        contacts=touches,
        progress=(ProgressRecord(0.0, 0, 0, "active"),),
        command=CommandTrack(time[10:12], np.array([0.4, 0.6]), np.zeros(2), np.array([0.1, -0.2])),
        latency=LatencyTrack(time[20:], np.full(len(time) - 20, 0.012)),
    )
    return with_tree(trace)


ALONE = [name for name, declared in SIGNALS.items() if not declared.relates]
"""Signals that need no arguments; the others are those of test_distance.py."""


@pytest.mark.parametrize("name", [*ALONE, *object_signals(CORRIDOR)])
def test_every_signal_of_the_registry_is_sampled(name):
    trace = full()
    arguments = (Signal("Spin"),) if name == "bt.node" else ()
    found = SignalSampler(trace).sample(Signal(name, arguments))
    assert found.values.shape == trace.ground_truth.time.shape
    assert np.isfinite(found.values).any()


def test_recoveries_are_counted_when_their_nodes_leave_idle():
    trace = with_tree(
        still_trace(),
        (2.0, "Spin 1 IDLE>RUNNING", "Spin-2 7 IDLE>RUNNING", "RecoveryActions 3 IDLE>RUNNING"),
        (3.0, "Spin 1 RUNNING>FAILURE", "Spin 1 FAILURE>IDLE"),
        # A service that answers within a tick is never RUNNING.
        (4.0, "ClearLocalCostmap-Subtree 4 IDLE>SUCCESS", "WaitForDoor 5 IDLE>RUNNING"),
        (5.0, "Spin 1 IDLE>RUNNING", "Wait 6 RUNNING>SUCCESS"),
    )
    assert value(trace, "final(bt.recoveries)") == 4
    assert value(cut(trace, 4.5), "max(bt.recoveries) >= 3") == 3


def test_a_node_runs_until_its_last_one_of_that_name_does_not():
    trace = with_tree(
        still_trace(),
        (1.0, "FollowPath 1 IDLE>RUNNING", "FollowPath 2 IDLE>RUNNING"),
        (2.0, "FollowPath 1 RUNNING>IDLE"),
        (3.0, "FollowPath 2 RUNNING>SUCCESS"),
    )
    assert value(trace, "time(bt.node(FollowPath))") == pytest.approx(2.0, abs=0.06)
    assert value(trace, "time(bt.node(Spin))") == 0.0


def test_a_node_with_blanks_in_its_name_is_named_in_quotes():
    tick = (1.0, "Compute Path 1 IDLE>RUNNING"), (3.0, "Compute Path 1 RUNNING>SUCCESS")
    trace = with_tree(still_trace(), *tick)
    assert value(trace, 'time(bt.node("Compute Path"))') == pytest.approx(2.0, abs=0.06)


def test_a_node_that_ran_between_two_samples_ran():
    tick = (2.01, "Wait 1 IDLE>RUNNING", "Wait 1 RUNNING>SUCCESS")
    trace = with_tree(still_trace(), tick)
    assert verdict(trace, "count(bt.node(Wait)) <= 0").outcome is Outcome.FAIL


def test_without_a_recorded_tree_nothing_is_known_of_it():
    assert verdict(still_trace(), "always(bt.recoveries <= 2)").outcome is Outcome.INCONCLUSIVE


def still_trace():
    return make_trace(along(times(10.0)))


def test_clearance_to_a_named_object_is_that_to_nothing_else():
    trace = full()
    nearest = verdict(trace, "min(clearance)")
    assert nearest.evidence.object.startswith("wall")
    door = verdict(trace, "min(clearance(door-17))")
    assert door.evidence.object == "door-17.leaf"
    # The robot ends at x = 5 m, 0.35 m long; the door's leaf begins at x = 8 m.
    assert door.evidence.value == pytest.approx(3.0 - 0.35)
    assert value(trace, "min(clearance(door-17, 1 m, 1 m))") == pytest.approx(2.0)
    assert value(trace, "min(clearance(door-17.leaf))") == door.evidence.value
    assert value(trace, "min(clearance(wall-north))") == pytest.approx(1.0 - 0.233)


def test_the_nearest_of_all_things_is_the_nearest_of_each():
    trace = full()
    each = [value(trace, f"min(clearance({name}, 0.4 m, 0.3 m))")
            for name in obstacle_names(CORRIDOR) if name != "lintel"]  # fmt: skip
    assert value(trace, "min(clearance(0.4 m, 0.3 m))") == min(each)


def test_the_smaller_of_two_signals_is_about_the_thing_of_that_one():
    trace = full()
    found = verdict(trace, "min(min(clearance(door-17), 9 m, clearance(wall-north)))")
    assert found.evidence.value == value(trace, "min(clearance(wall-north))")
    assert found.evidence.object == "wall-north"
    found = verdict(trace, "final(max(clearance(wall-north), clearance(door-17)))")
    assert found.evidence.value == value(trace, "final(clearance(door-17))")
    assert found.evidence.object == "door-17.leaf"
    assert value(trace, "max(max(speed, 9 m/s))") == 9.0
    assert verdict(trace, "max(max(clearance(lintel), 1 m))").evidence.value is None


def test_a_long_sum_is_judged_like_a_short_one():
    assert value(full(), f"final({'1+' * 480}1)") == 481.0


def test_a_thing_above_the_robot_has_no_clearance():
    found = verdict(full(), "always(clearance(lintel) > 0 m)")
    assert found.outcome == "inconclusive"


def test_contact_with_a_named_object():
    trace = full()
    assert value(trace, "count(contact)") == 2.0
    assert verdict(trace, "never(contact(door-17))").evidence.time == pytest.approx(3.0)
    assert verdict(trace, "never(contact(wall-north))").evidence.time == pytest.approx(4.0)
    assert verdict(trace, "never(contact(wall-south))").outcome == "pass"
    assert value(trace, "max(contact.depth(door-17))") == 0.004


def test_commands_are_held_and_unknown_before_the_first():
    trace = full()
    assert value(trace, "max(command.forward)") == 0.6
    assert value(trace, "min(command.angular)") == -0.2
    assert "known from 0.50 s on" in verdict(trace, "max(command.forward)").evidence.note


def test_estimates_and_true_poses_can_be_compared():
    trace = full()
    assert value(trace, "max(abs(estimate.y - pose.y))") == pytest.approx(0.2)
    assert value(trace, "max(loc.sigma.yaw)") == pytest.approx(0.1)
    assert value(trace, "min(estimate.particles)") == 500.0


def test_the_mission_is_told_by_leg_time_and_distance():
    reports = ((1.0, 0), (4.0, 1), (8.0, 2))
    progress = tuple(ProgressRecord(t, n, n, "active") for t, n in reports)
    trace = make_trace(along(times(10.0)), goal=mission((2.0, 0.0), (2.5, 3.0)), progress=progress)
    sampler = SignalSampler(trace)

    def at(name, time):
        return float(sampler.sample(Signal(name)).values[round(time * 20)])

    for name in ("mission.leg", "mission.leg.elapsed", "mission.distance"):
        assert np.isnan(at(name, 0.5))
    assert [at("mission.leg", t) for t in (1.0, 3.95, 4.0, 9.0)] == [1.0, 1.0, 2.0, 2.0]
    elapsed = [at("mission.leg.elapsed", t) for t in (1.0, 3.5, 4.0, 9.0)]
    assert elapsed == pytest.approx([0.0, 2.5, 0.0, 5.0])
    # At 0.5 m/s along x: 1.25 m from the first at 1.5 s, then 3 m beside the second at 5 s.
    assert at("mission.distance", 1.5) == pytest.approx(1.25)
    assert at("mission.distance", 5.0) == pytest.approx(3.0)
    assert at("mission.distance", 9.0) == pytest.approx(13**0.5)
    assert at("path.length", 9.0) == pytest.approx(4.5)
    assert at("elapsed", 9.0) == pytest.approx(9.0)


def test_the_distance_of_an_object_is_that_from_the_foot_of_its_joint():
    motion = along(times(10.0))
    trace = make_trace(replace(motion, y=np.full(len(motion.time), -0.5)))
    distance = SignalSampler(trace).sample(Signal("door-17.hinge.distance")).values
    # The door hangs at (8, 1).
    assert distance[0] == pytest.approx(np.hypot(8.0, 1.5))
    assert distance[-1] == pytest.approx(np.hypot(3.0, 1.5))


def test_of_contacts_between_two_samples_the_deepest_counts():
    touches = tuple(
        ContactRecord(time, first, second, (1.5, 0.2), (0.0, 1.0), depth)
        for time, first, second, depth in (
            (3.01, "robot", "wall-north", 0.004),
            (3.02, "door-17.leaf", "robot", 0.009),
            (3.03, "robot", "wall-south", 0.002),
            (3.04, "door-17.leaf", "wall-north", 0.5),
            (99.0, "robot", "wall-south", 0.7),
        )
    )
    trace = make_trace(along(times(10.0)), contacts=touches)
    deepest = verdict(trace, "max(contact.depth)")
    assert deepest.evidence.value == 0.009
    assert (deepest.evidence.object, deepest.evidence.time) == ("door-17.leaf", pytest.approx(3.05))
    assert value(trace, "count(contact)") == 1.0
    assert value(trace, "max(contact.depth(wall-north))") == 0.004


def test_driving_backwards_has_a_sign():
    trace = full()
    back = replace(trace, ground_truth=replace(trace.ground_truth, vx=-trace.ground_truth.vx))
    assert value(back, "min(speed.forward)") == -0.5
    assert value(back, "min(speed)") == 0.5


def answered(time, seconds):
    """A run of ten seconds whose system under test answered at these times."""
    track = LatencyTrack(np.array(time), np.array(seconds))
    return make_trace(along(times(10.0)), latency=track)


def test_every_answer_of_an_external_system_is_judged_between_two_samples_too():
    # A period of 10 ms: five answers to every sample of the true pose, the slow one amid them.
    time = np.arange(1000) / 100
    seconds = np.full(1000, 0.010)
    seconds[512] = 0.150
    found = verdict(answered(time.tolist(), seconds.tolist()), "always(latency <= 100 ms)")
    assert found.outcome is Outcome.FAIL
    assert found.margin == pytest.approx(-0.050)
    assert found.unit == "s"
    # Like a contact it belongs to the first sample that is not before it.
    assert found.evidence.time == pytest.approx(5.15)
    seconds[512] = 0.100
    found = verdict(answered(time.tolist(), seconds.tolist()), "always(latency <= 100 ms)")
    assert found.outcome is Outcome.PASS


def test_a_latency_lasts_until_the_next_answer_and_is_unknown_before_the_first():
    trace = answered([2.0, 2.2, 4.0], [0.030, 0.120, 0.010])
    values = SignalSampler(trace).sample(Signal("latency")).values
    at = dict(zip((round(t, 2) for t in times(10.0).tolist()), values.tolist(), strict=True))
    assert np.isnan(at[1.95])
    assert (at[2.0], at[2.15], at[2.2], at[3.95]) == (0.030, 0.030, 0.120, 0.120)
    assert (at[4.0], at[10.0]) == (0.010, 0.010)
    assert value(trace, "time(latency > 100 ms)") == pytest.approx(1.8)
    assert value(trace, "longest(latency > 100 ms)") == pytest.approx(1.8)
    note = verdict(trace, "max(latency) <= 1 s").evidence.note
    assert "known from 2.00 s on" in note


def test_the_latency_of_a_system_that_lives_inside_is_not_known():
    found = verdict(make_trace(along(times(10.0))), "always(latency <= 100 ms)")
    assert found.outcome is Outcome.INCONCLUSIVE
    assert "not recorded" in found.evidence.note


def test_a_late_answer_stays_a_failure_however_a_run_goes_on():
    trace = answered([1.0, 2.0, 9.0], [0.030, 0.120, 0.300])
    assert verdict(cut(trace, 5.0), "always(latency <= 100 ms)").outcome is Outcome.FAIL
    assert verdict(cut(trace, 1.5), "always(latency <= 100 ms)").outcome is Outcome.INCONCLUSIVE
