"""Robots that go nowhere, through whole runs: a stack that gives up or does nothing has failed.

What remains an error is a stack that crashed, left or hung.
"""

import signal
import sys
from dataclasses import replace
from types import SimpleNamespace

import pytest

from daemon.campaign import expand, load_campaign
from daemon.judging import oracles
from daemon.model import deadline
from daemon.model.deadline import OutOfTime, interruptible, wall_clock_limit
from daemon.model.spec import SutReference
from daemon.model.verdicts import Outcome
from daemon.run import execute
from daemon.trace import read_trace
from grammars.model.mission import Waypoint
from tests.plugins import MODULE, install_plugins, place_of

OUTSIDE = (Waypoint("outside", 100.0, 100.0),)


@pytest.fixture(scope="module")
def demo(campaigns):
    found = expand(load_campaign(campaigns / "demo" / "campaign.yaml"))
    spec = next(spec for spec in found.specs if spec.scenario == "open-house")
    return spec, found.scenes[0]


@pytest.fixture
def plugged(tmp_path, monkeypatch):
    folder = tmp_path / "packages"
    folder.mkdir()
    install_plugins(folder, monkeypatch)
    yield
    sys.modules.pop(MODULE, None)


def executed(demo, path, kind, parameters=None, *, goals=(), limit=30.0, on_progress=None):
    spec, scene = demo
    mission = replace(spec.mission, waypoints=goals or spec.mission.waypoints)
    sut = SutReference(kind, kind, parameters or {})
    spec = replace(spec, sut=sut, limit=limit, mission=mission)
    return execute(spec, scene, trace_path=path, on_progress=on_progress)


@pytest.fixture
def passes_while(monkeypatch):
    """Let time pass for limits only while something is true of the frame that is executed.

    Alarms come by the clock of the machine. However late it gets to where it is meant to be
    interrupted, none interrupts it before.
    """

    def limit_by(is_true):
        def monotonic():
            frame = sys._getframe(1)
            while frame.f_code.co_filename == deadline.__file__:
                frame = frame.f_back
            return 10.0 if is_true(frame) else 0.0

        monkeypatch.setattr(deadline, "time", SimpleNamespace(monotonic=monotonic))

    return limit_by


def hangs_in_update(frame):
    return frame.f_code.co_name == "update" and frame.f_locals["observation"].time >= 1.0


def assert_failed(result, path, why):
    """The mission has failed and the rest is judged, now and when it is judged again."""
    verdicts = {verdict.oracle: verdict for verdict in result.verdicts}
    assert result.outcome is Outcome.FAIL
    assert verdicts["reached"].outcome is Outcome.FAIL
    assert f"the robot never moved: {why}" in verdicts["reached"].evidence.note
    assert verdicts["no-contact"].outcome is Outcome.PASS
    trace = read_trace(path)
    assert oracles.trace_problems(trace) == ()
    assert oracles.judge(trace, trace.spec.oracles) == result.verdicts


@pytest.mark.parametrize(
    ("kind", "parameters", "goals", "ended", "why"),
    [
        ("idle", {}, (), "limit", "every command was zero"),
        ("plain", {}, (), "limit", "no command was given"),
        (
            "gives-up", {}, (), "finished",
            "every command was zero, the mission was given up at 0.00 s",
        ),
        (
            "says-done", {}, (), "finished",
            "every command was zero, the mission was called done at 0.00 s",
        ),
        ("pilot", {}, OUTSIDE, "finished", "every command was zero, the mission was given up at"),
        (
            "ros", {"move_base": {"planner_patience": 1.0, "recovery_behavior_enabled": False}},
            OUTSIDE, "finished", "every command was zero, the mission was given up at",
        ),
    ],
    ids=["idle", "never commands", "gives up at once", "claims success", "pilot", "ros"],
)  # fmt: skip
def test_a_robot_that_never_moved_has_failed(
    demo, tmp_path, plugged, kind, parameters, goals, ended, why
):
    path = tmp_path / "run.mcap"
    result = executed(demo, path, kind, parameters, goals=goals)
    assert result.ended == ended
    assert_failed(result, path, why)


def test_leaving_the_interpreter_is_a_crash(demo, tmp_path, plugged):
    result = executed(demo, tmp_path / "run.mcap", "leaves")
    assert (result.ended, result.outcome) == ("crashed", Outcome.ERROR)
    assert f"the system under test crashed: SystemExit: 3 ({MODULE}.py:" in result.note
    assert not result.stopped


def test_an_endless_update_is_ended_by_the_wall_clock(demo, tmp_path, plugged, passes_while):
    path = tmp_path / "run.mcap"
    passes_while(hangs_in_update)
    with wall_clock_limit(3.0):
        result = executed(demo, path, "hangs")
    assert (result.ended, result.outcome) == ("crashed", Outcome.ERROR)
    assert result.stopped
    assert result.note.startswith("stopped after 3 s of wall clock time, ")
    assert "of them in one call of update() (" in result.note
    trace = read_trace(path)
    assert (trace.complete, trace.note) == (True, result.note)
    assert trace.ground_truth.time[-1] == pytest.approx(1.0)
    assert trace.ground_truth.x[-1] > 0.0


def test_a_factory_that_hangs_in_a_run_ends_it_with_a_trace(demo, tmp_path, plugged, passes_while):
    path = tmp_path / "run.mcap"
    passes_while(lambda frame: frame.f_code.co_name == "hangs_in_a_run")
    with wall_clock_limit(3.0):
        result = executed(demo, path, "factory-hangs-in-a-run", {"hang": True})
    assert (result.ended, result.outcome) == ("crashed", Outcome.ERROR)
    assert "of them in one call of its factory" in result.note
    assert result.stopped
    assert read_trace(path).note == result.note


def test_a_run_that_is_merely_slow_is_ended_between_two_steps(demo, tmp_path, passes_while):
    told = []
    passes_while(lambda _: told)
    with wall_clock_limit(0.2):
        result = executed(demo, tmp_path / "run.mcap", "idle", limit=1e6, on_progress=told.append)
    assert (result.ended, result.outcome) == ("crashed", Outcome.ERROR)
    assert result.stopped
    assert read_trace(tmp_path / "run.mcap").complete


def loop_for(seconds):
    with wall_clock_limit(seconds), interruptible("a loop"):
        while True:
            pass


def test_the_nearest_limit_holds_and_nothing_is_left_of_it(passes_while):
    passes_while(lambda frame: frame.f_code.co_name == "loop_for" and deadline._limits.call)
    with wall_clock_limit(60.0):
        with pytest.raises(OutOfTime, match=r"stopped after 0.05 s .* in one call of a loop"):
            loop_for(0.05)
        with interruptible("what comes next"):
            pass
    with interruptible("what comes after"):
        pass


def test_the_timer_of_others_goes_on():
    before = signal.signal(signal.SIGALRM, signal.SIG_IGN)
    signal.setitimer(signal.ITIMER_REAL, 1000.0)
    try:
        with wall_clock_limit(60.0):
            pass
        left, _ = signal.getitimer(signal.ITIMER_REAL)
        assert 60.0 < left <= 1000.0
        assert signal.getsignal(signal.SIGALRM) is signal.SIG_IGN
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def test_where_it_hung_is_said(demo, tmp_path, plugged, passes_while):
    passes_while(hangs_in_update)
    with wall_clock_limit(2.0):
        result = executed(demo, tmp_path / "run.mcap", "hangs")
    hanging = place_of("here it hangs")
    line = int(hanging.rpartition(":")[2])
    assert any(f"{MODULE}.py:{number}" in result.note for number in (line - 1, line))
