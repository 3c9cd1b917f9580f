"""Localisation signals: error, confidence and age of the estimate."""

import math
from dataclasses import replace

import numpy as np
import pytest

from daemon.model.verdicts import Outcome
from tests.engine.judging.oracles.traces import along, make_trace, still, times, track, verdict


def test_an_estimate_is_compared_with_the_truth_when_it_was_taken():
    time = times(4.0)
    stamps = np.array([0.5, 1.525, 2.513])
    trace = make_trace(along(time, speed=1.0), estimate=track(stamps, stamps))
    assert verdict(trace, "max(loc.error)").evidence.value == pytest.approx(0.0, abs=1e-12)


def test_errors_have_signs_per_axis():
    time = times(1.0)
    estimate = replace(track(time, -0.3 + 0 * time, 0.4), yaw=0.1 + 0 * time)
    trace = make_trace(still(time), estimate=estimate)
    values = {
        name: verdict(trace, f"final({name})").evidence.value
        for name in ("loc.error", "loc.error.x", "loc.error.y", "loc.error.yaw")
    }
    assert values == pytest.approx(
        {"loc.error": 0.5, "loc.error.x": -0.3, "loc.error.y": 0.4, "loc.error.yaw": 0.1}
    )


def test_heading_error_is_small_across_the_seam():
    time = times(1.0)
    motion = replace(still(time), yaw=np.full(len(time), math.pi - 0.05))
    estimate = replace(track(time, 0 * time), yaw=np.full(len(time), -math.pi + 0.05))
    trace = make_trace(motion, estimate=estimate)
    assert verdict(trace, "max(abs(loc.error.yaw))").evidence.value == pytest.approx(0.1)


def test_heading_is_interpolated_across_the_seam():
    turning = times(2.0, rate=2.0)
    yaw = math.pi - 0.1 + 0.2 * turning
    motion = replace(still(turning), yaw=np.where(yaw > math.pi, yaw - math.tau, yaw))
    stamps = np.array([0.75])
    estimate = replace(track(stamps, 0 * stamps), yaw=np.array([0.05 - math.pi]))
    trace = make_trace(motion, estimate=estimate)
    assert verdict(trace, "max(abs(loc.error.yaw))").evidence.value == pytest.approx(0.0, abs=1e-9)


def test_confidence_holds_per_axis_within_two_sigma():
    time = times(9.95)
    off_x = np.where(time < 1.0, 0.21, 0.19)
    cloud = track(time, off_x, 0.19)
    trace = make_trace(still(time), cloud=cloud)
    found = verdict(trace, "fraction(loc.inside_2sigma) >= 95 %")
    assert found.outcome is Outcome.FAIL
    assert found.evidence.value == pytest.approx(1.0 - 1.0 / 9.95)
    assert found.evidence.time == pytest.approx(0.0)
    assert "from the particle cloud" in found.evidence.note


def test_confidence_falls_back_to_the_covariance_and_says_so():
    time = times(2.0)
    trace = make_trace(still(time), estimate=track(time, 0.1 + 0 * time, sigma=0.2))
    found = verdict(trace, "fraction(loc.inside_2sigma) >= 95 %")
    assert (found.outcome, found.evidence.value) == (Outcome.PASS, 1.0)
    assert "from the estimate's covariance" in found.evidence.note
    assert verdict(trace, "max(loc.sigma.x)").evidence.value == pytest.approx(0.2)


def test_the_cloud_tells_the_spread_when_there_is_one():
    time = times(2.0)
    trace = make_trace(
        still(time),
        estimate=track(time, 0 * time, sigma=0.2),
        cloud=track(time, 0 * time, sigma=0.3),
    )
    assert verdict(trace, "max(loc.sigma.y)").evidence.value == pytest.approx(0.3)


def test_an_estimate_grows_old():
    time = times(4.0)
    stamps = np.array([0.0, 1.0])
    trace = make_trace(still(time), estimate=track(stamps, 0 * stamps))
    assert verdict(trace, "max(loc.age)").evidence.value == pytest.approx(3.0)
