"""Systems that fail, through whole runs: what is a failure of the robot, and what an error.

A stack that gives up or does nothing has failed; one that crashed, left or hung is an error.
"""

import math
import re
import signal
import sys
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from daemon.judging import oracles
from daemon.judging.run_log import ended_run_log
from daemon.model import deadline
from daemon.model.deadline import OutOfTime, interruptible, wall_clock_limit
from daemon.model.spec import RunResult
from daemon.model.sut import Estimate, SutEvent
from daemon.model.verdicts import Outcome
from daemon.stacks.calls import sut_call
from daemon.trace import read_outputs, read_trace
from grammars.model.geometry import Pose2, Twist2
from grammars.model.mission import Waypoint
from grammars.text import codec
from tests.engine.systems import System, later
from tests.plugins import MODULE, install_plugins, let_time_pass_while, place_of

OUTSIDE = (Waypoint("outside", 100.0, 100.0),)


@pytest.fixture
def executed(runs, tmp_path, monkeypatch):
    """Execute a run of the open house by a system of ``tests.plugins``, and read its trace."""
    (tmp_path / "packages").mkdir()
    install_plugins(tmp_path / "packages", monkeypatch)

    def execute(kind, parameters=None, *, goals=(), limit=30.0, **options):
        spec = runs.spec("open-house", kind, parameters, limit=limit)
        mission = replace(spec.mission, waypoints=goals or spec.mission.waypoints)
        result = runs.execute(replace(spec, mission=mission), tmp_path / "run.mcap", **options)
        return result, read_trace(tmp_path / "run.mcap")

    yield execute
    sys.modules.pop(MODULE, None)


@pytest.fixture
def passes_while(monkeypatch):
    return partial(let_time_pass_while, monkeypatch)


def answers(answer):
    return System(answer=later(answer))


LOST = Estimate(1.0, Pose2(math.nan, 0.0, 0.0), np.eye(3))
WAITS = (
    "starting my-nav2:\n 3 of 8 nodes active",
    # What a program printed may be no text: bytes that are no UTF-8, sequences for terminals.
    "waiting for \udcff\x1b[31mplanner",
    "x" * 100_000,
)
EVENTS = (SutEvent("out of memory", "error", "planner"), SutEvent("bye"))
SYSTEMS = {
    **{kind: kind for kind in ("idle", "plain", "gives-up", "says-done", "leaves")},
    "pilot to a waypoint outside": "pilot",
    "command that is no number": answers(lambda right: replace(right, command=Twist2(math.nan))),
    "estimate that is no number": answers(lambda right: replace(right, estimate=LOST)),
    "no decision": answers(lambda _: None),
    "exception": answers(lambda _: {}["no map"]),
    "waits, then answers": System(WAITS),
    "repeatable, tells latencies": System(),
    "last lines that are no text": System(("starting",), "exit code 3\n  Segmentation \udcfffault"),
    "what was said before": System(("starting",), "it ended with exit code 9", EVENTS),
}


def told(result, trace, seen):
    yield f"{result.ended}, {result.outcome.value}{', stopped' * result.stopped}: {result.note!r}"
    yield from (
        f"{one.oracle}: {one.outcome.value} {one.evidence.note}".rstrip() for one in result.verdicts
    )
    yield from (
        f"waits {one.waiting[:60]!r}, {len(one.waiting)} characters" for one in seen if one.waiting
    )
    yield from (f"{e.time:g} s {e.level} {e.source}: {e.text!r}" for e in trace.events)
    latencies = trace.latency.seconds.tolist()
    yield f"{trace.valid_until:g} s, {len(latencies)} latencies {sorted(set(latencies))}"
    yield from (f"doubted: {problem}" for problem in oracles.trace_problems(trace))
    yield f"log ends {ended_run_log(trace)[-1].text!r}, outputs {read_outputs(trace.path)}"


def test_each_system_comes_to_what_stands_below_it(executed, plug, golden):
    """Now and when it is judged again; what is told of it can be sent."""
    lines = []
    for name, system in SYSTEMS.items():
        kind, parameters, seen = system, {}, []
        if not isinstance(system, str):
            plug(system)
            kind, parameters = "plugged", {"repeatable": name.startswith("repeatable")}
        goals = OUTSIDE if "outside" in name else ()
        result, trace = executed(kind, parameters, goals=goals, limit=2.0, on_progress=seen.append)
        for one in seen:
            codec.to_json(one)
        assert codec.from_json(RunResult, codec.to_json(result)) == result
        assert trace.complete
        assert oracles.judge(trace, trace.spec.oracles) == result.verdicts
        lines += [f"== {name}", *(re.sub(r"py:\d+", "py:…", t) for t in told(result, trace, seen))]
    golden("failures.txt", "\n".join([*lines, ""]))


def hangs_in_update(frame):
    return frame.f_code.co_name == "update" and frame.f_locals["observation"].time >= 1.0


def assert_crashed(result):
    assert (result.ended, result.outcome) == ("crashed", Outcome.ERROR)


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


@pytest.fixture
def alarm_at_the_end_of_calls():
    """Let an alarm come where a call of a system has just returned."""

    def trace(frame, *_):
        if frame.f_code is sut_call.__exit__.__code__:
            deadline._limits.on_alarm(signal.SIGALRM, frame)

    before = sys.gettrace()
    sys.settrace(trace)
    yield
    sys.settrace(before)


@pytest.mark.usefixtures("alarm_at_the_end_of_calls")
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


@pytest.mark.parametrize("failure", ["", "it ended with exit code 3"])
def test_it_is_judged_from_its_bring_up_to_however_it_ends(runs, plug, tmp_path, failure):
    plug(System(("starting", "3 of 8"), failure))
    told = []
    watching = SimpleNamespace(scope=lambda: "everything", tell=told.append)
    spec = runs.spec(kind="plugged", parameters={"repeatable": False}, limit=1.0)
    result = runs.execute(
        spec, tmp_path / "run.mcap", on_progress=lambda _: None, judgements=watching
    )
    assert (told[0].time, told[0].doors, told[0].reached) == (0.0, (), ())
    assert told[-1].verdicts == result.verdicts
    assert result.ended == ("crashed" if failure else "limit")
