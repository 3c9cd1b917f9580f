"""What commands say about the campaigns of a daemon, whatever became of these."""

from dataclasses import replace
from pathlib import Path

import pytest

from daemon.model.assessments import (
    AssessmentRules,
    Expectation,
    RegressionGate,
    RepeatPolicy,
    ScenarioComparison,
)
from daemon.model.verdicts import Outcome, RunState
from tests.analysis.report.recordings import OPEN, SHUT, SUTS, record, spec
from tests.engine.judging.traces import CORRIDOR
from tests.make import FRESH
from tests.people.fake import (
    CAMPAIGN,
    NOW,
    OLD,
    Entered,
    make_row,
    make_rows,
    spread_rows,
    state_paths,
    store_scene,
)
from tests.people.fake_search import make_answer, make_proposals, make_search
from tests.people.recorded import result_of_trace

DELAY = ScenarioComparison(
    "late", "delay", "S2", "S1", None, "<=", 15.0, "s", "delay(S2 vs S1) <= 15 s"
)


@pytest.fixture(autouse=True)
def _here(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)


def expect(fake, scenario, verdict, why):
    known = Expectation(scenario, "no-contact", (), verdict, why)
    fake.declares = replace(fake.declares, expectations=(known,))


def with_known_failures(fake):
    expect(fake, "S2", "mixed", "the door is fast")
    fake.rows = fake.rows[:4] + fake.rows[5:7]


def with_surprising_passes(fake):
    expect(fake, "S1", "fail", "it always hits")
    fake.rows = fake.rows[:4]


def undecided(fake):
    fake.declares = AssessmentRules(RepeatPolicy(5, "rate", 0.8))
    fake.rows = tuple(make_row(i) for i in range(5))


def of_two_systems(fake):
    fake.rows = tuple(
        make_row(10 * s + 5 * j + i, scenario=f"S{s + 1}", sut=sut, repeat=i,
                 simulated=310.0 + 10 * s * (1 + j) + 10 * j + i / 7, repeatable=sut == "slow")
        for s in (0, 1) for j, sut in enumerate(("slow", "fast")) for i in range(5)
    )  # fmt: skip
    fake.declares = AssessmentRules(RepeatPolicy(5), (DELAY,))


def with_odd_runs(fake):
    """One differed from its first execution, one was lost, and of one the trace is gone."""
    differing = make_row(1, reason="this gave a, old.1 gave b", nondeterministic=True)
    noted = make_row(0, reason="nondeterministic: a word, no more")
    cached = (make_row(2, cached="old.3"), make_row(3, cached="old.4", trace=""))
    fake.rows = (noted, differing, *cached, make_rows()[9])


def with_nothing(fake):
    fake.empty = True


def with_a_worker_away(fake):
    fake.away = True


def with_a_search(state, **changes):
    def set_up(fake):
        fake.found, fake.proposed = (make_search(state, **changes),), make_proposals()
        Path("campaign.yaml").write_text("campaign: house\n")

    return set_up


def with_smaller_margins(fake, *, failing=False):
    """The newest campaign has smaller margins than the one before."""
    fake.declares = AssessmentRules(RepeatPolicy(5))
    fake.rows = (*spread_rows(CAMPAIGN, 0.2), *spread_rows(OLD))
    if failing:
        failed = replace(fake.rows[4], outcome=Outcome.FAIL, margin=-0.1)
        fake.rows = tuple(failed if row.id == failed.id else row for row in fake.rows)


def with_a_turned_verdict(fake):
    with_smaller_margins(fake, failing=True)


def with_a_gate(fake):
    with_smaller_margins(fake)
    fake.declares = replace(fake.declares, gate=RegressionGate("last-green", 0.2))
    fake.more = (Entered(OLD, "first", spread_rows(OLD), NOW - 90_000.0),)


SET_UPS = {
    "usual": lambda fake: None,
    "steered": lambda fake: None,
    "known failures": with_known_failures,
    "surprising passes": with_surprising_passes,
    "undecided": undecided,
    "two systems": of_two_systems,
    "odd runs": with_odd_runs,
    "nothing": with_nothing,
    "worker away": with_a_worker_away,
    "smaller margins": with_smaller_margins,
    "turned verdict": with_a_turned_verdict,
    "gate": with_a_gate,
    "search finished": with_a_search("finished"),
    "search running": with_a_search("running"),
    "search waiting": with_a_search("waiting", answer=make_answer()),
}


@pytest.mark.parametrize("name", SET_UPS)
def test_campaigns_are_told_as_they_stand(name, fake, transcript, under_way):
    SET_UPS[name](fake)
    transcript(name.replace(" ", "_"))


RULES = AssessmentRules(
    RepeatPolicy(n=2),
    (ScenarioComparison("delay", "delay", "S1", "S2", None, "<=", 30.0, "s", "delay(S1 vs S2)"),),
    (Expectation("S1", "buffer", (), "fail", "the corridor is narrow"),),
)
NEW = FRESH | {"worker": "", "attempt": 0}
STATES = {
    "queued": NEW | {"state": RunState.QUEUED},
    "paused": NEW | {"state": RunState.QUEUED},
    "running": NEW | {"state": RunState.RUNNING, "worker": "bench-1", "attempt": 1},
    "retrying": NEW | {"state": RunState.QUEUED, "attempt": 7, "reason": "the stack crashed"},
    "cancelled": NEW | {"state": RunState.CANCELLED, "reason": "cancelled"},
    "lost": NEW | {"state": RunState.LOST, "attempt": 3, "reason": "the stack crashed"},
    "half": NEW | {"state": RunState.QUEUED},
}
"""Campaigns by the state of their runs: of ``half`` S1 has finished, of ``running`` one runs."""


def campaign_in(state):
    """Four runs of two scenarios; those that have finished are recorded."""
    campaign, rows, specs = f"{state}-1", [], []
    for index in range(4):
        scenario, like = (("S1", SHUT), ("S2", OPEN))[index // 2]
        run = replace(spec(like, SUTS[0], index % 2), scenario=scenario, campaign=campaign)
        changes = STATES["queued" if state == "running" and index else state]
        row = make_row(index, id=f"{campaign}.{index}", campaign=campaign, scenario=scenario,
                       sut=SUTS[0], repeat=index % 2, limit=run.limit)  # fmt: skip
        if state == "half" and scenario == "S1":
            path = record(state_paths().traces / campaign / f"{index}.mcap", run)
            result = result_of_trace(path)
            changes = {"outcome": result.outcome, "oracle": "buffer", "trace": str(path)}
            changes |= {"result": result}
        rows.append(replace(row, **changes))
        specs.append(run)
    store_scene(CORRIDOR)
    changes = {"paused": 1} if state == "paused" else {}
    return Entered(
        campaign, state, tuple(rows), NOW - 60.0, "", changes=changes, specs=specs, declares=RULES
    )


@pytest.mark.parametrize("state", STATES)
def test_what_has_no_result_is_told_by_its_state_and_never_by_a_verdict(state, fake, transcript):
    fake.rows, fake.more = (), (campaign_in(state), campaign_in("queued"))
    text = transcript(f"state_{state}")
    for words in ("inconclusive", "did not end the mission", "no oracle", "not remembered"):
        assert words not in text
    junit = Path("r.xml").read_text()
    assert "inconclusive" not in junit
    word = {"paused": "queued", "retrying": "queued"}.get(state, state)
    if state != "half":
        assert f'message="no run has a result: {word}" type="{word}"' in junit
