"""Judging recorded runs again: what differs is said, the traces stay as they are."""

import hashlib
from dataclasses import replace

import pytest

from daemon.analysis.rejudge import rejudge
from daemon.batch.ledger import LedgerWriter, connect
from daemon.batch.paths import StatePaths
from daemon.model.ids import trace_name
from daemon.model.messages import Completion
from daemon.model.spec import OracleText, RunResult, Timing, TraceInfo
from daemon.model.submission import Submission
from daemon.model.verdicts import Outcome, Verdict
from daemon.trace import TraceWriter
from grammars.model.geometry import Pose2, Twist2
from tests.analysis.old_runs import SLOW, THERE, WORLD, drive, spec


def judged(traces, written, state):
    return tuple(rejudge(traces, written, places=StatePaths(state)))


def test_the_same_oracles_say_the_same(tmp_path):
    path = drive(tmp_path / "run.mcap", spec())
    (found,) = judged([path], None, tmp_path)
    assert found.outcome is found.outcome_before is Outcome.PASS
    assert found.verdicts == found.before
    assert (found.changes, found.origin, found.run) == ((), "trace", "S1/pilot/0")


def test_other_oracles_and_what_they_change(tmp_path):
    path = drive(tmp_path / "run.mcap", spec())
    before = hashlib.sha256(path.read_bytes()).digest()
    path.chmod(0o400)
    asked = (
        OracleText("far", "final(path.length) >= 0.5 m"),
        OracleText("slow", "max(speed) <= 0.4 m/s"),
    )
    (found,) = judged([path], asked, tmp_path)
    assert (found.outcome_before, found.outcome) == (Outcome.PASS, Outcome.FAIL)
    changes = [(change.oracle, change.kind) for change in found.changes]
    assert changes == [("slow", "verdict"), ("far", "new"), ("there", "dropped")]
    assert hashlib.sha256(path.read_bytes()).digest() == before
    assert [file.name for file in tmp_path.iterdir()] == ["run.mcap"]


def test_a_margin_may_change_alone(tmp_path):
    path = drive(tmp_path / "run.mcap", spec())
    asked = (OracleText("slow", "max(speed) <= 0.7 m/s"), THERE)
    (found,) = judged([path], asked, tmp_path)
    assert [(change.oracle, change.kind) for change in found.changes] == [("slow", "margin")]


def test_many_traces_over_processes_come_in_order(tmp_path):
    traces = [drive(tmp_path / f"{i:02}.mcap", spec(i), 0.5 + 0.02 * i) for i in range(12)]
    alone = tuple(rejudge(traces, None, places=StatePaths(tmp_path), processes=1))
    spread = tuple(rejudge(traces, None, places=StatePaths(tmp_path), processes=2))
    assert spread == alone
    assert [one.run for one in spread] == [f"S1/pilot/{i}" for i in range(12)]
    assert {one.outcome for one in spread} == {Outcome.PASS, Outcome.FAIL}


def test_a_trace_that_is_none_does_not_stop_the_others(tmp_path):
    path = drive(tmp_path / "run.mcap", spec())
    (tmp_path / "junk.mcap").write_bytes(b"junk")
    junk, found = judged([tmp_path / "junk.mcap", path], None, tmp_path)
    assert (junk.outcome, junk.problem) == (Outcome.ERROR, "is not an MCAP file")
    assert found.outcome is Outcome.PASS


def test_a_trace_that_was_cut_is_judged_as_far_as_it_goes(tmp_path):
    path = drive(tmp_path / "run.mcap", spec())
    path.write_bytes(path.read_bytes()[:-100])
    (found,) = judged([path], (SLOW, OracleText("s", "max(speed) <= 0.1 m/s")), tmp_path)
    assert [v.outcome for v in found.verdicts] == [Outcome.INCONCLUSIVE, Outcome.FAIL]


def test_a_run_that_goes_on_can_be_judged(tmp_path):
    path = tmp_path / "run.mcap"
    with TraceWriter(path, spec(), WORLD) as trace:
        for step in range(240):
            trace.ground_truth(step * 0.05, Pose2(10.0 + step * 0.02, 1.0), Twist2(0.4, 0.0, 0.0))
        asked = (SLOW, OracleText("far", "eventually(path.length >= 3 m)"))
        (found,) = judged([path.with_name("run.mcap.partial")], asked, tmp_path)
        assert [v.outcome for v in found.verdicts] == [Outcome.INCONCLUSIVE, Outcome.PASS]
        assert found.outcome is Outcome.INCONCLUSIVE
        trace.close("finished", "")


@pytest.fixture
def kept(tmp_path):
    """A state directory whose ledger says that its one run failed, and its trace."""
    places = StatePaths(tmp_path / "state")
    places.make_folders()
    run = spec()
    connection = connect(places.ledger)
    book = LedgerWriter(connection)
    book.submit(Submission.of("c", (run,), (WORLD,)), 1.0)
    (grant,) = book.lease("w", 1, 1.0)
    verdict = Verdict("slow", "max(speed) <= 0.1 m/s", Outcome.FAIL, -0.4, -0.4, "m/s")
    result = RunResult(
        run.digest, Outcome.FAIL, (verdict,), "finished",
        TraceInfo("0" * 64, 1, 1), Timing(1.0, 1.0, 2.0),
    )  # fmt: skip
    book.complete(Completion("w", grant.run, grant.attempt, grant.token, result), 2.0)
    connection.close()
    return places, drive(places.trace(trace_name("c", "S1", "pilot", 0)), run)


def test_the_ledger_knows_what_was_judged_before(kept):
    places, path = kept
    (found,) = rejudge([path], None, places=places)
    assert (found.origin, found.outcome_before, found.outcome) == (
        "ledger", Outcome.FAIL, Outcome.PASS,
    )  # fmt: skip
    assert [(c.oracle, c.kind) for c in found.changes] == [("slow", "verdict"), ("there", "new")]


def test_the_ledger_is_silent_about_another_run_in_its_place(kept):
    places, path = kept
    path.unlink()
    drive(path, replace(spec(), seed=8))
    (found,) = rejudge([path], None, places=places)
    assert (found.origin, found.outcome_before) == ("trace", Outcome.PASS)


def test_a_ledger_that_cannot_be_read_changes_nothing(tmp_path):
    places = StatePaths(tmp_path)
    places.make_folders()
    places.ledger.write_bytes(b"this is no database" * 100)
    path = drive(places.traces / "c" / "S1.pilot.0.mcap", spec())
    (found,) = rejudge([path], None, places=places)
    assert (found.origin, found.outcome) == ("trace", Outcome.PASS)
