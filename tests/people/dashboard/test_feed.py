"""The feed: a thread that asks, over restarts, never hides a bug, and has campaigns assessed."""

import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import pytest

from daemon.analysis.results import read_results
from daemon.model.status import ChangeEvent
from scenario_tui.dashboard import feed as feed_module
from scenario_tui.dashboard.feed import Feed
from scenario_tui.dashboard.state import CampaignAssessor, DashboardState
from tests.parts import DEADLINE, eventually
from tests.people.dashboard.daemons import judged_campaign
from tests.people.fake import CAMPAIGN, OLD, make_live


@dataclass
class Taker:
    """Takes the news of a feed, as a dashboard does."""

    feed: Feed
    state: DashboardState = field(default_factory=DashboardState)
    front: object = None
    fetched: object = None
    lives: list = field(default_factory=list)
    notices: list = field(default_factory=list)

    def take(self):
        news = self.feed.take_news()
        self.state = news.state or self.state
        self.front, self.fetched = news.front, news.fetched
        self.lives += news.lives
        self.notices += news.notices
        return self

    def until(self, condition):
        eventually(lambda: condition(self.take()))


@dataclass
class PageFront:
    """A screen in front that shows a page of runs."""

    about: str = CAMPAIGN

    def fetch(self, daemon, state):
        return daemon.runs(CAMPAIGN, limit=3)


@pytest.fixture
def feed(fake, monkeypatch):
    for name in ("REFRESH", "_BREATH", "_RETRY"):
        monkeypatch.setattr(feed_module, name, 0.005)
    feed = Feed(fake.open, clock=lambda: fake.now)
    yield feed
    feed.close()


@pytest.fixture
def taker(feed):
    return Taker(feed)


def count(fake, verb):
    return sum(call[0] == verb for call in fake.calls)


def test_a_daemon_that_hangs_is_told_before_its_connection_is_closed(
    feed, taker, fake, monkeypatch
):
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
    taker.until(lambda it: it.state.connected)
    fake.reachable = False
    assert closing.wait(DEADLINE)
    connected = taker.take().state.connected
    go_on.set()
    assert not connected


def test_only_what_the_screen_in_front_fetches_is_asked_for(feed, taker, fake, monkeypatch):
    monkeypatch.setattr(feed_module, "_ASSESS_EVERY", 3600.0)

    class RunFront(PageFront):
        def fetch(self, daemon, state):
            return feed.watch.look(daemon, f"{CAMPAIGN}.5")

    feed.start()
    taker.until(lambda it: it.state.connected)
    assert {call[0] for call in fake.calls} == {"open", "overview", "campaigns"}
    page, run = PageFront(), RunFront()
    feed.look_at(page)
    taker.until(lambda it: it.front is page)
    assert len(taker.fetched.rows) == 3
    assert not count(fake, "run")
    feed.look_at(run)
    taker.until(lambda it: it.front is run)
    assert taker.fetched.scene is not None
    assert sum(call[0] == "get" and not call[3] for call in fake.calls) == 1  # kept after that


def test_what_was_judged_is_told_without_asking_anew(feed, taker, fake, monkeypatch):
    monkeypatch.setattr(feed_module, "REFRESH", 3600.0)
    told = []
    feed.on_news = lambda: told.append(None)
    feed.look_at(PageFront())
    feed.start()
    taker.until(lambda it: it.state.results)
    assert count(fake, "campaigns") == 1
    assert told


def test_telemetry_waits_until_it_is_taken_and_does_not_grow(feed, taker, fake):
    fake.live = tuple(make_live(7, float(time)) for time in range(2000))
    feed.start()
    eventually(lambda: fake.listeners)
    taker.until(lambda it: it.lives)
    assert len(taker.lives) == 512
    assert taker.lives[-1].snapshot.time == 1999.0


def test_actions_become_notices(feed, taker, fake):
    feed.enqueue_action(lambda daemon: f"cancelled {daemon.cancel(CAMPAIGN)}")
    feed.enqueue_action(lambda daemon: str(daemon.run("nobody.1")))
    feed.start()
    taker.until(lambda it: len(it.notices) == 2)
    good, bad = taker.notices
    assert good == ("cancelled 2", "information")
    assert bad == ("there is no run nobody.1", "error")


def test_an_action_without_a_daemon_is_told_not_to_be_done(feed, taker, fake):
    fake.reachable = False
    feed.start()
    taker.until(lambda it: it.state.problem)
    feed.enqueue_action(lambda daemon: "done")
    taker.until(lambda it: it.notices)
    assert taker.notices == [("no daemon answers, so nothing was done", "error")]


def test_a_bug_in_the_thread_is_seen_by_whoever_takes(feed, fake):
    def bug(daemon):
        raise KeyError("a bug")

    told = threading.Event()
    feed.on_news = told.set
    fake.before = bug
    feed.start()
    assert told.wait(DEADLINE)
    with pytest.raises(KeyError):
        feed.take_news()


def test_only_an_event_makes_the_feed_look_before_it_is_time(fake, monkeypatch):
    for name, seconds in (("REFRESH", 3600.0), ("_BREATH", 0.005), ("_ASSESS_EVERY", 3600.0)):
        monkeypatch.setattr(feed_module, name, seconds)
    feed = Feed(fake.open)
    taker = Taker(feed)
    feed.start()
    taker.until(lambda it: fake.listeners and it.state.connected)
    eventually(lambda: feed.take_news().state is None)  # what was taken is no news
    for looks in (2, 3):
        fake.listeners[0][0](ChangeEvent(1, "run", f"{CAMPAIGN}.7"))
        eventually(lambda looks=looks: count(fake, "overview") == looks)
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
    eventually(lambda: count(fake, "overview") > 2)


def test_a_daemon_that_goes_while_it_is_asked_for_results_is_noticed(
    feed, taker, fake, monkeypatch
):
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
    taker.until(lambda it: not it.state.connected and it.state.problem)
    silent.set()
    for thread in threading.enumerate():
        if thread.name == "judge":
            thread.join()
    taker.take()  # no bug


@pytest.fixture
def judged():
    return judged_campaign()


def judged_at(fake, took, moments, about):
    """Return at which moments a judge works on a campaign that changes all the time.

    Every question takes ``took`` seconds.
    """
    now = [0.0]
    rows = fake.campaigns()[:1]
    fake.before = lambda _: now.__setitem__(0, now[0] + took)
    judge = CampaignAssessor(clock=lambda: now[0])
    worked = []
    for now[0] in moments:
        judge.touch(CAMPAIGN)
        worked.append(bool(judge.step(fake, rows, about)))
    return worked


@pytest.mark.parametrize(
    ("took", "about", "moments", "works"),
    [
        # Once a second for the screen in front, less often else.
        (0.0, CAMPAIGN, (0.0, 0.5, 1.1, 1.5, 2.2, 7.5), "+-+-++"),
        (0.0, "", (0.0, 0.5, 1.1, 1.5, 2.2, 7.5), "+----+"),
        # Three questions of 2 s each: after 6 s of work follow 18 s of rest.
        (2.0, CAMPAIGN, (0.0, 8.0, 23.0, 25.0), "+--+"),
    ],
)
def test_judging_leaves_most_of_the_time_to_others(judged, took, about, moments, works):
    assert judged_at(judged, took, moments, about) == [sign == "+" for sign in works]


def test_what_did_not_change_is_not_judged_again(judged):
    judge, rows = CampaignAssessor(clock=lambda: 0.0, every=0.0), judged.campaigns()
    assert [judge.step(judged, rows, "") for _ in range(3)] == [CAMPAIGN, OLD, ""]
    assert judge.step(judged, rows, CAMPAIGN)  # now everything about it is wanted
    assert not judge.step(judged, rows, CAMPAIGN)
    assert judge.conclusions[OLD].glyph_text == "✓ as expected"
    assert judge.conclusions[CAMPAIGN].glyph_text == "✗ 1 run unexpected"


def test_of_old_campaigns_those_are_judged_that_nobody_has_acknowledged(judged, monkeypatch):
    judge, rows = CampaignAssessor(clock=lambda: 0.0, every=0.0), judged.campaigns()
    results = read_results(judged, rows[0])
    monkeypatch.setattr("daemon.analysis.results.read_results", lambda *_: results)
    waiting = replace(rows[0], queued=10, running=0, done=0, lost=0)
    newer = [replace(waiting, id=f"newer-{number}") for number in range(100)]
    for number in range(100):
        assert judge.step(judged, [*newer, *rows], newer[number].id)
    assert judge.step(judged, [*newer, *rows], "")
    old = [replace(row, acknowledged=True) for row in rows[1:]]
    assert not judge.step(judged, [*newer, rows[0], *old, replace(waiting, id="old")], "")
    assert CAMPAIGN in judge.conclusions


def test_conclusions_of_deleted_campaigns_are_forgotten(judged):
    judge, rows = CampaignAssessor(clock=lambda: 0.0, every=0.0), judged.campaigns()
    for _ in rows:
        judge.step(judged, rows, CAMPAIGN)
    assert set(judge.conclusions) == {CAMPAIGN, OLD}
    judge.step(judged, [row for row in rows if row.id == OLD], "")
    assert set(judge.conclusions) == {OLD}
    assert not judge.results
