"""Who is blamed when Dask workers die: the gateway's bookkeeping, without a cluster."""

from contextlib import closing
from types import SimpleNamespace

import pytest
from distributed import KilledWorker

from daemon.batch.run_process import RESULT
from daemon.batch.worker import Attempt
from daemon.batch.worker.cluster import Gateway
from daemon.batch.worker.cluster._remote import JobProgress
from daemon.model.execution import DaskScheduler, RunLimits
from daemon.model.messages import Lease
from daemon.model.spec import Snapshot
from daemon.model.status import LiveSnapshot
from grammars.model.geometry import Pose2
from grammars.text import codec
from tests.daemon.batch.samples import make_spec


class Task:
    """What Dask knows of an attempt; ends when told to."""

    def __init__(self, key):
        self.key = key

    def add_done_callback(self, take):
        self._take = take

    def die(self):
        self._take(self)

    def result(self):
        raise KilledWorker(self.key, SimpleNamespace(address="tcp://there:1"), 3)

    def release(self): ...


class Cluster:
    """A connection to a cluster that only takes note."""

    topic = "topic"

    def __init__(self):
        self.tasks = []
        self.connected, self.has_only_unfit = True, False
        self.threads = 0
        self.shortage = "nobody is there"

    def submit(self, *_):
        self.tasks.append(Task(str(len(self.tasks))))
        return self.tasks[-1], frozenset()

    def has_no_worker(self, _):
        return False

    def close(self): ...


@pytest.fixture
def cluster():
    return Cluster()


@pytest.fixture
def gateway(cluster):
    made = Gateway(DaskScheduler("tcp://nowhere:1"), "none", slots=4, log=lambda _: None)
    made._cluster = cluster
    with closing(made):
        yield made


def start(gateway, folder, *runs):
    started = []
    for name in runs:
        (folder / name).mkdir(exist_ok=True)
        attempt = Attempt(Lease(name, "c", 1, 1, "c/t.mcap", make_spec()), folder / name)
        started.append(gateway.start(attempt, folder / "scene", RunLimits()))
    return started


def take_in(*runs):
    """What the worker does with ended attempts; whether they are blamed."""
    blamed = []
    for run in runs:
        assert run.end is not None
        blamed.append(run.end.counts)
    for run in runs:
        run.close()
    return blamed


def test_suspects_are_executed_one_at_a_time_and_only_the_second_death_is_blamed(
    gateway, cluster, tmp_path
):
    first = start(gateway, tmp_path, "guilty", "beside", "innocent")
    assert len(cluster.tasks) == 3
    for task in cluster.tasks:
        task.die()
    assert take_in(*first) == [False, False, False]

    guilty, beside, innocent, stranger = start(
        gateway, tmp_path, "guilty", "beside", "innocent", "stranger"
    )
    assert len(cluster.tasks) == 5  # the first suspect, and who is none
    cluster.tasks[3].die()
    assert take_in(guilty) == [True]
    assert len(cluster.tasks) == 6
    assert beside.end is None

    (tmp_path / "beside" / RESULT).touch()
    beside.kill()
    assert take_in(beside) == [False]
    assert len(cluster.tasks) == 7
    assert innocent.end is None
    start(gateway, tmp_path, "beside")
    assert len(cluster.tasks) == 8  # it has shown that it can finish
    assert stranger.end is None


def test_a_suspect_that_waits_can_be_given_up(gateway, cluster, tmp_path):
    first = start(gateway, tmp_path, "one", "two", "three")
    for task in cluster.tasks:
        task.die()
    take_in(*first)
    one, two, _ = start(gateway, tmp_path, "one", "two", "three")
    two.kill("not wanted")
    assert two.end is not None
    assert two.end.why == "not wanted"
    take_in(two)
    one.kill()
    take_in(one)
    assert len(cluster.tasks) == 5  # "three" goes on, "two" never did


def test_a_cluster_that_executes_nothing_for_a_while_is_said_with_the_reason():
    said = []
    scheduler = DaskScheduler("tcp://nowhere:1")
    made = Gateway(scheduler, "none", slots=None, log=said.append, patience=0.0)
    with closing(made):
        made.listen()
        assert made.trouble.startswith("the Dask scheduler tcp://nowhere:1 does not answer")
        made._cluster = cluster = Cluster()
        made.listen()
        made.listen()
        assert made.trouble == cluster.shortage
        cluster.threads = 4
        made.listen()
        assert made.trouble == ""
    assert said[1:] == ["no slots: nobody is there", "the cluster executes runs again"]


def test_a_cluster_may_be_without_slots_for_a_moment():
    said = []
    made = Gateway(DaskScheduler("tcp://nowhere:1"), "none", slots=None, log=said.append)
    with closing(made):
        made.listen()
        assert (made.trouble, said) == ("", [])


def test_what_a_process_of_the_cluster_prepares_is_passed_on_until_a_run_begins(
    gateway, cluster, tmp_path
):
    (run,) = start(gateway, tmp_path, "one")
    (task,) = cluster.tasks
    words = "compiling kernels 7/42 (once on this machine)"
    gateway._on_progress(codec.to_json(JobProgress("another", preparing=words)).decode())
    assert gateway.preparing == ""
    gateway._on_progress(codec.to_json(JobProgress(task.key, preparing=words)).decode())
    assert gateway.preparing == f"cluster: {words}"
    live = codec.to_json(LiveSnapshot("one", Snapshot(1.0, 9.0, Pose2(), None, 0, 1, ()))).decode()
    gateway._on_progress(codec.to_json(JobProgress(task.key, live)).decode())
    assert gateway.preparing == ""
    assert run.live == live.encode()
