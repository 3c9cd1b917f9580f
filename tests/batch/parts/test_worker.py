"""A daemon and its workers: how runs end, what is told of them, how workers come and leave."""

import hashlib
import os
import signal
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import psutil
import pytest

from daemon.batch import bus
from daemon.batch.errors import Refused
from daemon.model import verbs
from daemon.model.messages import LeaseRequest, WorkerInfo
from daemon.model.spec import SutReference
from daemon.model.status import Trouble, TroubleCause
from daemon.model.verdicts import Outcome, RunState
from tests.chaos.disk import fill, may_mount, small_disk
from tests.make import make_spec, make_submission, submission_of
from tests.parts import (
    EXECUTOR,
    Part,
    alive,
    daemon_at,
    eventually,
    executions,
    family,
    finish,
    finished,
    recorded,
    worker_for,
)


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    """A daemon with a local worker of two slots that most tests share; renewals take for ever."""
    with daemon_at(tmp_path_factory.mktemp("worker") / "state", 2) as part:
        yield part


@pytest.fixture(scope="module")
def client(shared):
    with shared.client() as connected:
        yield connected


# --- how runs end

KINDS = {
    "good": {},
    "failing": {"outcome": "fail"},
    "crashes twice": {"crash": [1, 2]},
    "always crashes": {"crash": [1, 2, 3]},
    "aborts": {"abort": "planning a way"},
    "is loud": {"prints": 5, "abort": "out of luck"},
    "raises": {"raise": "no such door"},
    "eats memory": {"allocate": 8 * 1024},
    "has long evidence": {"evidence": 2**21},
    "has many verdicts": {"verdicts": 5000, "outcome": "fail"},
    "is good too": {},
}


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return tmp_path_factory.mktemp("log") / "log"


@pytest.fixture(scope="module")
def endings(client, log):
    """Runs of all kinds in one campaign, each as it ended."""
    kinds = enumerate(KINDS.values())
    client.submit(submission_of("kinds", *(make_spec(n, log=str(log), **k) for n, k in kinds)))
    rows = finish(client, "kinds")
    return {kind: client.run(row.id).row for kind, row in zip(KINDS, rows, strict=True)}


def test_runs_come_back_with_results_and_traces_and_none_harms_another(endings):
    for kind, outcome in (("good", "pass"), ("failing", "fail"), ("is good too", "pass")):
        row = endings[kind]
        assert (row.state, row.outcome, row.attempt) == (RunState.DONE, outcome, 1)
        sha256 = hashlib.sha256(Path(row.trace).read_bytes()).hexdigest()
        assert sha256 == row.result.trace.sha256


def test_every_run_has_a_fresh_process(endings, log):
    lines = [line.split() for line in log.read_text().splitlines()]
    assert {int(repeat) for repeat, _, _ in lines} == set(range(len(KINDS)))
    assert (
        len({pid for _, pid, _ in lines}) == len(lines) == sum(r.attempt for r in endings.values())
    )


def test_a_crashing_run_is_tried_again(endings):
    row = endings["crashes twice"]
    assert (row.state, row.attempt, row.reason) == (RunState.DONE, 3, "")


@pytest.mark.parametrize(
    ("kind", "begin", "middle", "end"),
    [
        ("always crashes", "", "", "the run's process was killed by SIGKILL"),
        # A native crash tells where it was and what it said.
        ("aborts", "planning a way", "fake_run.py", "the run's process was killed by SIGABRT"),
        ("is loud", "", "\nout of luck\nFatal Python error: Aborted", "killed by SIGABRT"),
        # An exception is never a verdict.
        ("raises", "", "RuntimeError: no such door", ""),
        ("eats memory", "", "MemoryError", ""),
    ],
)
def test_a_run_without_a_result_is_lost_and_says_why(endings, kind, begin, middle, end):
    row = endings[kind]
    assert (row.state, row.attempt, row.outcome, row.result) == (RunState.LOST, 3, None, None)
    assert row.reason.startswith(begin)
    assert middle in row.reason
    assert row.reason.endswith(end)
    assert len(row.reason) < 10_000


def test_results_are_bounded_where_they_are_made(endings):
    cut, empty = endings["has long evidence"], endings["has many verdicts"]
    assert (cut.outcome, len(cut.result.verdicts)) == (Outcome.PASS, 1)
    assert "notes were cut" in cut.result.note
    assert (empty.outcome, empty.result.verdicts) == (Outcome.ERROR, ())
    assert "5000 verdicts were left out" in empty.result.note


def test_a_run_whose_system_is_not_installed_waits_for_another_worker(client, shared):
    absent = [replace(make_spec(i), sut=SutReference("mine", "absent", {})) for i in range(3)]
    client.submit(submission_of("absent", *absent, *(make_spec(i) for i in range(4))))
    eventually(lambda: client.overview().queued == 3 and not client.overview().running)
    rows = client.runs("absent").rows
    assert [row.state for row in rows] == [RunState.QUEUED] * 3 + [RunState.DONE] * 4
    assert max(row.attempt for row in rows[:3]) == 1  # what was leased ahead, and then no more
    assert 'install the system under test "absent" for worker' in rows[0].reason
    assert recorded(shared, "SELECT max(strikes) FROM run WHERE kind = 'absent'") == [(0,)]
    assert client.cancel("absent") == 3


# --- what is told of runs that go on


@pytest.fixture
def held(client):
    """Two runs that go on until the test is over, and one that waits."""
    client.submit(make_submission("held", 3, sleep=600.0))
    eventually(lambda: client.overview().running == 2)
    yield "held.0"
    client.cancel("held")
    eventually(lambda: client.overview().running == 0)
    client.delete(("held",))


def test_a_worker_tells_what_it_takes_of_its_machine_and_which_runs_it_executes(client, held):
    (row,) = eventually(lambda: [row for row in client.workers() if len(row.runs) == 2])
    assert (row.slots, row.runs) == (2, ("held.0", "held.1"))
    assert psutil.pid_exists(row.pid)
    assert 2**20 < row.memory < row.memory_total == psutil.virtual_memory().total
    assert 0.0 <= row.cpu <= 1.0
    client.cancel("held")
    eventually(lambda: client.workers()[0].runs == ())


def test_who_watches_all_runs_is_told_how_far_they_are_and_their_margins(client, held):
    seen = []
    with client.events(lambda _: None, seen.append):
        eventually(lambda: seen and seen[-1].snapshot.margin == 0.25)
        eventually(lambda: len([live for live in seen if live.run == held]) >= 2)
    snapshots = [live.snapshot for live in seen if live.run == held]
    times = [snapshot.time for snapshot in snapshots]
    assert times == sorted(times)
    assert {snapshot.returns for snapshot in snapshots} == {()}


def test_a_run_is_judged_while_somebody_wants_to_know(client, held):
    told, judged = [], []
    with client.watch(held, told.append):
        eventually(lambda: told and told[-1].snapshot.returns == (100, 200))
        # Who looks at a run only wants no judgement, and nobody looks at all of them.
        assert {live.snapshot.margin for live in told} == {None}
        with client.watch(held, told.append, judged.append):
            eventually(lambda: len(judged) > 1)
    assert {judgement.run for judgement in judged} == {held}
    assert len(judged[-1].log) == 2000
    count = len(judged)
    told.clear()
    with client.watch(held, told.append):
        eventually(lambda: told and told[-1].snapshot.margin is None)
    assert len(judged) == count


# --- workers that come and leave


@pytest.mark.parametrize("different", [{"engine": "0"}, {"version": "0.0.1"}])
def test_a_worker_of_another_version_is_refused_with_the_remedy(shared, client, different):
    ours = version("scenario-tui")
    stranger = replace(WorkerInfo("w", "host", 1, ours, 1, 0), **different)
    with bus.open_client(shared.endpoint) as session:
        with pytest.raises(Refused, match=f"pip install 'scenario-tui=={ours}'"):
            bus.ask(session, shared.endpoint, verbs.WELCOME, stranger, 30.0)
        lease = LeaseRequest(stranger, 1)
        with pytest.raises(Refused, match="worker w has scenario-tui"):
            bus.ask(session, shared.endpoint, verbs.LEASE, lease, 30.0)
    assert "w" not in {row.id for row in client.workers()}


def test_a_worker_is_one_family(shared, client):
    """The zygote never opens Zenoh: only the daemon listens, only the agent connects."""
    with worker_for(shared) as worker:
        eventually(lambda: worker.pid in {row.pid for row in client.workers()})
        connected = [p for p in family(worker.pid) if p.net_connections("inet")]
        assert [p.pid for p in connected] == [worker.pid]
        assert os.getpgid(worker.pid) == worker.pid


MISSING = "tests.batch.not_there:execute"


def test_a_worker_that_cannot_execute_or_finds_no_daemon_says_why_and_leaves(shared, tmp_path):
    unable = ("this worker cannot execute runs", "No module named 'tests.batch.not_there'")
    for endpoint, executor, code, words in (
        (shared.endpoint, MISSING, 5, unable),
        ("tcp/127.0.0.1:9", EXECUTOR, 3, ("no daemon answers at tcp/127.0.0.1:9",)),
    ):
        options = ("--connect", endpoint, "--slots", "1", "--executor", executor)
        worker = Part("worker", tmp_path / "w.log", *options)
        assert worker.wait() == code
        assert all(one in worker.output for one in words)


def test_a_local_worker_that_cannot_execute_is_the_daemons_trouble(tmp_path):
    with (
        daemon_at(tmp_path / "state", 1, executor=MISSING) as daemon,
        daemon.client() as client,
    ):
        client.submit(make_submission("c", 1))
        trouble = eventually(lambda: client.overview().trouble)
        assert "No module named 'tests.batch.not_there'" in trouble
        assert client.overview().queued == 1


@pytest.fixture(scope="module")
def bare(tmp_path_factory):
    """A daemon without workers of its own, where the first bad ending loses a run."""
    with daemon_at(tmp_path_factory.mktemp("bare") / "state", attempts=1) as part:
        yield part


@pytest.fixture
def direct(bare):
    """A client of it for one test, of whose campaigns nothing is left."""
    with bare.client() as client:
        yield client
        for row in client.campaigns():
            client.cancel(row.id)
            client.delete((row.id,))


def test_a_wall_clock_limit_stops_a_run(bare, direct):
    """By the clock of the machine: the run never ends, so no limit is too short."""
    with worker_for(bare, 1, "--wall", "0.01"):
        direct.submit(make_submission("slow", 1, sleep=600.0))
        (row,) = finish(direct, "slow")
        assert row.state is RunState.LOST
        assert "stopped after 0.01 s of wall clock time" in row.reason


def test_a_worker_told_twice_gives_its_runs_back_without_blame(bare, direct, tmp_path):
    log = tmp_path / "log"
    with worker_for(bare, 2) as worker:
        direct.submit(make_submission("c", 3, sleep=600.0, log=str(log)))
        eventually(lambda: executions(log, 2))
        members = family(worker.pid)
        for number in (signal.SIGTERM, signal.SIGTERM, signal.SIGQUIT):
            worker.signal(number)
        assert worker.wait() == 0
        assert eventually(lambda: not alive(members))
    now = direct.overview()
    assert (now.queued, now.running, now.lost) == (3, 0, 0)
    assert direct.run("c.0").row.reason == "the worker was stopped"


# --- troubles


@pytest.mark.parametrize("elsewhere", [False, True])
def test_a_scene_damaged_on_the_daemons_disk_is_put_aside_and_healed(
    bare, direct, tmp_path, elsewhere
):
    """By a worker on the same file system, which reads it there, and by one that asks for it."""
    direct.submit(make_submission("c", 2))
    (scene,) = (bare.state / "scenes").iterdir()
    scene.write_text(scene.read_text().replace("4.0", "5.0"))
    options = ("--state", str(tmp_path / "elsewhere")) if elsewhere else ()
    with worker_for(bare, 1, *options) as worker:
        eventually(lambda: "not started" in worker.output)
        eventually(lambda: "was damaged" in str(direct.overview().troubles))
        assert not scene.exists()
        direct.submit(make_submission("c", 2))
        eventually(lambda: finished(direct, 2))
        assert {row.state for row in direct.runs("c").rows} == {RunState.DONE}


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
        client.submit(make_submission("c", 1))  # it has the worker look at the disk again
        eventually(lambda: finished(client, 1) and client.overview().troubles == ())


def test_a_worker_in_trouble_leaves_off_and_says_why(bare, direct, tmp_path):
    """Its disk quota was used up: it executed 239 runs in 12 s, and nobody was told."""
    room = tmp_path / "room"
    with worker_for(bare, 2):
        direct.submit(make_submission("c", 12, full=str(room)))
        trouble = eventually(lambda: direct.overview().trouble)
        assert "Disk quota exceeded" in trouble
        assert direct.workers()[0].trouble in trouble
        reasons = {row.reason for row in direct.runs("c").rows if row.reason}
        assert reasons
        assert all("Disk quota exceeded" in reason for reason in reasons)
        room.touch()
        eventually(lambda: finished(direct, 12))
        assert {row.state for row in direct.runs("c").rows} == {RunState.DONE}
        eventually(lambda: direct.overview().troubles == ())
