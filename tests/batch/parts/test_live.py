"""What is published of running runs: nothing unless somebody listens, and no more than the line."""

from types import SimpleNamespace

import pytest

from daemon.batch import bus
from daemon.batch.run_process import WatchDetail
from daemon.batch.worker import _live
from daemon.batch.worker._live import LINE_RATE, LivePublisher
from daemon.model.live_judgement import LiveJudgement, LogLine, pack_judgement
from daemon.model.messages import LIVE, OWNER, Empty
from daemon.model.spec import Snapshot
from daemon.model.status import LiveSnapshot
from daemon.model.verbs import OVERVIEW
from grammars.model.geometry import Pose2
from grammars.text import codec
from tests.parts import eventually

RUN = "c.0"
POINTS = tuple(range(-430, 430))
"""So many that a snapshot is as long as a pipe takes."""
LOG = tuple(LogLine(i / 7.0, "sut", f"{i * 7919 % 100003:x} {i}") for i in range(600))


class Told:
    """An execution that tells what it is given to."""

    def __init__(self):
        self.attempt = SimpleNamespace(lease=SimpleNamespace(run=RUN))
        self.live = self.judged = b""
        self.wanted = []

    def watch(self, wanted):
        self.wanted.append(wanted)

    def tells(self, time, *, judged=False):
        picture = Snapshot(time, 60.0, Pose2(time), None, 0, 1, (), returns=POINTS)
        self.live = codec.to_json(LiveSnapshot(RUN, picture))
        if judged:
            self.judged = pack_judgement(LiveJudgement(RUN, time, (), (), (), (), LOG))


@pytest.fixture
def clock(monkeypatch):
    now = SimpleNamespace(time=1000.0)
    monkeypatch.setattr(_live, "time", SimpleNamespace(monotonic=lambda: now.time))
    return now


def publish_seconds(publisher, told, clock, seconds):
    """Let a run tell itself ten times a second, and what it is judged by once a second."""
    for step in range(10 * seconds):
        clock.time += 0.1
        told.tells(step / 10.0, judged=step % 10 == 0)
        publisher.publish(told)
        # Behind it on the same link: nothing is dropped for want of a pause.
        bus.ask(publisher.session, "the daemon", OVERVIEW, Empty(), 30.0)


def publish_until(publisher, told, *wanted):
    """Let a run tell itself until that is wanted of it."""

    def is_wanted():
        told.tells(0.0)
        publisher.publish(told)
        return bool(told.wanted) and {*wanted} <= set(told.wanted[-1])

    eventually(is_wanted)


def test_nothing_is_wanted_of_a_run_and_nothing_sent_while_nobody_listens(shared, client, clock):
    told = Told()
    heard = []
    with bus.open_client(shared.endpoint) as session:
        publisher = LivePublisher(session, "worker-1", OWNER)
        publish_seconds(publisher, told, clock, 2)
        assert told.wanted == []
        with client.watch("another.1", heard.append, lambda _: None):
            client.overview()  # behind the subscription on the same link
            publish_seconds(publisher, told, clock, 2)
        assert (told.wanted, heard) == ([], [])


def test_who_watches_a_run_is_sent_no_more_than_the_line_takes(shared, client, clock):
    told = Told()
    sizes = {}
    judged = []
    seconds = 20
    with (
        bus.open_client(shared.endpoint) as session,
        bus.open_client(shared.endpoint) as line,
        client.watch(RUN, lambda _: None, judged.append),
    ):

        def weigh(sample):
            sizes.setdefault(str(sample.key_expr), []).append(len(sample.payload.to_bytes()))

        subscriber = line.declare_subscriber(f"{LIVE}/**", weigh)
        publisher = LivePublisher(session, "worker-1", OWNER)
        publish_until(publisher, told, WatchDetail.DETAILS, WatchDetail.JUDGEMENT)
        key = f"{LIVE}/owner/worker-1/{RUN}"
        before = len(sizes.get(key, ()))
        publish_seconds(publisher, told, clock, seconds)
        eventually(lambda: len(sizes.get(f"{key}/judged", ())) == seconds)
        eventually(lambda: judged and judged[-1].time == seconds - 1.0)
        subscriber.undeclare()
    details = sizes[key][before:]
    assert 5 * seconds < len(details) < 10 * seconds
    sent = sum(details) + sum(sizes[f"{key}/judged"])
    assert 0.9 * LINE_RATE * seconds < sent <= LINE_RATE * (seconds + 1)
    # Who watches all of them is told less: of that run, others see the details.
    assert max(sizes[f"{LIVE}/owner/worker-1"]) < 300


def test_what_a_run_says_that_is_no_snapshot_does_not_stop_its_worker(shared, client, clock):
    told = Told()
    seen = []
    with (
        bus.open_client(shared.endpoint) as session,
        client.events(lambda _: None, seen.append),
        client.watch(RUN, lambda _: None),
    ):
        publisher = LivePublisher(session, "worker-1", OWNER)
        publish_until(publisher, told, WatchDetail.DETAILS, WatchDetail.MARGIN)
        clock.time += 1.0
        told.live = b"no snapshot"
        publisher.publish(told)
        clock.time += 1.0
        told.tells(7.0)
        publisher.publish(told)
        eventually(lambda: seen and seen[-1].snapshot.time == 7.0)
