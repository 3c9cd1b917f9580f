"""Specifications in traces executed again: the same bytes, or how far the outcomes spread."""

import random
import sys
from dataclasses import replace
from importlib.metadata import EntryPoint

import pytest

from daemon.analysis.verification import DURATION, PATH, verify, verify_spec
from daemon.batch.paths import StatePaths
from daemon.model.spec import OracleText, SutReference
from daemon.model.sut import Decision, Progress
from daemon.run import execute
from daemon.stacks import registry
from daemon.trace import TraceError
from grammars.model.geometry import Twist2
from tests.analysis.old_runs import WORLD, spec
from tests.plugins import MODULE, install_plugins

MEASURE = OracleText("far", "final(path.length)")
EXTERNAL = SutReference("theirs", "erratic", {"repeatable": False})


class Erratic:
    """Drives on at a speed it draws, as something does that nobody here controls."""

    period = 0.1
    needs_ground_truth = False

    def __init__(self, parameters):
        self._speed = random.uniform(0.1, 0.5)

    def start(self, briefing):
        self._end = random.uniform(0.4, 1.2)

    def update(self, observation):
        state = "aborted" if observation.time > self._end else "active"
        return Decision(Twist2(self._speed, 0.0, 0.0), Progress(0, 0, state))


@pytest.fixture
def erratic(monkeypatch):
    entry = EntryPoint("erratic", f"{__name__}:Erratic", registry.ENTRY_POINT_GROUP)
    monkeypatch.setattr(registry, "installed", lambda group: {"erratic": entry})


def recorded(folder, **changes):
    run = replace(spec(limit=1.0), **changes)
    run = replace(run, oracles=(*run.oracles, MEASURE))
    path = folder / "run.mcap"
    execute(run, WORLD, trace_path=path)
    return path, run


def idle():
    return SutReference("idle", "idle", {})


def test_a_system_in_the_simulation_leaves_the_same_bytes(tmp_path):
    path, run = recorded(tmp_path, sut=idle())
    found = verify(path, 2, places=StatePaths(tmp_path))
    assert (found.repeatable, found.same_bytes, found.all_executed) == (True, 2, True)
    assert (found.run, found.digest, dict(found.versions)) == (run.label, run.digest, {})
    assert {one.sha256 for one in found.executions} == {found.recorded.sha256}
    assert sum(found.outcomes.values()) == 3
    assert all(spread.least == spread.most for spread in found.spreads)


def test_a_recording_that_somebody_changed_is_told(tmp_path):
    path, _ = recorded(tmp_path, sut=idle())
    with path.open("r+b") as file:
        # The library field of the MCAP header, of the same length.
        data = file.read()
        at = data.index(b"scenario")
        file.seek(at)
        file.write(b"Scenario")
    found = verify(path, 1, places=StatePaths(tmp_path))
    assert (found.same_bytes, found.all_executed) == (0, True)


def test_of_what_is_outside_the_spread_is_told(tmp_path, erratic):
    path, _ = recorded(tmp_path, sut=EXTERNAL)
    found = verify(path, 3, places=StatePaths(tmp_path))
    assert (found.repeatable, found.all_executed, found.sut) == (False, True, "theirs")
    spreads = {spread.name: spread for spread in found.spreads}
    assert {DURATION, PATH, "slow", "far"} <= set(spreads)
    for name in (DURATION, PATH, "far"):
        assert spreads[name].count == 4
        assert spreads[name].least <= found.recorded.values[name] <= spreads[name].most
    assert spreads[PATH].least < spreads[PATH].most
    assert (spreads[PATH].unit, spreads["slow"].unit) == ("m", "m/s")


def test_what_cannot_be_executed_says_why(tmp_path, erratic):
    path, _ = recorded(tmp_path, sut=EXTERNAL)

    def gone(*_, **__):
        raise ValueError("the stack is not installed here")

    found = verify(path, 1, places=StatePaths(tmp_path), execute_run=gone)
    assert not found.all_executed
    assert found.executions[0].problem == "ValueError: the stack is not installed here"
    assert sum(found.outcomes.values()) == 1


def test_a_process_that_dies_is_no_execution(tmp_path):
    import os

    path, _ = recorded(tmp_path, sut=idle())
    found = verify(path, 1, places=StatePaths(tmp_path), execute_run=lambda *_, **__: os._exit(3))
    assert "its process died" in found.executions[0].problem


def test_what_the_wall_clock_stopped_is_no_execution_whatever_its_note_says(tmp_path):
    path, _ = recorded(tmp_path, sut=idle())

    def execute_and_stop(*arguments, **rest):
        return replace(execute(*arguments, **rest), note="its time was up", stopped=True)

    found = verify(path, 1, places=StatePaths(tmp_path), execute_run=execute_and_stop)
    assert [one.problem for one in found.executions] == ["its time was up"]


def test_a_trace_of_another_engine_is_refused(tmp_path):
    path, _ = recorded(tmp_path, sut=idle(), engine="1")
    with pytest.raises(TraceError, match="is of engine 1, this is engine"):
        verify(path, 1, places=StatePaths(tmp_path))


@pytest.fixture
def plugged(tmp_path, monkeypatch):
    folder = tmp_path / "packages"
    folder.mkdir()
    install_plugins(folder, monkeypatch)
    yield
    sys.modules.pop(MODULE, None)


def plugin(kind):
    return SutReference(kind, kind, {})


@pytest.mark.parametrize("kind", ["random", "numpy-random"])
def test_what_nobody_has_seeded_is_nondeterminism_with_its_place(tmp_path, plugged, kind):
    path, _ = recorded(tmp_path, sut=plugin(kind), limit=3.0)
    found = verify(path, 2, places=StatePaths(tmp_path))
    assert (found.repeatable, found.same_bytes, found.nondeterministic) == (True, 0, True)
    where = found.first_difference
    assert where is not None
    assert (where.topic, where.time) == ("/cmd_vel", pytest.approx(1.0))


def test_what_draws_from_the_seed_of_its_briefing_leaves_the_same_bytes(tmp_path, plugged):
    path, _ = recorded(tmp_path, sut=plugin("seeded"), limit=3.0)
    found = verify(path, 2, places=StatePaths(tmp_path))
    assert (found.same_bytes, found.nondeterministic) == (2, False)
    assert found.first_difference is None


def test_a_specification_nobody_has_recorded_is_held_against_its_first_execution(tmp_path, plugged):
    places = StatePaths(tmp_path)
    same = verify_spec(spec(limit=3.0, sut=plugin("seeded")), WORLD, 2, places=places)
    assert (same.trace, len(same.executions), same.same_bytes) == ("", 1, 1)
    other = verify_spec(spec(limit=3.0, sut=plugin("random")), WORLD, 2, places=places)
    assert other.first_difference is not None
    assert other.first_difference.topic == "/cmd_vel"


@pytest.mark.parametrize("repeats", [1, 2, 3])
def test_a_specification_is_executed_as_often_as_asked_for(tmp_path, repeats):
    log = tmp_path / "log.txt"

    def execute_and_log(*arguments, **rest):
        with log.open("a") as file:
            file.write("executed\n")
        return execute(*arguments, **rest)

    run = spec(limit=1.0, sut=idle())
    found = verify_spec(
        run, WORLD, repeats, places=StatePaths(tmp_path), execute_run=execute_and_log
    )
    assert len(log.read_text().splitlines()) == repeats
    assert (len(found.executions), found.same_bytes) == (repeats - 1, repeats - 1)


def test_what_the_wall_clock_ends_is_no_execution(tmp_path, plugged):
    run = spec(limit=3.0, sut=plugin("hangs"))
    found = verify_spec(run, WORLD, 2, places=StatePaths(tmp_path), wall=1.0)
    assert (found.executions, found.all_executed) == ((), False)
    assert found.recorded.problem.startswith("stopped after 1 s of wall clock time")
