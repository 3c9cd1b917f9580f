"""A run of a robot with several lasers, each at its own rate and told apart all the way."""

from dataclasses import replace

import numpy as np
import pytest

from daemon.campaign import expand, load_campaign
from daemon.model.spec import SutReference
from daemon.model.sut import Decision, Progress
from daemon.model.verdicts import Outcome
from daemon.run import execute
from daemon.run_loop import RunLoop
from daemon.trace import TraceWriter, read_trace


@pytest.fixture(scope="module")
def submission(campaigns):
    return expand(load_campaign(campaigns / "two_lasers" / "campaign.yaml"))


@pytest.fixture(scope="module")
def scene(submission):
    return submission.scenes[0]


def spec_of(submission, scenario, sut):
    return next(s for s in submission.specs if (s.scenario, s.sut.name) == (scenario, sut))


class Listener:
    """Stands still and keeps the scans it gets."""

    period = 0.05
    needs_ground_truth = False

    def __init__(self):
        self.scans = []

    def start(self, briefing):
        """Nothing to prepare."""

    def update(self, observation):
        """Take what is new."""
        self.scans += observation.scans
        return Decision(None, Progress(0, 0, "active"))


def listen(path, spec, scene):
    """Stand still for two seconds; return the scans as they came and as they were recorded."""
    spec = replace(spec, sut=SutReference("idle", "idle", {}), limit=2.0)
    listener = Listener()
    with TraceWriter(path, spec, scene) as trace:
        end = RunLoop(spec, scene, trace, sut=listener).run()
        trace.close(end.ended, end.note)
    return listener.scans, read_trace(path, scans=True)


def test_each_laser_has_its_own_rate_and_they_come_in_order(submission, scene, tmp_path):
    spec = spec_of(submission, "busy-house", "pilot")
    heard, trace = listen(tmp_path / "run.mcap", spec, scene)
    front, rear = trace.scans
    np.testing.assert_allclose(front.time, np.arange(21) / 10)
    np.testing.assert_allclose(rear.time, np.ceil(np.arange(17) * 12.5 - 1e-9) / 100)
    assert [s.time for s in heard] == sorted(s.time for s in heard)
    together = [s.laser for s in heard if s.time in (0.0, 0.5, 1.0, 1.5, 2.0)]
    assert together == ["front", "rear"] * 5
    for track in trace.scans:
        came = [s.ranges for s in heard if s.laser == track.laser]
        np.testing.assert_array_equal(track.ranges, came)


def test_one_laser_more_changes_nothing_for_the_first(submission, scene, tmp_path):
    spec = spec_of(submission, "busy-house", "pilot")
    alone = replace(spec, robot=replace(spec.robot, other_lasers=()))
    _, both = listen(tmp_path / "both.mcap", spec, scene)
    _, one = listen(tmp_path / "one.mcap", alone, scene)
    np.testing.assert_array_equal(both.scans[0].ranges, one.scans[0].ranges)
    np.testing.assert_array_equal(both.joints.position, one.joints.position)
    np.testing.assert_array_equal(both.odometry.x, one.odometry.x)


@pytest.mark.parametrize("sut", ["pilot", "shuttle-nav"])
def test_stacks_drive_a_robot_with_two_lasers(submission, scene, tmp_path, sut):
    spec = spec_of(submission, "open-house", sut)
    result = execute(spec, scene, trace_path=tmp_path / "run.mcap")
    assert result.outcome is Outcome.PASS
    again = execute(spec, scene, trace_path=tmp_path / "again.mcap")
    assert again.trace == result.trace
