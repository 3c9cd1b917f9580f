"""Systems that fail, through whole runs: what is a failure of the robot, and what an error.

A stack that gives up or does nothing has failed; one that crashed, left or hung is an error.
"""

import math
import signal
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from daemon.judging import oracles
from daemon.judging.run_log import ended_run_log
from daemon.model import deadline
from daemon.model.deadline import OutOfTime, interruptible, wall_clock_limit
from daemon.model.spec import RunResult
from daemon.model.sut import Decision, Estimate, Progress, SutEvent, SutFailure
from daemon.model.verdicts import Outcome
from daemon.trace import read_outputs, read_trace
from grammars.model.geometry import Pose2, Twist2
from grammars.model.mission import Waypoint
from grammars.text import codec
from tests.plugins import MODULE, install_plugins, place_of

OUTSIDE = (Waypoint("outside", 100.0, 100.0),)


@pytest.fixture
def plugged(tmp_path, monkeypatch):
    folder = tmp_path / "packages"
    folder.mkdir()
    install_plugins(folder, monkeypatch)
    yield
    sys.modules.pop(MODULE, None)


@pytest.fixture
def executed(runs, tmp_path, plugged):
    """Execute a run of the open house by a system of ``tests.plugins``, and read its trace."""

    def execute(kind, parameters=None, *, goals=(), limit=30.0, **options):
        spec = runs.spec("open-house", kind, parameters, limit=limit)
        mission = replace(spec.mission, waypoints=goals or spec.mission.waypoints)
        result = runs.execute(replace(spec, mission=mission), tmp_path / "run.mcap", **options)
        return result, read_trace(tmp_path / "run.mcap")

    return execute


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
    ],
    ids=["idle", "never commands", "gives up at once", "claims success", "pilot"],
)  # fmt: skip
def test_a_robot_that_never_moved_has_failed(executed, kind, parameters, goals, ended, why):
    """The mission has failed and the rest is judged, now and when it is judged again."""
    result, trace = executed(kind, parameters, goals=goals)
    verdicts = {verdict.oracle: verdict for verdict in result.verdicts}
    assert (result.ended, result.outcome) == (ended, Outcome.FAIL)
    assert verdicts["reached"].outcome is Outcome.FAIL
    assert f"the robot never moved: {why}" in verdicts["reached"].evidence.note
    assert verdicts["no-contact"].outcome is Outcome.PASS
    assert oracles.trace_problems(trace) == ()
    assert oracles.judge(trace, trace.spec.oracles) == result.verdicts


def hangs_in_update(frame):
    return frame.f_code.co_name == "update" and frame.f_locals["observation"].time >= 1.0


def assert_crashed(result):
    assert (result.ended, result.outcome) == ("crashed", Outcome.ERROR)


def test_leaving_the_interpreter_is_a_crash(executed):
    result, _ = executed("leaves")
    assert_crashed(result)
    assert f"the system under test crashed: SystemExit: 3 ({MODULE}.py:" in result.note
    assert not result.stopped


def test_an_endless_update_is_ended_by_the_wall_clock_and_says_where(executed, passes_while):
    passes_while(hangs_in_update)
    with wall_clock_limit(0.2):
        result, trace = executed("hangs")
    assert_crashed(result)
    assert result.stopped
    assert result.note.startswith("stopped after 0.2 s of wall clock time, ")
    assert "of them in one call of update() (" in result.note
    line = int(place_of("here it hangs").rpartition(":")[2])
    assert any(f"{MODULE}.py:{number}" in result.note for number in (line - 1, line))
    assert (trace.complete, trace.note) == (True, result.note)
    assert trace.ground_truth.time[-1] == pytest.approx(1.0)
    assert trace.ground_truth.x[-1] > 0.0


def test_a_factory_that_hangs_in_a_run_ends_it_with_a_trace(executed, passes_while):
    passes_while(lambda frame: frame.f_code.co_name == "hangs_in_a_run")
    with wall_clock_limit(0.2):
        result, trace = executed("factory-hangs-in-a-run", {"hang": True})
    assert_crashed(result)
    assert result.stopped
    assert "of them in one call of its factory" in result.note
    assert trace.note == result.note


def test_a_run_that_is_merely_slow_is_ended_between_two_steps(executed, passes_while):
    told = []
    passes_while(lambda _: told)
    with wall_clock_limit(0.2):
        result, trace = executed("idle", limit=1e6, on_progress=told.append)
    assert_crashed(result)
    assert result.stopped
    assert trace.complete


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


class System:
    """A system of the test, perhaps an external one: it waits for what is said, then answers.

    From second 1 on an answer is what ``answer`` makes of the right one.
    """

    period = 0.1
    needs_ground_truth = False

    def __init__(self, waiting=(), failure="", events=(), answer=lambda decision: decision):
        self._waiting, self._failure, self._events = waiting, failure, events
        self._answer = answer

    def start(self, briefing):
        """Nothing to prepare."""

    def bring_up(self, first):
        yield from self._waiting
        if self._failure:
            raise SutFailure(self._failure, events=self._events)

    def update(self, observation):
        estimate = Estimate(observation.time, Pose2(), np.eye(3))
        right = Decision(Twist2(0.2), Progress(0, 0, "active"), estimate, latency=0.012)
        return right if observation.time < 1.0 else self._answer(right)

    def finish(self):
        """Fine."""

    def close(self):
        """Nothing to end."""

    def outputs(self):
        return {"stack.txt": b"up\xff\n"}


LOST = Estimate(1.0, Pose2(math.nan, 0.0, 0.0), np.eye(3))


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (lambda right: replace(right, command=Twist2(math.nan)), "finite"),
        (
            lambda right: replace(right, estimate=LOST),
            "its estimate has values that are not finite",
        ),
        (lambda _: None, "update() must return a Decision, not NoneType"),
        (lambda _: {}["no map"], "KeyError: 'no map'"),
    ],
    ids=["nonsense", "lost", "silent", "raises"],
)
def test_nonsense_is_an_error_of_the_system_under_test(executed, plug, answer, words):
    plug(System(answer=answer))
    result, trace = executed("plugged", limit=60.0)
    assert_crashed(result)
    assert words in result.note
    assert any(words in event.text for event in trace.events)


def brought_up(runs, path, repeatable=False, limit=1.0, **options):
    spec = runs.spec(kind="plugged", parameters={"repeatable": repeatable}, limit=limit)
    seen = []
    return runs.execute(spec, path, on_progress=seen.append, **options), seen


def test_what_is_waited_for_is_one_line_that_can_be_sent(runs, plug, tmp_path):
    said = (
        "starting my-nav2:\n 3 of 8 nodes active",
        # What a program printed may be no text: bytes that are no UTF-8, sequences for terminals.
        "waiting for \udcff\x1b[31mplanner",
        "x" * 100_000,
    )
    plug(System(said))
    result, seen = brought_up(runs, tmp_path / "run.mcap")
    assert result.ended == "limit"
    waited = [one for one in seen if one.waiting]
    assert [one.waiting for one in waited] == [
        "starting my-nav2: 3 of 8 nodes active",
        "waiting for \ufffd\ufffd[31mplanner",
        "x" * 120,
    ]
    assert {one.time for one in waited} == {0.0}
    assert [one.waiting for one in seen[3:]] == [""] * (len(seen) - 3)
    for one in seen:
        codec.to_json(one)
    assert read_trace(tmp_path / "run.mcap").latency.seconds.tolist() == [0.012] * 11
    assert read_outputs(tmp_path / "run.mcap") == {"stack.txt": "up\N{REPLACEMENT CHARACTER}\n"}


def test_a_repeatable_system_that_tells_its_latency_leaves_a_whole_trace(runs, plug, tmp_path):
    plug(System())
    result, _ = brought_up(runs, tmp_path / "run.mcap", repeatable=True, limit=12.0)
    trace = read_trace(tmp_path / "run.mcap")
    assert (trace.complete, len(trace.latency.time)) == (True, 0)
    assert trace.ground_truth.time[-1] == 12.0
    assert result.ended == "limit"


def test_last_lines_that_are_no_text_still_make_a_result(runs, plug, tmp_path):
    plug(System(("starting",), "it ended with exit code 3\n  Segmentation \udcfffault"))
    result, _ = brought_up(runs, tmp_path / "run.mcap")
    assert_crashed(result)
    assert result.note == "it ended with exit code 3\n  Segmentation \\udcfffault"
    assert codec.from_json(RunResult, codec.to_json(result)).note == result.note


def test_what_a_system_said_before_it_failed_is_in_the_log(runs, plug, tmp_path):
    events = (SutEvent("out of memory", "error", "planner"), SutEvent("bye"))
    plug(System(("starting",), "it ended with exit code 9", events))
    brought_up(runs, tmp_path / "run.mcap")
    trace = read_trace(tmp_path / "run.mcap")
    assert [(e.source, e.text, e.level) for e in trace.events] == [
        ("planner", "out of memory", "error"),
        ("sut", "bye", "info"),
        ("sut", "it ended with exit code 9", "error"),
    ]
    said = [line.text for line in ended_run_log(trace)]
    assert said[-1] == "crashed"
    assert said.count("it ended with exit code 9") == 1


@pytest.mark.parametrize("failure", ["", "it ended with exit code 3"])
def test_it_is_judged_from_its_bring_up_to_however_it_ends(runs, plug, tmp_path, failure):
    plug(System(("starting", "3 of 8"), failure))
    told = []
    watching = SimpleNamespace(wanted=lambda: "everything", tell=told.append)
    result, _ = brought_up(runs, tmp_path / "run.mcap", judgements=watching)
    assert (told[0].time, told[0].doors, told[0].reached) == (0.0, (), ())
    assert told[-1].verdicts == result.verdicts
    assert result.ended == ("crashed" if failure else "limit")
