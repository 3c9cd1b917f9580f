import hashlib
import os
import signal
import sqlite3
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import psutil
import pytest

from daemon.batch import bus
from daemon.batch.errors import Refused
from daemon.model import verbs
from daemon.model.messages import LeaseRequest, WorkerInfo
from daemon.model.run_state import RunState
from daemon.model.spec import SutReference
from daemon.model.status import Trouble, TroubleCause
from daemon.model.verdicts import Outcome
from grammars.text.files import matching_paths
from tests.chaos.disk import fill, may_mount, small_disk
from tests.make import make_spec, make_submission, submission_of
from tests.parts import (
    Part,
    alive,
    daemon_at,
    eventually,
    family,
    finished,
    worker_for,
)


@pytest.fixture(scope="module")
def daemon(tmp_path_factory):
    """A daemon with a local worker of two slots that most tests share; renewals take for ever."""
    with daemon_at(tmp_path_factory.mktemp("worker") / "state", 2) as part:
        yield part


@pytest.fixture
def client(daemon):
    with daemon.client() as connected:
        yield connected


def done(client, campaign):
    return next(row.finished for row in client.campaigns() if row.id == campaign)


def test_runs_come_back_with_results_and_traces(client):
    client.submit(make_submission("plain", 6, outcome="fail"))
    eventually(lambda: done(client, "plain"))
    for row in client.runs("plain").rows:
        assert (row.state, row.outcome, row.attempt) == (RunState.DONE, Outcome.FAIL, 1)
        result = client.run(row.id).row.result
        assert result is not None
        assert hashlib.sha256(Path(row.trace).read_bytes()).hexdigest() == result.trace.sha256


def test_every_run_has_a_fresh_and_nice_process(client, tmp_path):
    log = tmp_path / "log"
    client.submit(make_submission("fresh", 8, log=str(log)))
    eventually(lambda: done(client, "fresh"))
    lines = [line.split() for line in log.read_text().splitlines()]
    assert sorted(int(repeat) for repeat, _, _ in lines) == list(range(8))
    assert len({pid for _, pid, _ in lines}) == 8
    assert all(int(nice) >= 10 for _, _, nice in lines)


def test_a_crashing_run_is_tried_again(client):
    client.submit(make_submission("crash", 1, crash=[1, 2]))
    eventually(lambda: done(client, "crash"))
    (row,) = client.runs("crash").rows
    assert (row.state, row.attempt, row.reason) == (RunState.DONE, 3, "")


def test_a_run_that_always_crashes_is_lost_and_harms_no_other(client):
    poison = make_spec(0, crash=[1, 2, 3])
    client.submit(submission_of("poison", poison, *(make_spec(i) for i in range(1, 6))))
    eventually(lambda: done(client, "poison"))
    lost, *others = client.runs("poison").rows
    assert (lost.state, lost.attempt, lost.outcome) == (RunState.LOST, 3, None)
    assert "SIGKILL" in lost.reason
    assert [(row.state, row.attempt) for row in others] == [(RunState.DONE, 1)] * 5


def test_a_native_crash_tells_where_it_was_and_what_it_said(client):
    client.submit(make_submission("abort", 1, abort="planning a way"))
    eventually(lambda: done(client, "abort"))
    (row,) = client.runs("abort").rows
    assert row.state is RunState.LOST
    assert row.reason.startswith("planning a way")
    assert row.reason.endswith("the run's process was killed by SIGABRT")
    assert "fake_run.py" in row.reason


def test_what_a_run_prints_is_bounded_and_its_last_words_are_told(client, daemon):
    client.submit(make_submission("loud", 1, prints=5, abort="out of luck"))
    eventually(lambda: done(client, "loud"))
    (row,) = client.runs("loud").rows
    assert row.state is RunState.LOST
    assert "\nout of luck\nFatal Python error: Aborted" in row.reason
    assert len(row.reason) < 10_000


def test_results_are_bounded_where_they_are_made(client):
    large = {"evidence": 2**21}, {"verdicts": 5000, "outcome": "fail"}
    specs = [make_spec(number, **what) for number, what in enumerate(large)]
    client.submit(submission_of("large", *specs))
    eventually(lambda: done(client, "large"))
    cut, lost = (client.run(f"large.{number}") for number in range(2))
    assert cut.row.result is not None
    assert (cut.row.outcome, len(cut.row.result.verdicts)) == (Outcome.PASS, 1)
    assert "notes were cut" in cut.row.result.note
    assert lost.row.result is not None
    assert (lost.row.outcome, lost.row.result.verdicts) == (Outcome.ERROR, ())
    assert "5000 verdicts were left out" in lost.row.result.note


def test_an_exception_is_never_a_verdict(client):
    client.submit(make_submission("raises", 1, **{"raise": "no such door"}))
    eventually(lambda: done(client, "raises"))
    (row,) = client.runs("raises").rows
    assert row.state is RunState.LOST
    assert "RuntimeError: no such door" in row.reason
    assert client.run(row.id).row.result is None


def test_a_run_whose_system_is_not_installed_waits_for_another_worker(client, daemon):
    absent = [replace(make_spec(i), sut=SutReference("mine", "absent", {})) for i in range(3)]
    client.submit(submission_of("absent", *absent, *(make_spec(i) for i in range(4))))
    eventually(lambda: client.overview().queued == 3 and not client.overview().running)
    rows = client.runs("absent").rows
    assert [row.state for row in rows[3:]] == [RunState.DONE] * 4
    assert [row.state for row in rows[:3]] == [RunState.QUEUED] * 3
    attempts = [row.attempt for row in rows[:3]]  # what was leased ahead, and then no more
    assert max(attempts) == 1
    assert 'install what brings the system under test "absent" for worker' in rows[0].reason
    with sqlite3.connect(daemon.state / "ledger.db") as ledger:
        assert ledger.execute("SELECT max(strikes) FROM run WHERE kind = 'absent'").fetchone() == (
            0,
        )
    ledger.close()
    assert client.cancel("absent") == 3


def test_a_run_that_eats_memory_is_stopped(client):
    client.submit(make_submission("memory", 1, allocate=8 * 1024))
    eventually(lambda: done(client, "memory"))
    (row,) = client.runs("memory").rows
    assert row.state is RunState.LOST
    assert "MemoryError" in row.reason


def test_cancelling_stops_the_processes_at_once(client, daemon, tmp_path):
    log = tmp_path / "log"
    client.submit(make_submission("cancel", 6, sleep=600.0, log=str(log)))
    eventually(lambda: log.exists() and len(log.read_text().splitlines()) == 2)
    running = [psutil.Process(int(line.split()[1])) for line in log.read_text().splitlines()]
    assert client.cancel("cancel") == 6
    eventually(lambda: not alive(running))  # the next renewal is ten minutes away
    assert {row.state for row in client.runs("cancel").rows} == {RunState.CANCELLED}
    client.submit(make_submission("next", 1))
    eventually(lambda: done(client, "next"))


def test_running_runs_are_seen_live(client):
    seen = []

    def times():
        return [live.snapshot.time for live in seen if live.run == "live.0"]

    with client.events(lambda _: None, seen.append):
        client.submit(make_submission("live", 1, sleep=600.0))
        eventually(lambda: len(times()) >= 5)
        client.cancel("live")
    found = times()
    assert found == sorted(found)
    # Five in a second at most, in the time of the run, however slowly it goes.
    assert len(found) <= (found[-1] - found[0]) / 0.2 + 2


def test_a_repetition_confirms_the_result_or_raises_an_alarm(client):
    client.submit(make_submission("same", 1))
    client.submit(make_submission("noisy", 1, noise=1))
    eventually(lambda: done(client, "same") and done(client, "noisy"))
    before = [client.run(name).row.result for name in ("same.0", "noisy.0")]
    events = []
    with client.events(lambda event: events.append(f"{event.kind} {event.id}")):
        client.retry("same", only="pass")
        client.retry("noisy", only="pass")
        eventually(lambda: done(client, "same") and done(client, "noisy"))
        eventually(lambda: "alarm noisy.0" in events)
    assert "alarm same.0" not in events
    assert [client.run(name).row.result for name in ("same.0", "noisy.0")] == before
    assert client.run("same.0").row.attempt == 2
    assert "nondeterministic" in client.run("noisy.0").row.reason
    kept = before[1]
    assert kept is not None
    trace = Path(client.run("noisy.0").row.trace).read_bytes()
    assert hashlib.sha256(trace).hexdigest() == kept.trace.sha256


def test_the_spool_is_empty_when_nothing_runs(client, daemon):
    eventually(lambda: client.overview().running == 0)
    eventually(lambda: not list(matching_paths(daemon.state / "spool", "*/*/attempt-*")))


def test_the_worker_is_on_the_list(client):
    # What it was busy with in another test it may not have taken back yet.
    eventually(lambda: [row.busy for row in client.workers()] == [0])
    (row,) = client.workers()
    assert row.slots == 2
    assert psutil.pid_exists(row.pid)
    assert client.overview().workers == 1


def test_a_worker_tells_what_it_takes_of_its_machine_and_which_runs_it_executes(client):
    client.submit(make_submission("held", 3, sleep=600.0))
    (row,) = eventually(lambda: [row for row in client.workers() if len(row.runs) == 2])
    assert row.runs == ("held.0", "held.1")
    assert 2**20 < row.memory < row.memory_total == psutil.virtual_memory().total
    assert 0.0 <= row.cpu <= 1.0
    client.cancel("held")
    eventually(lambda: client.workers()[0].runs == ())


def test_the_wall_clock_limit_stops_a_run(tmp_path):
    settings = {"wall": 0.3, "attempts": 1}
    with daemon_at(tmp_path / "state", 1, **settings) as daemon, daemon.client() as client:
        client.submit(make_submission("slow", 1, sleep=600.0))
        eventually(lambda: done(client, "slow"))
        (row,) = client.runs("slow").rows
        assert row.state is RunState.LOST
        assert "stopped after 0.3 s of wall clock time" in row.reason


def begun(log):
    """How many executions have begun."""
    return len(log.read_text().splitlines()) if log.exists() else 0


def test_a_worker_told_to_leave_finishes_first(tmp_path):
    gate, log = tmp_path / "gate", tmp_path / "log"
    with (
        daemon_at(tmp_path / "state") as daemon,
        daemon.client() as client,
        worker_for(daemon, 2) as worker,
    ):
        client.submit(make_submission("c", 4, until=str(gate), log=str(log)))
        eventually(lambda: begun(log) == 2)  # what is only leased it gives back
        worker.signal(signal.SIGTERM)
        gate.touch()
        assert worker.wait() == 0
        now = client.overview()
        assert (now.done, now.queued, now.running) == (2, 2, 0)
        eventually(lambda: client.overview().workers == 0)


def test_a_worker_told_twice_gives_its_runs_back_without_blame(tmp_path):
    with daemon_at(tmp_path / "state", attempts=1) as daemon, daemon.client() as client:
        with worker_for(daemon, 2) as worker:
            log = tmp_path / "log"
            client.submit(make_submission("c", 3, sleep=600.0, log=str(log)))
            eventually(lambda: begun(log) == 2)
            members = family(worker.pid)
            worker.signal(signal.SIGTERM)
            worker.signal(signal.SIGTERM)
            worker.signal(signal.SIGQUIT)
            assert worker.wait() == 0
            assert eventually(lambda: not alive(members))
        now = client.overview()
        assert (now.queued, now.running, now.lost) == (3, 0, 0)
        assert client.run("c.0").row.reason == "the worker was stopped"


def test_children_die_with_their_worker_however_far_it_steps_back(tmp_path):
    with (
        daemon_at(tmp_path / "state") as daemon,
        daemon.client() as client,
        worker_for(daemon, 2, "--step-back", "3") as worker,
    ):
        client.submit(make_submission("c", 2, sleep=600.0))
        # The worker, its zygote, two runs, and a guardian of each.
        members = eventually(lambda: len(found := family(worker.pid)) >= 6 and found)
        autogroup = Path(f"/proc/{worker.pid}/autogroup")
        assert not autogroup.exists() or autogroup.read_text().endswith("nice 3\n")
        worker.kill()
        eventually(lambda: not alive(members))


def test_a_worker_that_cannot_execute_says_why_and_leaves(tmp_path):
    with daemon_at(tmp_path / "state") as daemon:
        options = ("--connect", daemon.endpoint, "--slots", "1", "--executor")
        daemon.client().close()
        worker = Part("worker", tmp_path / "w.log", *options, "tests.daemon.not_there:execute")
        assert worker.wait() == 5
        assert "this worker cannot execute runs" in worker.output
        assert "ModuleNotFoundError: No module named 'tests.daemon.not_there'" in worker.output


def test_a_worker_without_a_daemon_says_so(tmp_path):
    options = ("--connect", "tcp/127.0.0.1:9", "--slots", "1", "--executor")
    worker = Part("worker", tmp_path / "w.log", *options, "tests.fake_run:execute")
    assert worker.wait() == 3
    assert "no daemon answers at tcp/127.0.0.1:9" in worker.output


def test_results_left_by_a_dead_worker_are_delivered_by_the_next(tmp_path):
    with daemon_at(tmp_path / "state") as daemon:
        log, gate = tmp_path / "log", tmp_path / "gate"
        with daemon.client() as client, worker_for(daemon, 2) as worker:
            client.submit(make_submission("c", 2, until=str(gate), log=str(log)))
            eventually(lambda: log.exists() and len(log.read_text().splitlines()) == 2)
            daemon.freeze()
            gate.touch()
            spool = daemon.state / "spool"
            eventually(lambda: len(list(matching_paths(spool, "*/*/attempt-1.*/result.json"))) == 2)
            worker.kill()
            daemon.signal(signal.SIGCONT)
            with worker_for(daemon, 1):
                eventually(lambda: finished(client, 2))
                # The dead one may have sent them, and never have learnt that they came.
                eventually(lambda: not list(matching_paths(spool, "*/*/attempt-1.*")))
            assert [row.attempt for row in client.runs("c").rows] == [1, 1]
            assert len(log.read_text().splitlines()) == 2
            assert list(spool.iterdir()) == []


def test_a_worker_is_one_family(daemon, client):
    """The zygote never opens Zenoh: only the daemon listens, only the agent connects."""
    with worker_for(daemon) as worker:
        eventually(lambda: worker.pid in {row.pid for row in client.workers()})
        connected = [p for p in family(worker.pid) if p.net_connections("inet")]
        assert [p.pid for p in connected] == [worker.pid]
        assert os.getpgid(worker.pid) == worker.pid


def test_a_local_worker_that_cannot_execute_is_the_daemons_trouble(tmp_path):
    missing = "tests.daemon.not_there:execute"
    with (
        daemon_at(tmp_path / "state", 1, executor=missing) as daemon,
        daemon.client() as client,
    ):
        client.submit(make_submission("c", 1))
        trouble = eventually(lambda: client.overview().trouble)
        assert "No module named 'tests.daemon.not_there'" in trouble
        assert client.overview().queued == 1


def test_a_run_whose_scene_is_gone_waits_without_blame(tmp_path):
    with daemon_at(tmp_path / "state", attempts=1) as daemon, daemon.client() as client:
        client.submit(make_submission("c", 1))
        (scene,) = (daemon.state / "scenes").iterdir()
        scene.unlink()
        with worker_for(daemon, 1):
            words = f"the scene {scene.stem[:12]} is gone or was damaged: submit its campaign again"
            eventually(lambda: client.run("c.0").row.reason == words)
            row = client.run("c.0").row
            assert (row.state, row.attempt) == (RunState.QUEUED, 0)
            assert client.overview().troubles == (Trouble(words, TroubleCause.INPUT),)
            # The good copy is in hand.
            client.submit(make_submission("c", 1))
            eventually(lambda: finished(client, 1))
        assert client.overview().troubles == ()


@pytest.mark.skipif(not may_mount(), reason="mounting a small file system needs root")
def test_a_full_disk_of_daemon_and_worker_is_one_trouble(tmp_path):
    with (
        small_disk(tmp_path / "disk") as disk,
        daemon_at(disk / "state", 1) as daemon,
        daemon.client() as client,
    ):
        eventually(client.workers)
        fill(disk / "ballast")
        eventually(lambda: any(row.trouble for row in client.workers()))
        now = client.overview()
        assert "is full: runs wait" in now.trouble
        assert now.troubles == (Trouble(now.trouble, TroubleCause.SPACE),)
        (disk / "ballast").unlink()
        eventually(lambda: client.overview().troubles == ())


def test_details_of_a_run_are_told_while_somebody_watches_it(client):
    client.submit(make_submission("watched", 1, sleep=600.0))
    (row,) = client.runs("watched").rows
    told = []
    little = []
    with client.events(lambda _: None, little.append):
        eventually(lambda: any(live.run == row.id for live in little))
        assert all(live.snapshot.returns == () for live in little)
        with client.watch(row.id, told.append):
            eventually(lambda: bool(told) and told[-1].snapshot.returns == (100, 200))
        assert {live.run for live in told} == {row.id}
        # Nobody watches any more: after a while nothing but the progress is made.
        eventually(lambda: little[-1].snapshot.returns == ())
    client.cancel("watched")


def test_a_run_is_judged_while_somebody_wants_to_know(client):
    client.submit(make_submission("judged", 1, sleep=600.0))
    (row,) = client.runs("judged").rows
    told = []
    judged = []
    with client.watch(row.id, told.append):
        eventually(lambda: told)
        # Who looks at a run only wants no judgement, and nobody looks at all of them.
        assert {live.snapshot.margin for live in told} == {None}
        with client.watch(row.id, told.append, judged.append):
            eventually(lambda: len(judged) > 1)
    assert {judgement.run for judgement in judged} == {row.id}
    assert len(judged[-1].log) == 2000
    count = len(judged)
    told.clear()
    with client.watch(row.id, told.append):
        eventually(lambda: told and told[-1].snapshot.margin is None)
    client.cancel("judged")
    assert len(judged) == count


def test_margins_are_told_to_who_watches_all_runs(client):
    client.submit(make_submission("margins", 1, sleep=600.0))
    little = []
    with client.events(lambda _: None, little.append):
        eventually(lambda: little and little[-1].snapshot.margin == 0.25)
        (row,) = client.runs("margins").rows
        with client.watch(row.id, lambda _: None):
            # Only who watches this one is told what fills the line.
            eventually(lambda: len(little) > 20)
            assert {live.snapshot.returns for live in little} == {()}
    client.cancel("margins")


@pytest.mark.parametrize("different", [{"engine": "0"}, {"version": "0.0.1"}])
def test_a_worker_of_another_version_is_refused_with_the_remedy(daemon, client, different):
    ours = version("scenario-tui")
    stranger = replace(WorkerInfo("w", "host", 1, ours, 1, 0), **different)
    with bus.open_client(daemon.endpoint) as session:
        with pytest.raises(Refused, match=f"pip install 'scenario-tui=={ours}'"):
            bus.ask(session, daemon.endpoint, verbs.WELCOME, stranger, 30.0)
        lease = LeaseRequest(stranger, 1)
        with pytest.raises(Refused, match="worker w has scenario-tui"):
            bus.ask(session, daemon.endpoint, verbs.LEASE, lease, 30.0)
    assert "w" not in {row.id for row in client.workers()}


def test_a_scene_damaged_on_the_daemons_disk_is_put_aside_and_healed(tmp_path):
    """By a worker on the same file system, which reads it there, and by one that asks for it."""
    for number, options in enumerate(((), ("--state", str(tmp_path / "elsewhere")))):
        with (
            daemon_at(tmp_path / f"state{number}", attempts=1) as daemon,
            daemon.client() as client,
        ):
            client.submit(make_submission("c", 2, until=str(tmp_path / "no")))
            (scene,) = (daemon.state / "scenes").iterdir()
            scene.write_text(scene.read_text().replace("4.0", "5.0"))
            with worker_for(daemon, 1, *options) as worker:
                eventually(lambda w=worker: "not started" in w.output)
                eventually(lambda c=client: "was damaged" in str(c.overview().troubles))
                assert not scene.exists()
                (tmp_path / "no").touch()
                client.submit(make_submission("c", 2, until=str(tmp_path / "no")))
                eventually(lambda c=client: finished(c, 2))
                assert {row.state for row in client.runs("c").rows} == {RunState.DONE}
        (tmp_path / "no").unlink()


def test_a_worker_in_trouble_leaves_off_and_says_why(tmp_path):
    """Its disk quota was used up: it executed 239 runs in 12 s, and nobody was told."""
    log, room = tmp_path / "log", tmp_path / "room"

    def executed():
        return len(log.read_text().splitlines()) if log.exists() else 0

    with (
        daemon_at(tmp_path / "state", attempts=1) as daemon,
        daemon.client() as client,
        worker_for(daemon, 2),
    ):
        client.submit(make_submission("c", 12, full=str(room), log=str(log)))
        trouble = eventually(lambda: client.overview().trouble)
        assert "Disk quota exceeded" in trouble
        assert client.workers()[0].trouble in trouble
        # From the first pause on one run at a time finds out whether it is over.
        eventually(lambda: executed() >= 4)
        waiting = [row for row in client.runs("c").rows if row.reason]
        assert waiting
        assert all("Disk quota exceeded" in row.reason for row in waiting)
        room.touch()
        failed = executed()
        eventually(lambda: finished(client, 12))
        assert failed <= 8
        assert {row.state for row in client.runs("c").rows} == {RunState.DONE}
        eventually(lambda: client.overview().troubles == ())
