"""Runs executed in processes of their own: candidates of blame, and recorded runs once more."""

import os
import random
import signal
import time
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from daemon.analysis.blame import Candidate
from daemon.analysis.blame._runner import execute_candidates
from daemon.analysis.rejudge import rejudge
from daemon.analysis.verification import DURATION, PATH, verify, verify_spec
from daemon.batch.paths import StatePaths
from daemon.campaign import expand, load_campaign
from daemon.model.spec import SutReference
from daemon.model.verdicts import Outcome
from daemon.run import execute
from daemon.trace import TraceError
from tests.analysis.blame import write
from tests.analysis.old_runs import EXTERNAL, IDLE, WORLD, drive, erratic, recorded, spec
from tests.parts import DEADLINE
from tests.plugins import install_plugins

__all__ = ["erratic"]


@pytest.fixture
def candidates(demo):
    """Three runs of a second that differ in their seeds."""
    planned = expand(load_campaign(write(demo, **{"16 s": "1 s"})))
    return [Candidate(replace(planned.specs[0], seed=seed), planned.scenes[0]) for seed in range(3)]


def test_verdicts_come_back_and_a_process_that_dies_is_unresolved(candidates):
    def execute_or_die(spec, scene, **rest):
        if spec.seed == 1:
            os._exit(3)
        return execute(spec, scene, **rest)

    good, bad = execute_candidates(candidates[:2], execute_or_die)
    assert [one.outcome for one in good] == ["fail", "pass"]
    assert [one.oracle for one in good] == ["reached", "no-contact"]
    assert {one.outcome for one in bad} == {"error"}
    assert bad[0].evidence.note == "its process died with code 3"


def test_a_system_that_prints_by_descriptors_prints_into_no_answer(candidates, capfd):
    def execute_aloud(spec, scene, **rest):
        print("by Python")
        os.system("echo by a child; echo by a child >&2")
        os.write(1, b"by descriptor\n")
        os.write(2, b"by descriptor\n")
        return execute(spec, scene, **rest)

    (verdicts,) = execute_candidates(candidates[:1], execute_aloud)
    assert [one.outcome for one in verdicts] == ["fail", "pass"]
    assert capfd.readouterr() == ("", "")


def test_chance_that_nobody_has_seeded_differs_between_candidates(candidates, tmp_path):
    def execute_by_chance(spec, scene, **rest):
        drawn = f"{random.random()} {np.random.random()}"
        (tmp_path / f"{spec.seed}.txt").write_text(drawn)
        return execute(spec, scene, **rest)

    execute_candidates(candidates[:2], execute_by_chance)
    first, second = ((tmp_path / f"{seed}.txt").read_text().split() for seed in range(2))
    assert first[0] != second[0]
    assert first[1] != second[1]


def test_an_interrupt_leaves_no_process_behind(candidates, tmp_path):
    parent = os.getpid()

    def interrupt_together(*_, **__):
        (tmp_path / str(os.getpid())).touch()
        if len(list(tmp_path.glob("[0-9]*"))) == 2:
            # Both may see both: one interrupt is what is tried.
            with suppress(FileExistsError):
                (tmp_path / "interrupted").touch(exist_ok=False)
                os.kill(parent, signal.SIGINT)
        time.sleep(DEADLINE)

    # A shell without job control starts what is in its background with interrupts ignored.
    previous = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            execute_candidates(candidates[:2], interrupt_together)
    finally:
        signal.signal(signal.SIGINT, previous)
    for name in tmp_path.glob("[0-9]*"):
        with pytest.raises(ProcessLookupError):
            os.kill(int(name.name), 0)


@pytest.fixture
def places(tmp_path):
    return StatePaths(tmp_path)


def test_of_a_system_that_is_outside_the_spread_is_told(tmp_path, places, erratic):
    path, _ = recorded(tmp_path, sut=EXTERNAL)
    found = verify(path, 3, places=places)
    assert (found.repeatable, found.all_executed, found.sut) == (False, True, "theirs")
    spreads = {spread.name: spread for spread in found.spreads}
    assert {DURATION, PATH, "slow", "far"} <= set(spreads)
    for name in (DURATION, PATH, "far"):
        assert spreads[name].count == 4
        assert spreads[name].least <= found.recorded.values[name] <= spreads[name].most
    assert spreads[PATH].least < spreads[PATH].most
    assert (spreads[PATH].unit, spreads["slow"].unit) == ("m", "m/s")


def gone(*_, **__):
    raise ValueError("the stack is not installed here")


def stopped(*arguments, **rest):
    return replace(execute(*arguments, **rest), note="its time was up", stopped=True)


@pytest.mark.parametrize(
    ("execute_run", "problem"),
    [
        (gone, "ValueError: the stack is not installed here"),
        (lambda *_, **__: os._exit(3), "its process died with code 3"),
        # Stopped by the wall clock, whatever its note says.
        (stopped, "its time was up"),
    ],
)
def test_an_execution_that_fails_is_none_and_says_why(
    tmp_path, places, execute_run, problem, monkeypatch
):
    monkeypatch.setattr("daemon.analysis.verification.execute", execute_run)
    path, _ = recorded(tmp_path, sut=IDLE)
    found = verify(path, 1, places=places)
    assert [one.problem for one in found.executions] == [problem]
    assert not found.all_executed
    assert sum(found.outcomes.values()) == 1


def test_a_trace_of_another_engine_is_refused(tmp_path, places):
    path, _ = recorded(tmp_path, sut=IDLE, engine="1")
    with pytest.raises(TraceError, match="is of engine 1, this is engine"):
        verify(path, 1, places=places)


@pytest.fixture
def plugged(tmp_path, monkeypatch):
    folder = tmp_path / "packages"
    folder.mkdir()
    install_plugins(folder, monkeypatch)


def test_a_run_that_the_wall_clock_ends_is_no_execution(places, plugged):
    run = spec(limit=3.0, sut=SutReference("hangs", "hangs", {}))
    found = verify_spec(run, WORLD, 2, places=places, wall=0.001)
    assert (found.executions, found.all_executed) == ((), False)
    assert found.recorded.problem.startswith("stopped after 0.001 s of wall clock time")


def test_traces_judged_over_processes_come_in_order(tmp_path, places):
    traces = [drive(tmp_path / f"{i:02}.mcap", spec(i), 0.5 + 0.02 * i) for i in range(12)]
    alone, spread = (
        tuple(rejudge(traces, None, places=places, processes=count)) for count in (1, 2)
    )
    assert spread == alone
    assert [one.run for one in spread] == [f"S1/pilot/{i}" for i in range(12)]
    assert {one.outcome for one in spread} == {Outcome.PASS, Outcome.FAIL}
