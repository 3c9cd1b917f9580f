"""Another ledger answers at the daemon's address: what belongs to the first one waits for it."""

import shutil
import signal

import pytest

from daemon.batch.errors import OtherLedger
from daemon.batch.ledger import LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.model.run_state import RunState
from grammars.text.files import matching_paths
from tests.make import make_submission
from tests.parts import daemon_at, eventually, finished, free_endpoint, worker_for


def executions(log):
    return len(log.read_text().splitlines()) if log.exists() else 0


def spooled(folder):
    """Finished runs that wait below a folder."""
    return len(list(matching_paths(folder, "**/spool/*/*/attempt-*/result.json")))


def finish_unheard(daemon, client, log, gate):
    """Let two runs end while the daemon cannot hear of it."""
    client.submit(make_submission("c", 2, until=str(gate), log=str(log)))
    eventually(lambda: executions(log) == 2)
    daemon.freeze()
    gate.touch()


def assert_executed_once(client, log):
    rows = client.runs("c").rows
    assert [(row.state, row.attempt, row.reason) for row in rows] == [(RunState.DONE, 1, "")] * 2
    assert executions(log) == 2


def test_finished_runs_wait_until_their_own_ledger_answers_again(tmp_path):
    endpoint, log, gate = free_endpoint(), tmp_path / "log", tmp_path / "gate"
    elsewhere = tmp_path / "elsewhere"
    with daemon_at(tmp_path / "first", listen=endpoint) as first:
        client = first.client()
        with worker_for(first, 2, "--state", str(elsewhere)) as worker:
            finish_unheard(first, client, log, gate)
            eventually(lambda: spooled(elsewhere) == 2)
            client.close()
            first.kill()
            with daemon_at(tmp_path / "second", listen=endpoint) as second:
                with second.client() as other:
                    other.submit(make_submission("d", 2))
                    # The same worker executes what the second daemon has.
                    eventually(lambda: finished(other, 2))
                assert spooled(elsewhere) == 2
                assert "keeps another ledger" in worker.output
                second.signal(signal.SIGTERM)
                second.wait()
            first.restart()
            with first.client() as again:
                eventually(lambda: finished(again, 2))
                assert_executed_once(again, log)
            eventually(lambda: spooled(elsewhere) == 0)
            assert worker.process.poll() is None


def test_a_run_under_way_ends_and_waits_as_well(tmp_path):
    endpoint, log, gate = free_endpoint(), tmp_path / "log", tmp_path / "gate"
    elsewhere = tmp_path / "elsewhere"
    with daemon_at(tmp_path / "first", listen=endpoint, lease=30.0) as first:
        client = first.client()
        with worker_for(first, 2, "--state", str(elsewhere)) as worker:
            client.submit(make_submission("c", 2, until=str(gate), log=str(log)))
            eventually(lambda: executions(log) == 2)
            client.close()
            first.kill()
            with daemon_at(tmp_path / "second", listen=endpoint) as second:
                eventually(lambda: "keeps another ledger" in worker.output)
                gate.touch()
                eventually(lambda: spooled(elsewhere) == 2)
                second.signal(signal.SIGTERM)
                second.wait()
            first.restart()
            with first.client() as again:
                eventually(lambda: finished(again, 2))
                assert_executed_once(again, log)


def test_a_restored_copy_does_not_take_the_results_of_what_came_after_it(tmp_path):
    state, copy = tmp_path / "state", tmp_path / "copy.db"
    log, gate = tmp_path / "log", tmp_path / "gate"
    with daemon_at(state) as daemon, daemon.client() as client:
        client.submit(make_submission("before", 1))
    shutil.copy(state / "ledger.db", copy)
    with daemon_at(state) as daemon:
        client = daemon.client()
        with worker_for(daemon, 2) as worker:
            client.cancel("before")
            finish_unheard(daemon, client, log, gate)
            eventually(lambda: spooled(tmp_path) == 2)
            worker.kill()
        client.close()
        daemon.kill()
    later = tmp_path / "later.db"
    (state / "ledger.db").rename(later)
    leave_wal(state, later)
    shutil.copy(copy, state / "ledger.db")
    with daemon_at(state) as daemon, daemon.client() as client, worker_for(daemon, 1):
        eventually(lambda: finished(client, 1))
        eventually(lambda: "2 finished runs wait" in str(client.overview().troubles))
        assert client.overview().trouble == ""
        eventually(lambda: spooled(tmp_path) == 2)
    for path in state.glob("ledger.db*"):
        path.unlink()
    later.rename(state / "ledger.db")
    leave_wal(tmp_path, state / "ledger.db", of="later.db")
    with daemon_at(state) as daemon, daemon.client() as client, worker_for(daemon, 1):
        eventually(lambda: finished(client, 3))
        assert_executed_once(client, log)


def leave_wal(folder, ledger, of="ledger.db"):
    """Take what is not in the ledger yet along with it."""
    for end in ("-wal", "-shm"):
        if (folder / f"{of}{end}").exists():
            (folder / f"{of}{end}").rename(ledger.with_name(f"{ledger.name}{end}"))


def test_a_ledger_knows_its_eras_and_a_copy_those_before_it(tmp_path):
    paths = StatePaths(tmp_path)
    with LedgerWriter.open(paths) as ledger:
        ledger.submit(make_submission("c", 3), 0.0)
        first = ledger.begin_era()
        (early,) = ledger.lease("w", 1, 0.0)
    shutil.copytree(tmp_path, tmp_path / "copy")
    with LedgerWriter.open(paths) as ledger:
        second = ledger.begin_era()
        (late,) = ledger.lease("w", 1, 0.0)
        assert (early.era, late.era) == (first, second)
        ledger.require_era(first, early.token)
        ledger.require_era(second, late.token)
        for era in ("", "0" * 16):
            with pytest.raises(OtherLedger):
                ledger.require_era(era)
    with LedgerWriter.open(StatePaths(tmp_path / "copy")) as copy:
        copy.require_era(first, early.token)
        copy.begin_era()
        with pytest.raises(OtherLedger):
            copy.require_era(second)
        # Granted in the era of the copy, after the copy was made.
        with pytest.raises(OtherLedger):
            copy.require_era(first, late.token)
