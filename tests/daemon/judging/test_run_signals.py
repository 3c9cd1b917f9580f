"""Signals of a run along time, its doors and its mission."""

from dataclasses import replace

import numpy as np
import pytest

from daemon.judging.oracles import SignalSampler
from daemon.judging.run_signals import (
    DOOR_CLEARANCE,
    RunSignal,
    door_motions,
    merge_spans,
    sample_run_signals,
    thin_signal,
)
from daemon.trace import JointTrack
from grammars.oracle import Signal
from tests.daemon.judging.oracles.traces import CORRIDOR, along, door, make_trace, times


def test_doors_open_when_they_leave_how_they_are_drawn():
    position = np.array([[0.0], [0.04], [0.5], [0.5], [0.01], [-0.2]])
    track = JointTrack(("door-1.hinge",), np.arange(6.0), position, np.zeros((6, 1)))
    found = [(event.time, event.opens) for event in door_motions(track)]
    assert found == [(2.0, True), (4.0, False), (5.0, True)]


def test_stretches_that_touch_become_one():
    assert merge_spans([(3.0, 4.0), (0.0, 1.0), (1.0, 2.0), (3.5, 3.6)]) == ((0.0, 2.0), (3.0, 4.0))


def test_a_thinned_signal_keeps_its_extremes_and_says_what_is_not_known():
    time = np.arange(0.0, 10.0, 0.01)
    values = np.sin(time)
    values[777] = 5.123456
    values[:100] = np.nan
    thin = thin_signal(RunSignal("it", "m", time, values, (0.5,)), 0.0, 10.0, 50)
    assert (len(thin.low), len(thin.high), thin.limits) == (50, 50, (0.5,))
    assert thin.low[:5] == (None,) * 5
    assert thin.high[38] == 5.123
    assert thin.low[38] is not None
    assert thin.low[38] < 1.0


def test_a_part_without_samples_holds_the_value_before_it():
    signal = RunSignal("it", "m", np.array([0.0, 1.0, 9.0]), np.array([2.0, 3.0, 4.0]))
    thin = thin_signal(signal, 0.0, 10.0, 10)
    assert thin.low == thin.high == (2.0, *(3.0,) * 8, 4.0)


def test_a_thinned_signal_has_no_more_stretches_than_parts():
    time = np.arange(0.0, 100.0, 0.05)
    against = tuple((float(at), float(at) + 0.05) for at in time[::2])
    thin = thin_signal(RunSignal("it", "bool", time, time % 1.0, (), against), 0.0, 100.0, 20)
    assert thin.against == ((0.0, pytest.approx(99.95)),)
    few = RunSignal("it", "bool", time, time, (), ((1.0, 2.0), (50.0, 60.0)))
    assert thin_signal(few, 0.0, 100.0, 20).against == few.against


def test_the_clearance_of_doors_is_the_least_of_every_object():
    scene = replace(CORRIDOR, objects=tuple(door(f"door-{i}", 2.0 * i, 1.0) for i in range(1, 5)))
    trace = make_trace(along(times(15.0)), scene=scene)
    sampler = SignalSampler(trace)
    (found,) = (s for s in sample_run_signals(sampler) if s.name == DOOR_CLEARANCE)
    each = [sampler.sample(Signal("clearance", (Signal(o.name),))).values for o in scene.objects]
    assert np.array_equal(found.values, np.min(each, axis=0))
    assert 0.0 < found.values.min() < 1.0
