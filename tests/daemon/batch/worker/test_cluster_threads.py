"""Threads between a gateway and its cluster: what they do not expect ends no work in silence."""

import subprocess
import sys
import threading
from contextlib import closing
from multiprocessing import Pipe
from queue import SimpleQueue
from types import SimpleNamespace

import pytest

from daemon.batch.worker import Attempt
from daemon.batch.worker._attempts import AttemptEnd
from daemon.batch.worker.cluster import Gateway, _connection
from daemon.batch.worker.cluster._connection import ClusterConnection
from daemon.batch.worker.cluster._remote import LaunchReport, RemoteLauncher
from daemon.model.execution import DaskScheduler, RunLimits
from daemon.model.messages import Lease
from tests.daemon.batch.harness import eventually
from tests.daemon.batch.samples import make_spec

SCHEDULER = DaskScheduler("tcp://nowhere:1")


def test_a_cluster_is_looked_at_again_whatever_its_client_raises(monkeypatch):
    for name in ("_PERIOD", "_AFTER_LOSS"):
        monkeypatch.setattr(_connection, name, 0.001)
    said = []
    looks = []

    def nthreads():
        looks.append(1)
        if len(looks) == 1:  # what a client says whose scheduler goes in that very moment
            raise AttributeError("'NoneType' object has no attribute 'ncores'")
        return {}

    made = ClusterConnection(
        SCHEDULER, "none", changed=lambda: None, on_event=lambda _: None, log=said.append
    )
    made._client = SimpleNamespace(status="running", nthreads=nthreads, close=lambda **_: None)
    made._keeper.start()
    with closing(made):
        eventually(lambda: len(said) == 2)
    assert said[0].startswith("without the Dask scheduler tcp://nowhere:1: AttributeError(")
    assert said[1] == "the Dask scheduler tcp://nowhere:1 is back"


def test_what_is_wanted_of_a_job_last_is_what_it_is_told_last():
    told = []
    asked, go_on = threading.Event(), threading.Event()

    def run(_, __, ___, wanted, **____):
        if wanted == ("details",):  # a scheduler that takes its time
            asked.set()
            assert go_on.wait(60.0)
        told.append(wanted)

    made = ClusterConnection(
        SCHEDULER, "none", changed=lambda: None, on_event=lambda _: None, log=lambda _: None
    )
    made._client = SimpleNamespace(status="running", run=run, close=lambda **_: None)
    with closing(made):
        made.watch("tcp://there:1", "job", ("details",))
        assert asked.wait(60.0)
        made.watch("tcp://there:1", "job", ("margin",))
        made.watch("tcp://there:1", "job", ())
        made.watch("tcp://there:1", "another", ("margin",))  # does not wait for that
        eventually(lambda: told == [("margin",)])
        go_on.set()
        eventually(lambda: len(told) == 3)
    assert told[1:] == [("details",), ()]


@pytest.mark.parametrize("answer", [None, (b"{}",), ("{}", 1, 2), (7, b"", b"")])
def test_an_answer_of_another_form_ends_its_attempt(tmp_path, answer):
    told = []
    task = SimpleNamespace(
        key="0", add_done_callback=told.append, result=lambda: answer, release=lambda: None
    )
    gateway = Gateway(SCHEDULER, "none", slots=1, log=lambda _: None)
    with closing(gateway):
        gateway._cluster = SimpleNamespace(
            topic="topic", submit=lambda *_: (task, frozenset()), close=lambda: None
        )
        attempt = Attempt(Lease("c.0", "c", 1, 1, "c/t.mcap", make_spec()), tmp_path)
        run = gateway.start(attempt, tmp_path / "scene", RunLimits())
        (take,) = told
        take(task)
    assert run.end is not None
    assert run.end.why.startswith("what came from the cluster was not taken: ")
    assert not run.end.counts


@pytest.mark.parametrize("words", [b"", b"no JSON"])
def test_who_waits_for_a_launcher_hears_that_it_ended_or_is_not_understood(words):
    ours, theirs = Pipe()
    inbox = SimpleQueue()
    launcher = RemoteLauncher.__new__(RemoteLauncher)
    launcher._wire, launcher._inboxes, launcher.ended = ours, {"key": inbox}, False
    sleeping = [sys.executable, "-c", "import time; time.sleep(600.0)"]
    with ours, theirs, subprocess.Popen(sleeping) as launcher._process:
        reading = threading.Thread(target=launcher._read)
        reading.start()
        if words:
            theirs.send_bytes(words)
        else:
            theirs.close()
        end = inbox.get(timeout=60.0).end
        reading.join(60.0)
        assert not reading.is_alive()
    assert launcher.ended
    assert end is not None
    assert end.why == "the process that starts runs ended"


def test_a_launcher_that_ends_while_its_run_is_stopped_has_ended_and_lacks_no_room():
    ours, theirs = Pipe()
    inbox = SimpleQueue()
    launcher = RemoteLauncher.__new__(RemoteLauncher)
    launcher._wire, launcher._sending, launcher.ended = ours, threading.Lock(), False
    end = AttemptEnd("the process that starts runs ended")

    def wanted():
        inbox.put(LaunchReport("key", end=end))  # as its reader does, at that very moment
        return False

    theirs.close()
    with ours:
        assert launcher._await("key", inbox, wanted, lambda _: None) == end
