"""Traces that the words of a command name: files, folders, ids of campaigns and runs."""

from pathlib import Path

import pytest

from daemon.batch.errors import Refused
from daemon.batch.ledger import LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.model.messages import Completion
from daemon.model.submission import Submission
from scenario_tui.source import DaemonTarget, all_traces, one_trace
from tests.analysis.report.recordings import OPEN, SHUT, SUTS, spec
from tests.engine.judging.traces import CORRIDOR
from tests.make import make_result
from tests.people.recorded import campaign_at


@pytest.fixture
def places(tmp_path, monkeypatch):
    """A state directory with two runs of a campaign that have traces."""
    monkeypatch.delenv("SCENARIO_CONNECT", raising=False)
    monkeypatch.chdir(tmp_path)
    places = StatePaths(tmp_path / "state")
    campaign_at(places)
    return places


def named(places, *names):
    return all_traces(names, DaemonTarget(state=places.state))


def test_ids_and_names_of_campaigns_and_runs_mean_their_traces(places):
    traces = sorted(places.traces.rglob("*.mcap"), key=lambda trace: SHUT not in trace.name)
    assert list(named(places, "corr")) == list(named(places, "corr-1")) == traces
    assert list(named(places, "corr.1", "corr")) == traces[::-1]
    assert one_trace("corr-1.0", DaemonTarget(state=places.state)) == traces[0]


def test_traces_of_results_that_were_used_again_lie_with_their_campaign(places):
    specs = (spec(SHUT, SUTS[0], 0), spec(OPEN, SUTS[0], 0), spec(OPEN, SUTS[1], 0))
    with LedgerWriter.open(places) as ledger:
        ledger.submit(Submission.of("d-1", specs, (CORRIDOR,)), 3.0)
    assert named(places, "d-1") == named(places, "corr-1")


def test_one_repeat_of_each_cell_is_enough_for_some(places):
    specs = tuple(spec(SHUT, SUTS[0], repeat) for repeat in range(2))
    with LedgerWriter.open(places) as ledger:
        ledger.submit(Submission.of("e-1", specs, (CORRIDOR,)), 3.0)
        for grant in ledger.lease("w", 9, 4.0):
            path = places.trace(grant.trace)
            path.parent.mkdir(exist_ok=True)
            path.touch()
            result = make_result(grant.spec)
            ledger.complete(Completion("w", grant.run, grant.attempt, grant.token, result), 5.0)
    traces = named(places, "e-1")
    target = DaemonTarget(state=places.state)
    assert len(traces) == 2
    assert all_traces(["e-1"], target, one_of_cell=True) == traces[:1]


def test_files_and_folders_are_named_once_each_and_in_order(places):
    for name in ("b/2.mcap", "b/1.mcap", "a.mcap", "b/note.txt"):
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_bytes(b"\x89MCAP0\r\n")
    found = named(places, "b", "a.mcap", "b/1.mcap")
    assert [path.name for path in found] == ["1.mcap", "2.mcap", "a.mcap"]


def test_without_a_ledger_only_files_and_folders_are_known(tmp_path, monkeypatch):
    monkeypatch.delenv("SCENARIO_CONNECT", raising=False)
    places = StatePaths(tmp_path / "state")
    (tmp_path / "empty").mkdir()
    for name, message in (("c", "no campaign or run in"), (str(tmp_path / "empty"), "no traces")):
        with pytest.raises(Refused, match=message):
            named(places, name)
