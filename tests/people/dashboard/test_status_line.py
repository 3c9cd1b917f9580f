"""The first line answers "is it fine?" at every width, and what matters most is cut last."""

from dataclasses import replace

import pytest

from daemon.model.status import Preparation, PreparationPhase, Trouble, TroubleCause
from scenario_tui.dashboard.state import Known
from scenario_tui.dashboard.widgets.status_line import status_text
from scenario_tui.text.results import NONE_JUDGED, Conclusion
from scenario_tui.text.styles import KNOWN
from tests.people.fake import CAMPAIGN, NOW, OLD, FakeDaemon

SMALL = FakeDaemon().overview()
LARGE = replace(
    SMALL, done=82_469, passed=81_234, failed=1200, inconclusive=33, lost=7, errors=2,
    queued=15_000, running=64, cancelled=12, seconds_left=7500.0,
)  # fmt: skip
CAMPAIGNS = FakeDaemon().campaigns()
FINE = Conclusion("pass", "as expected", verdicts=4, runs=4)
JUDGED = {CAMPAIGN: Conclusion("fail", "3 runs unexpected", 3, known=2), OLD: FINE}
HALTED = replace(LARGE, halted=True, troubles=(Trouble("the disk is full", TroubleCause.SPACE),))


def line(width, **known):
    found = Known(True, at=NOW, overview=SMALL, campaigns=CAMPAIGNS, conclusions=JUDGED)
    return status_text(replace(found, **known), NOW + 75.0, width).plain


def test_with_room_everything_is_said_in_words():
    assert line(180) == (
        "✓ connected  ✗ first: 3 runs unexpected, 2 known  11 verdicts of 14 runs, 12.5 runs/min, "
        "1 min 35 s left  ✗ 2 fail  ∅ 1 lost  ? 1 inconclusive  ✓ 8 pass  ▶ 1 running  … 1 queued"
    )


def test_the_last_words_go_first():
    assert line(120) == (
        "✓ connected  ✗ first: 3 runs unexpected, 2 known  11/14 verdicts, 1 min left  "
        "✗2 fail ∅1 lost ?1 ✓8 ▶1 …1"
    )


@pytest.mark.parametrize(
    ("overview", "width", "expected"),
    [
        (SMALL, 88, "11/14 verdicts, 1 min left  ✗2 fail ∅1 lost ?1 ✓8 ▶1 …1"),
        (SMALL, 78, "11/14 verdicts, 1 min left  ✗2 fail ∅1 lost ?1 ▶1 …1"),
        (SMALL, 38, "11/14, 1 mi…"),
        (LARGE, 78, "82k/97k, 2 h left  ✗1,200 fail ‼2 err ∅7 lost ?33 ▶…"),
    ],
)
def test_where_it_is_narrow_words_go_before_numbers(overview, width, expected):
    assert line(width, overview=overview) == f"✓  ✗ first: 3 unexpected  {expected}"


@pytest.mark.parametrize("known", [None, Conclusion("running", NONE_JUDGED), FINE])
def test_nothing_is_as_expected_before_all_is_judged(known):
    conclusions = {OLD: FINE} if known is None else {OLD: FINE, CAMPAIGN: known}
    rows = tuple(replace(row, queued=0, running=0) for row in CAMPAIGNS)
    shown = line(160, conclusions=conclusions, campaigns=rows)
    assert "as expected" not in shown
    assert "… judging" in shown


def test_a_newer_campaign_hides_no_failure_until_somebody_acknowledges_it():
    first, old = CAMPAIGNS
    again = replace(first, id="first-again", failed=0)
    cancelled = Conclusion("cancelled", "cancelled")
    conclusions = {**JUDGED, again.id: cancelled}
    assert "✗ first: 3 runs unexpected" in line(
        160, campaigns=(again, first, old), conclusions=conclusions
    )
    seen = replace(first, acknowledged=True)
    shown = line(160, campaigns=(again, seen, old), conclusions=conclusions)
    assert "✓ as expected" in shown
    assert "unexpected" not in shown


def test_where_all_is_acknowledged_nothing_is_new():
    seen = tuple(replace(row, acknowledged=True) for row in CAMPAIGNS)
    shown = line(160, campaigns=seen)
    assert "nothing new" in shown
    assert "expected" not in shown


def test_nothing_is_new_only_once_all_is_judged():
    first, old = CAMPAIGNS
    shown = line(160, campaigns=(replace(first, acknowledged=True), old), conclusions={})
    assert "… judging" in shown
    assert "nothing new" not in shown


def test_failures_are_red_as_long_as_they_may_be_news():
    def style(**known):
        shown = Known(True, at=NOW, overview=SMALL, campaigns=CAMPAIGNS, **known)
        text = status_text(shown, NOW, 180)
        return next(
            str(one.style) for one in text.spans if "fail" in text.plain[one.start : one.end]
        )

    assert style(conclusions=JUDGED) == style(conclusions={}) == "fail"
    fine = {CAMPAIGN: Conclusion("pass", "as expected", known=2), OLD: FINE}
    assert style(conclusions=fine) == KNOWN


@pytest.mark.parametrize("width", range(1, 200))
def test_it_never_runs_over(width):
    for overview in (SMALL, LARGE, HALTED):
        assert len(line(width, overview=overview)) <= width
    for problem in ("no daemon answers at tcp/127.0.0.1:7447: start one", "keys: unreadable"):
        assert len(line(width, connected=False, problem=problem, refused=True)) <= width


@pytest.mark.parametrize("width", [198, 78, 38, 18])
def test_that_no_run_can_start_is_said_at_every_width(width):
    shown = line(width, overview=HALTED)
    assert "! no run" in shown
    assert "! no worker" in line(width, overview=replace(SMALL, workers=0))


@pytest.mark.parametrize("width", [198, 120, 78])
@pytest.mark.parametrize("words", ["compiling kernels: 42 so far", "42: machine code is made"])
def test_how_far_compiling_is_is_said_at_every_usual_width(width, words, monkeypatch):
    monkeypatch.setattr(Preparation, "words", words)
    compiling = Preparation(PreparationPhase.COMPILING, 42)
    first = replace(SMALL, passed=0, failed=0, inconclusive=0, lost=0, running=2, queued=13,
                    rate=0.0, seconds_left=None, preparation=compiling)  # fmt: skip
    shown = line(width, overview=first, conclusions={})
    assert words in shown or ("42" in shown and "kernels" in shown)


def test_a_worker_that_starts_is_no_missing_worker():
    starting = Preparation(PreparationPhase.STARTING)
    shown = line(120, overview=replace(SMALL, workers=0, preparation=starting))
    assert "! no worker" not in shown
    assert "starting" in shown


def test_failures_that_a_search_was_asked_to_find_are_told_apart():
    overview = replace(SMALL, failed=0, searched=9)
    assert "9 found by searches" in line(200, overview=overview)
    shown = line(90, overview=overview)
    assert "9 found" in shown
    assert "✗9" not in shown


def test_that_everything_is_paused_is_said():
    paused = tuple(replace(row, paused=True) for row in CAMPAIGNS)
    assert "‖ paused" in line(180, campaigns=paused)
    assert "paused" not in line(180)


def test_a_campaign_of_which_nothing_is_judged_does_not_stand_beside_what_has_passed():
    shown = line(180, conclusions={CAMPAIGN: Conclusion("running", NONE_JUDGED)})
    assert NONE_JUDGED not in shown
    assert "pass" in shown


def test_that_older_campaigns_are_left_out_is_said():
    overview = replace(SMALL, campaigns=501)
    assert "✗ first: 3 unexpected  of the newest 500  11" in line(120, overview=overview)
    assert "newest" not in line(120)


def test_nothing_to_do_is_fine():
    nothing = replace(SMALL, **dict.fromkeys(
        ("queued", "running", "done", "lost", "cancelled", "passed", "failed", "inconclusive",
         "errors"), 0), seconds_left=None)  # fmt: skip
    shown = line(78, overview=nothing, campaigns=(), conclusions={})
    assert shown == "✓ connected  nothing to do"


@pytest.mark.parametrize(
    ("width", "expected"),
    [
        (78, "! no daemon answers, data is 1 min 15 s old, reconnecting"),
        (50, "! no daemon, data is 1 min old, reconnecting"),
        (28, "! no daemon, 1 min old"),
    ],
)
def test_a_gone_daemon_is_said_with_the_age_of_everything_else(width, expected):
    said = "no daemon answers at tcp/127.0.0.1:7447: start one with `scenario daemon`"
    assert line(width, connected=False, problem=said) == expected


def test_a_daemon_that_is_not_understood_is_not_called_gone():
    said = "the daemon's answer is not understood, versions differ? overview.rate: missing"
    shown = line(78, connected=False, problem=said, refused=True)
    assert shown == "! the daemon's answer is not understood, versions differ, data is 1 min old"


def test_before_the_first_answer_it_is_connecting():
    assert status_text(Known(), NOW, 78).plain == "… connecting"
    assert line(78, overview=None) == "… connecting"
