"""The feed: a thread that asks, over restarts, and never hides a bug."""

import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass

import pytest

from daemon.batch.errors import Unreachable
from daemon.model.status import ChangeEvent
from scenario_tui.dashboard import feed as feed_module
from scenario_tui.dashboard.feed import Feed
from tests.parts import DEADLINE, eventually
from tests.people.fake import CAMPAIGN, make_live


@pytest.fixture
def feed(fake, monkeypatch):
    for name in ("REFRESH", "_BREATH", "_RETRY"):
        monkeypatch.setattr(feed_module, name, 0.005)
    feed = Feed(fake.open, clock=lambda: fake.now)
    yield feed
    feed.close()


def test_a_daemon_that_hangs_is_told_before_its_connection_is_closed(feed, fake, monkeypatch):
    closing, go_on = threading.Event(), threading.Event()

    @contextmanager
    def hanging():
        with fake.open() as daemon:
            try:
                yield daemon
            finally:
                closing.set()
                go_on.wait()

    monkeypatch.setattr(feed, "connect", hanging)
    feed.start()
    eventually(lambda: (known := feed.take_news().known) is not None and known.connected)
    fake.reachable = False
    assert closing.wait(DEADLINE)
    known = feed.take_news().known
    go_on.set()
    assert known is not None
    assert not known.connected


@dataclass
class RunFront:
    """A screen in front that shows a run."""

    feed: Feed
    run: str = f"{CAMPAIGN}.0"
    about: str = CAMPAIGN

    def fetch(self, daemon, known):
        return self.feed.watch.look(daemon, self.run)


@dataclass
class PageFront:
    """A screen in front that shows a page of runs."""

    about: str = CAMPAIGN

    def fetch(self, daemon, known):
        return daemon.runs(CAMPAIGN, limit=3)


def test_only_what_the_screen_in_front_fetches_is_asked_for(feed, fake, monkeypatch):
    monkeypatch.setattr(feed_module, "_ASSESS_EVERY", 60.0)
    feed.start()
    eventually(lambda: feed.take_news().known is not None)
    assert {call[0] for call in fake.calls} == {"open", "overview", "campaigns"}
    page = PageFront()
    feed.look_at(page)
    eventually(lambda: feed.take_news().front is page)
    assert len(feed._fetched[1].rows) == 3
    assert "run" not in {call[0] for call in fake.calls}
    run = RunFront(feed, f"{CAMPAIGN}.5")
    feed.look_at(run)
    eventually(lambda: feed.take_news().front is run)
    assert feed._fetched[1].scene is not None
    assert sum(call[0] == "get" and not call[3] for call in fake.calls) == 1  # kept after that


def test_all_that_becomes_known_is_told_at_once(feed, fake):
    told = []
    feed.on_news = lambda: told.append(feed._known.connected)
    feed.step(fake)
    feed._lose(Unreachable("gone"))
    feed.step(fake)
    assert told == [True, False, True]


def test_what_was_judged_is_told_without_asking_anew(feed, fake, monkeypatch):
    monkeypatch.setattr(feed_module, "REFRESH", 60.0)
    feed.look_at(PageFront())
    feed.start()
    eventually(lambda: feed._known.results)
    assert sum(call[0] == "campaigns" for call in fake.calls) == 1


def test_a_gone_daemon_leaves_the_last_picture_and_is_found_again(feed, fake):
    feed.start()
    eventually(lambda: feed._known.connected)
    fake.reachable = False
    eventually(lambda: not feed._known.connected)
    assert feed._known.problem.startswith("no daemon answers")
    assert feed._known.campaigns
    fake.reachable = True
    eventually(lambda: feed._known.connected)


def test_telemetry_waits_until_it_is_taken(feed, fake):
    fake.live = (make_live(7, 1.0), make_live(7, 2.0))
    feed.start()
    eventually(lambda: len(feed._lives) == 2)
    assert [live.snapshot.time for live in feed.take_news().lives] == [1.0, 2.0]
    assert feed.take_news().lives == []


def test_telemetry_nobody_takes_does_not_grow(feed):
    for index in range(2000):
        feed._lives.append(make_live(7, float(index)))
    assert len(feed.take_news().lives) == 512


def test_actions_become_notices(feed, fake):
    feed.enqueue_action(lambda daemon: f"cancelled {daemon.cancel(CAMPAIGN)}")
    feed.enqueue_action(lambda daemon: str(daemon.run("nobody.1")))
    feed.start()
    eventually(lambda: len(feed._notices) == 2)
    good, bad = feed.take_news().notices
    assert (good.text, good.severity) == ("cancelled 2", "information")
    assert (bad.text, bad.severity) == ("there is no run nobody.1", "error")


def test_an_action_without_a_daemon_is_told_not_to_be_done(feed, fake):
    fake.reachable = False
    feed.start()
    eventually(lambda: feed._known.problem)
    feed.enqueue_action(lambda daemon: "done")
    eventually(lambda: feed._notices)
    assert [notice.text for notice in feed.take_news().notices] == [
        "no daemon answers: nothing was done"
    ]


def test_a_bug_in_the_thread_is_seen_by_whoever_takes(feed, fake):
    def bug(daemon):
        raise KeyError("a bug")

    fake.before = bug
    feed.start()
    eventually(lambda: feed._failure is not None)
    with pytest.raises(KeyError):
        feed.take_news()


def test_an_event_makes_the_feed_look_at_once(fake, monkeypatch):
    monkeypatch.setattr(feed_module, "REFRESH", 60.0)
    monkeypatch.setattr(feed_module, "_BREATH", 0.005)
    monkeypatch.setattr(feed_module, "_ASSESS_EVERY", 60.0)
    feed = Feed(fake.open)
    feed.start()
    eventually(lambda: bool(fake.listeners) and feed._known.connected)
    before = len(fake.calls)
    time.sleep(0.05)
    assert len(fake.calls) <= before + 2
    fake.listeners[0][0](ChangeEvent(1, "run", f"{CAMPAIGN}.7"))
    eventually(lambda: len(fake.calls) > before + 1)
    feed.close()


def test_a_key_that_is_held_keeps_nothing_else_from_being_looked_at(feed, fake, monkeypatch):
    page, runs = PageFront(), fake.runs

    def turned_again(*asked, **others):
        feed.look_at(page)
        return runs(*asked, **others)

    monkeypatch.setattr(fake, "runs", turned_again)
    monkeypatch.setattr(feed, "_clock", time.time)
    feed.look_at(page)
    feed.start()
    eventually(lambda: sum(call[0] == "overview" for call in fake.calls) > 2)


def test_a_daemon_that_goes_while_it_is_asked_for_results_is_noticed(feed, fake, monkeypatch):
    silent, asked = threading.Event(), threading.Event()
    monkeypatch.setattr(feed_module, "_PATIENCE", 0.01)
    monkeypatch.setattr(feed_module, "_ASSESS_EVERY", 0.005)

    def all_runs(campaign, *, results):
        asked.set()
        silent.wait()
        raise OSError("the connection was closed")

    monkeypatch.setattr(fake, "all_runs", all_runs)
    feed.start()
    assert asked.wait(DEADLINE)
    fake.reachable = False
    eventually(lambda: not feed._known.connected)
    silent.set()
    for thread in threading.enumerate():
        if thread.name == "judge":
            thread.join()
    assert feed._failure is None
