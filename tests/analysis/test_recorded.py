"""Folders of traces: a source that answers as a daemon does, and runs that are judged again."""

import hashlib
import shutil
from contextlib import nullcontext
from dataclasses import replace

import pytest

from daemon.analysis.recorded import read_traces
from daemon.analysis.rejudge import rejudge
from daemon.batch.errors import Refused
from daemon.batch.ledger import LedgerWriter, connect
from daemon.batch.paths import StatePaths
from daemon.model.ids import trace_name
from daemon.model.messages import Completion
from daemon.model.spec import OracleText
from daemon.model.submission import Submission
from daemon.model.verdicts import Outcome
from daemon.trace import TraceWriter
from grammars.model.geometry import Pose2, Twist2
from tests.analysis import old_runs
from tests.analysis.old_runs import SLOW, THERE, WORLD, drive
from tests.analysis.report.recordings import NAME, OPEN, SHUT, SUTS, record, spec
from tests.make import make_result

RUNS = [(OPEN, SUTS[0]), (SHUT, SUTS[0]), (OPEN, SUTS[1])]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("traces")
    for number, (scenario, sut) in enumerate(RUNS):
        record(folder / f"{number}.mcap", spec(scenario, sut, 0))
    return str(folder)


@pytest.fixture
def works():
    """Works that were shown, as (unit, total)."""
    return []


@pytest.fixture
def source(folder, works):
    def progress(_, total, unit):
        works.append((unit, total))
        return nullcontext(lambda _: None)

    return read_traces(folder, progress=progress)


def test_its_campaign_is_called_as_it_was_typed(source, folder):
    (row,) = source.campaigns()
    assert (row.id, row.name, row.total, row.finished) == (folder, NAME, 3, True)
    assert source.campaign(folder) == row
    assert source.campaign_page(beginning="other") == source.campaign_page(offset=1) == ()
    assert source.searches() == ()
    with pytest.raises(Refused, match=r"there is no run 9.mcap in "):
        source.run("9.mcap")


def test_pages_of_runs_are_filtered_and_sorted(source):
    ids = [row.id for row in source.all_runs("")]
    failed = {row.id for row in source.all_runs("") if row.outcome is Outcome.FAIL}
    first, second = source.runs("", limit=2), source.runs("", offset=2, limit=2)
    assert [row.id for row in (*first.rows, *second.rows)] == ids
    assert (first.total, second.total) == (3, 3)
    for query, expected in (
        ({"sut": SUTS[1]}, ids[2:]),
        ({"text": "2.MCAP"}, ids[2:]),
        ({"sort": "id", "descending": True}, ids[::-1]),
    ):
        assert [row.id for row in source.runs("", **query).rows] == expected
    assert {row.id for row in source.runs("", outcome="fail").rows} == failed != set()


def test_traces_of_a_run_that_goes_on_do_not_count_beside_earlier_ones(folder, tmp_path):
    going_on = tmp_path / ".scenario-1" / "traces"
    shutil.copytree(folder, going_on)
    assert len(read_traces(str(tmp_path)).rows) == 3
    shutil.copy(going_on / "0.mcap", tmp_path)
    assert [row.id for row in read_traces(str(tmp_path)).rows] == [str(tmp_path / "0.mcap")]


def test_runs_are_judged_once_and_only_when_they_are_asked_for(source, works, folder):
    assert source.declared(folder)
    assert source.campaigns()
    assert works == []
    assert source.run(f"{folder}/1.mcap").row.result is not None
    assert [row.margin is not None for row in source.all_runs("")] == [True] * 3
    source.all_runs("", results=True)
    assert works == [("traces", 1), ("traces", 2)]
    unjudged = read_traces(folder).all_runs(folder, results=True)
    assert [(row.outcome, row.result) for row in unjudged] == [(None, None)] * 3


@pytest.fixture
def places(tmp_path):
    made = StatePaths(tmp_path / "state")
    made.make_folders()
    return made


@pytest.fixture
def path(tmp_path):
    """The trace of a run that was judged when it was recorded."""
    return drive(tmp_path / "traces" / "run.mcap", old_runs.spec())


def changes_of(found):
    return [(change.oracle, change.kind) for change in found.changes]


@pytest.mark.parametrize(
    ("oracles", "outcome", "changes"),
    [
        (
            (
                OracleText("far", "final(path.length) >= 0.5 m"),
                OracleText("slow", "max(speed) <= 0.4 m/s"),
            ),
            Outcome.FAIL,
            [("slow", "verdict"), ("far", "new"), ("there", "dropped")],
        ),
        ((OracleText("slow", "max(speed) <= 0.7 m/s"), THERE), Outcome.PASS, [("slow", "margin")]),
    ],
)
def test_other_oracles_change_verdicts_and_no_file(path, places, oracles, outcome, changes):
    before = hashlib.sha256(path.read_bytes()).digest()
    path.chmod(0o400)
    (found,) = rejudge([path], oracles, places=places)
    assert (found.outcome_before, found.outcome) == (Outcome.PASS, outcome)
    assert changes_of(found) == changes
    assert hashlib.sha256(path.read_bytes()).digest() == before
    assert [file.name for file in path.parent.iterdir()] == ["run.mcap"]


def test_a_trace_that_was_cut_is_judged_as_far_as_it_goes(path, places):
    path.write_bytes(path.read_bytes()[:-100])
    (found,) = rejudge([path], (SLOW, OracleText("s", "max(speed) <= 0.1 m/s")), places=places)
    assert [v.outcome for v in found.verdicts] == [Outcome.INCONCLUSIVE, Outcome.FAIL]


def test_a_run_that_goes_on_can_be_judged(tmp_path, places):
    path = tmp_path / "run.mcap"
    oracles = (SLOW, OracleText("far", "eventually(path.length >= 3 m)"))
    with TraceWriter(path, old_runs.spec(), WORLD) as trace:
        for step in range(240):
            trace.ground_truth(step * 0.05, Pose2(10.0 + step * 0.02, 1.0), Twist2(0.4, 0.0, 0.0))
        (found,) = rejudge([path.with_name("run.mcap.partial")], oracles, places=places)
        trace.close("finished", "")
    assert [v.outcome for v in found.verdicts] == [Outcome.INCONCLUSIVE, Outcome.PASS]
    assert found.outcome is Outcome.INCONCLUSIVE


@pytest.fixture
def stored(places):
    """The trace of a run of which the ledger says that it failed."""
    run = old_runs.spec()
    connection = connect(places.ledger)
    book = LedgerWriter(connection)
    book.submit(Submission.of("c", (run,), (WORLD,)), 1.0)
    (grant,) = book.lease("w", 1, 1.0)
    result = make_result(run, outcome=Outcome.FAIL, margin=-0.4)
    verdict = replace(result.verdicts[0], oracle="slow", text="max(speed) <= 0.1 m/s")
    result = replace(result, verdicts=(verdict,))
    book.complete(Completion("w", grant.run, grant.attempt, grant.token, result), 2.0)
    connection.close()
    return drive(places.trace(trace_name("c", "S1", "pilot", 0)), run)


def test_the_ledger_knows_the_verdicts_of_before(stored, places):
    (found,) = rejudge([stored], None, places=places)
    outcomes = found.outcome_before, found.outcome
    assert (found.origin, *outcomes) == ("ledger", Outcome.FAIL, Outcome.PASS)
    assert changes_of(found) == [("slow", "verdict"), ("there", "new")]
    # It is silent about another run in its place.
    stored.unlink()
    drive(stored, replace(old_runs.spec(), seed=8))
    (found,) = rejudge([stored], None, places=places)
    assert (found.origin, found.outcome_before) == ("trace", Outcome.PASS)


def test_a_ledger_that_cannot_be_read_changes_nothing(stored, places):
    places.ledger.write_bytes(b"this is no database" * 100)
    (found,) = rejudge([stored], None, places=places)
    assert (found.origin, found.outcome) == ("trace", Outcome.PASS)
