"""Finished runs are kept and delivered later, whatever the daemon does.

The workers are as on another machine: their folder is not the daemon's, results and traces travel.
"""

import random
import signal
from dataclasses import replace

import pytest

from daemon.model.attachments import attach_files
from daemon.model.spec import SutReference
from daemon.model.verbs import COMPLETE, GET, LEASE, PUT, RELEASE, RENEW
from daemon.model.verdicts import RunState
from grammars.text.files import matching_paths
from tests.make import make_spec, make_submission, submission_of
from tests.parts import daemon_at, eventually, executions, finished, free_endpoint, worker_for
from tests.turned_clock import end_leases

LARGE = 200_000
"""Bytes of a trace."""
FAILING = {"module": "tests.batch.failing_daemon"}


def spooled(folder):
    """Finished runs that wait below a folder."""
    return len(list(matching_paths(folder, "**/spool/*/*/attempt-*/result.json")))


def assert_executed_once(client, log, runs):
    """Every run has its result and its trace, and was executed once."""
    rows = client.runs("c").rows
    assert [(row.state, row.attempt, row.reason) for row in rows] == [(RunState.DONE, 1, "")] * runs
    assert all(row.trace for row in rows)
    assert len(executions(log)) == runs


# --- a daemon that fails at verbs


@pytest.fixture(scope="module")
def failing(tmp_path_factory):
    """Such a daemon, its client, and a worker that has none of its files."""
    folder = tmp_path_factory.mktemp("failing")
    (folder / "faults").mkdir()
    with (
        daemon_at(folder / "state", **FAILING) as daemon,
        daemon.client() as client,
        worker_for(daemon, 2, "--state", str(folder / "elsewhere")) as worker,
    ):
        yield daemon, client, worker


@pytest.fixture
def faults(failing):
    """Have the daemon fail at a verb from now on; ``None`` ends it."""
    daemon, client, _ = failing

    def fail(verb, kind):
        file = daemon.state.with_name("faults") / verb.name
        if kind is None:
            file.unlink()
        else:
            file.write_text(kind)

    yield fail
    eventually(lambda: not client.overview().troubles)
    for row in client.campaigns():
        client.delete((row.id,))


@pytest.mark.parametrize(
    ("verb", "fault"),
    [(COMPLETE, "malformed"), (COMPLETE, "garbles"), (PUT, "system")],
    ids=str,
)
def test_no_fault_of_the_daemon_costs_a_finished_run(failing, faults, tmp_path, verb, fault):
    log, (daemon, client, worker) = tmp_path / "log", failing
    faults(verb, fault)
    client.submit(make_submission("c", 3, size=LARGE, log=str(log)))
    eventually(lambda: "results cannot be delivered" in str(client.overview().troubles))
    assert "delivered later" in worker.output
    eventually(lambda: len(executions(log)) == spooled(daemon.state.parent) > 0)
    faults(verb, None)
    eventually(lambda: finished(client, 3))
    assert_executed_once(client, log, 3)
    eventually(lambda: not spooled(daemon.state.parent))


@pytest.mark.parametrize(("verb", "fault"), [(LEASE, "raises"), (RENEW, "garbles")], ids=str)
def test_results_are_delivered_although_other_verbs_fail(failing, faults, tmp_path, verb, fault):
    log, gate, (_, client, _) = tmp_path / "log", tmp_path / "gate", failing
    client.submit(make_submission("c", 3, size=LARGE, until=str(gate), log=str(log)))
    eventually(lambda: executions(log, 2))
    faults(verb, fault)
    client.submit(make_submission("d", 1, crash=[1]))
    gate.touch()
    eventually(lambda: client.overview().done >= 2)
    faults(verb, None)
    eventually(lambda: finished(client, 4))
    assert_executed_once(client, log, 3)


def test_a_run_given_back_in_vain_keeps_nothing_and_begins_again_when_its_lease_ends(
    failing, faults, tmp_path
):
    log, (daemon, client, worker) = tmp_path / "log", failing
    faults(RELEASE, "raises")
    client.submit(make_submission("d", 1, crash=[1]))
    eventually(lambda: "d.0: not given back" in worker.output)
    client.submit(make_submission("c", 3, size=LARGE, log=str(log)))
    eventually(lambda: client.campaign("c").finished)
    assert_executed_once(client, log, 3)
    faults(RELEASE, None)
    end_leases(daemon)
    eventually(lambda: finished(client, 4))


@pytest.mark.parametrize("fault", ["raises", "garbles"])
def test_no_run_is_blamed_for_a_scene_that_the_daemon_fails_to_send(failing, faults, fault):
    daemon, client, worker = failing
    for scene in matching_paths(daemon.state.with_name("elsewhere"), "work/*/scenes/*"):
        scene.unlink()
    faults(GET, fault)
    client.submit(make_submission("c", 2))
    eventually(lambda: "not started" in str(client.overview().troubles))
    faults(GET, None)
    eventually(lambda: finished(client, 2))
    assert [(row.state, row.reason) for row in client.runs("c").rows] == [(RunState.DONE, "")] * 2
    assert worker.process.poll() is None


def test_no_run_is_begun_twice_while_its_files_come(tmp_path, monkeypatch):
    """Each run waits for kernels, then for a file; leases come late, and renewals are due."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "faults").mkdir()
    (tmp_path / "faults" / LEASE.name).write_text("slow")
    log, specs = tmp_path / "log", []
    for number in range(3):
        (tmp_path / f"file-{number}").write_bytes(random.Random(number).randbytes(300_000))
        attached = attach_files({"model": tmp_path / f"file-{number}"})
        parameters = {"reads": "model", "log": str(log)}
        sut = SutReference(f"sut-{number}", "learned", parameters, attached)
        specs.append(replace(make_spec(number), sut=sut))
    with daemon_at(tmp_path / "state", **FAILING) as daemon, daemon.client() as client:
        client.submit(submission_of("c", *specs))
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "other"))
        options = ("--state", str(tmp_path / "elsewhere"))
        with worker_for(daemon, 2, *options, module="tests.batch.hesitant_worker") as worker:
            eventually(lambda: finished(client, 3) or worker.process.poll() is not None)
            assert worker.process.poll() is None, worker.output
            assert "not started" not in worker.output
        assert_executed_once(client, log, 3)


# --- another ledger answers at the daemon's address: what belongs to the first one waits for it


def test_finished_runs_wait_until_their_own_ledger_answers_again(tmp_path):
    """One run has ended before another ledger answers, and one ends then."""
    endpoint, log, elsewhere = free_endpoint(), tmp_path / "log", tmp_path / "elsewhere"
    gates = [tmp_path / f"gate-{number}" for number in range(2)]
    specs = [make_spec(n, until=str(gate), log=str(log)) for n, gate in enumerate(gates)]
    with (
        daemon_at(tmp_path / "first", listen=endpoint) as first,
        worker_for(first, 2, "--state", str(elsewhere)) as worker,
    ):
        with first.client() as client:
            client.submit(submission_of("c", *specs))
            eventually(lambda: executions(log, 2))
            first.freeze()
            gates[0].touch()
            eventually(lambda: spooled(elsewhere) == 1)
        first.kill()
        with daemon_at(tmp_path / "second", listen=endpoint) as second:
            eventually(lambda: "keeps another ledger" in worker.output)
            gates[1].touch()
            eventually(lambda: spooled(elsewhere) == 2)
            with second.client() as other:
                other.submit(make_submission("d", 2))
                # The same worker executes what the second daemon has.
                eventually(lambda: finished(other, 2))
            second.signal(signal.SIGTERM)
            second.wait()
        first.restart()
        with first.client() as again:
            eventually(lambda: finished(again, 2))
            assert_executed_once(again, log, 2)
        eventually(lambda: spooled(elsewhere) == 0)
        assert worker.process.poll() is None
