"""The matrix of a campaign: the dashboard judges as the command line does."""

from dataclasses import replace

import pytest

from daemon.analysis.results import read_results
from scenario_tui.dashboard.campaign_assessor import CampaignAssessor
from tests.people.dashboard.daemons import judged_campaign
from tests.people.fake import CAMPAIGN, OLD


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
