"""Watching a campaign: until its last run, over restarts of the daemon."""

import time
from dataclasses import replace

import pytest
from rich.console import Console

from daemon.batch.errors import DaemonError, Refused, Unreachable
from daemon.model import messages
from daemon.model.status import ChangeEvent, Preparation, PreparationPhase
from daemon.model.verdicts import RunState
from scenario_tui.library import watching
from scenario_tui.library.watching import WatchedRuns, watch
from tests.people.fake import CAMPAIGN, OLD, WAITING, FakeDaemon, make_live, make_row

PREPARING = "compiling kernels 7/42 (once on this machine)"


@pytest.fixture(autouse=True)
def _all_is_noted(caplog):
    caplog.set_level("INFO", "scenario_tui")


def test_watching_ends_with_the_last_run(fake, capsys):
    fake.at({10: FakeDaemon.finish})
    assert watch(fake.open, WatchedRuns(CAMPAIGN)).finished
    assert capsys.readouterr() == ("", "")  # no progress where there is no terminal


def test_watching_survives_a_restart_and_says_so(fake, caplog):
    def reach(daemon, is_there):
        daemon.reachable = is_there

    fake.at({6: lambda it: reach(it, False), 20: lambda it: reach(it, True), 30: FakeDaemon.finish})
    assert watch(fake.open, WatchedRuns(CAMPAIGN)).finished
    assert caplog.messages == [
        "the daemon does not answer, waiting for it (Ctrl-C to leave)",
        "the daemon is back, watching again",
    ]


def test_watching_gives_up_on_a_daemon_that_stays_away(fake):
    fake.reachable = False
    with pytest.raises(Unreachable):
        watch(fake.open, WatchedRuns(CAMPAIGN), patience=0.02)


def test_a_campaign_the_daemon_forgot_is_not_waited_for(fake):
    with pytest.raises(Refused):
        watch(fake.open, WatchedRuns("never-submitted"))


def _drawn(width, row, running=(), live=None, preparing="", began=(0.0, 8)):
    work, console = (
        WatchedRuns(CAMPAIGN, row=row, running=running, began=began),
        Console(width=width),
    )
    with console.capture() as capture:
        console.print(work.draw(live or {}, preparing))
    return capture.get().splitlines()


def test_waiting_for_the_first_run_is_explained(fake):
    fake.rows = tuple(replace(row, state=RunState.QUEUED, outcome=None) for row in fake.rows)
    campaign, waiting = _drawn(80, fake.campaigns()[0])
    assert "0/10 runs" in campaign
    assert waiting == "  waiting for a free slot"
    assert _drawn(80, fake.campaigns()[0], preparing=PREPARING)[1] == f"  {PREPARING}"


def test_runs_that_are_not_shown_are_counted_beside_what_is_prepared(fake):
    running = tuple(make_row(k, state=RunState.RUNNING) for k in range(10))
    lines = _drawn(80, fake.campaigns()[0], running, preparing=PREPARING)
    assert lines[-2:] == [f"  {PREPARING}", "  and 2 more"]


@pytest.mark.parametrize("width", [80, 140])
def test_progress_shows_counts_pace_and_what_runs(fake, width):
    row, live = replace(fake.campaigns()[0], seconds_left=95.0), make_live(7, time=61.0)
    running = (make_row(7, state=RunState.RUNNING),)
    campaign, run = _drawn(
        width, row, running, {live.run: live}, began=(time.monotonic() - 48.0, -2)
    )
    assert len(campaign) <= width
    assert "8/10 runs  1 min 35 s left  ✗ 2 fail  ∅ 1" in campaign
    assert ("12.5 runs/min" in campaign) == (width > 100)
    assert run == "  ▶ running  S2/pilot/2  1/3 wp  61 s of 1200 s"


@pytest.mark.parametrize("width", [60, 140])
def test_a_system_that_is_being_started_says_what_it_waits_for(fake, width):
    live, running = make_live(7, waiting=WAITING), (make_row(7, state=RunState.RUNNING),)
    _, run = _drawn(width, fake.campaigns()[0], running, {live.run: live})
    assert len(run) <= width
    assert "S2/pilot/2  starting my-nav2: 3 of" in run
    assert ("planner_server" in run) == (width > 100)


@pytest.mark.parametrize("pause", [1000.0, 0.0])
def test_what_a_worker_prepares_is_said_again_after_a_while(fake, caplog, monkeypatch, pause):
    monkeypatch.setattr(watching, "_LOOK", 0.0)
    monkeypatch.setattr(watching, "_SAY_AGAIN", pause)
    monkeypatch.setattr(Preparation, "words", property(lambda step: f"{step.done} {step.phase}"))
    looks = 0

    def later(daemon):
        nonlocal looks
        looks += 1
        phase = PreparationPhase.STARTING if looks < 20 else PreparationPhase.COMPILING
        daemon.preparation = Preparation(phase, looks)
        if looks == 40:
            daemon.finish()

    fake.before = later
    assert watch(fake.open, WatchedRuns(CAMPAIGN)).finished
    said = caplog.messages
    phases = [line.partition(" ")[2] for line in said]
    assert list(dict.fromkeys(phases)) == ["starting", "compiling"]
    assert (len(said) == 2) == (pause > 0.0)


def test_a_daemon_that_cannot_run_anything_says_why_and_when_it_is_over(fake, caplog, monkeypatch):
    monkeypatch.setattr(watching, "_LOOK", 0.0)
    fake.trouble = "Traceback\nOSError: the disk is full\n"
    fake.at({20: lambda daemon: setattr(daemon, "trouble", ""), 40: FakeDaemon.finish})
    assert watch(fake.open, WatchedRuns(CAMPAIGN)).finished
    assert caplog.messages == [
        "no run can start: OSError: the disk is full",
        "runs can start again",
    ]


def test_nobody_waits_for_ever_for_a_daemon_of_ones_own_in_trouble(fake, monkeypatch):
    monkeypatch.setattr(watching, "_LOOK", 0.0)
    fake.trouble = "the disk is full"
    with pytest.raises(DaemonError, match="the disk is full"):
        watch(fake.open, WatchedRuns(CAMPAIGN), endurance=0.01)


def test_whoever_waits_asks_for_that_campaign_and_only_when_it_changed(fake, monkeypatch):
    monkeypatch.setattr(watching, "_LOOK", 0.0)
    monkeypatch.setattr(watching, "_POLL", 3600.0)
    monkeypatch.setattr(watching, "INTERVAL", 0.0)

    def tell(daemon, *change):
        for on_event, _ in daemon.listeners:
            on_event(ChangeEvent(1, *change))

    def end(daemon):
        daemon.finish()
        tell(daemon, "campaign", CAMPAIGN, CAMPAIGN, "finished")

    fake.at({50: lambda daemon: tell(daemon, "run", f"{OLD}.0", OLD, "done"), 100: end})
    assert watch(fake.open, WatchedRuns(CAMPAIGN)).finished
    assert [asked[0] for asked in fake.told("campaigns")] == [CAMPAIGN, CAMPAIGN]


def test_all_campaigns_are_asked_for_page_by_page(fake, monkeypatch):
    monkeypatch.setattr(messages, "LARGEST_PAGE", 1)
    assert [row.id for row in fake.campaigns()] == [CAMPAIGN, OLD]
    assert len(fake.told("campaigns")) == 3
