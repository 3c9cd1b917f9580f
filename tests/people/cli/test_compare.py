"""compare and --baseline: two campaigns, from the ledger or from files."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from daemon.analysis.results import read_results
from daemon.model.assessments import AssessmentRules, RegressionGate, RepeatPolicy
from daemon.model.verdicts import Outcome
from scenario_tui.library import execution
from tests.people.fake import CAMPAIGN, NOW, OLD, Entered, FakeDaemon, make_row

Keep = Callable[[FakeDaemon, str], Path]


def rows(campaign=CAMPAIGN, drop=0.0, *, failing=False):
    found = [
        make_row(
            i, campaign=campaign, id=f"{campaign}.{i}", margin=0.5 + i / 100 - drop * (1 + i / 9)
        )
        for i in range(5)
    ]
    if failing:
        found[4] = replace(found[4], outcome=Outcome.FAIL, margin=-0.1)
    return tuple(found)


@pytest.fixture
def two(fake):
    """The newest campaign has smaller margins than the one before, but passes."""
    fake.rows = (*rows(drop=0.2), *rows(OLD))
    fake.declares = AssessmentRules(RepeatPolicy(5))
    return fake


def test_campaigns_are_compared_cell_by_cell(scenario, two):
    said = scenario("compare", OLD, CAMPAIGN)
    assert said.code == 0
    assert f"{OLD} → {CAMPAIGN}" in said.out
    line = next(line for line in said.out.splitlines() if "no-contact (margin)" in line)
    assert line.split()[:2] == ["S1", "pilot"]
    assert "+0.52 m" not in line  # values have no sign, differences do
    assert "0.52 m" in line
    # −0.2 m (1 + i/9) has mean −0.2444 and standard error 0.01571; t(0.975, 4) is 2.776.
    assert "−0.244 m [−0.288, −0.201] n=5" in line
    assert "−1.00 large" in line
    assert line.rstrip().endswith("changed")
    assert "4 quantities tested (t, Holm at 5 %): 1 changed" in said.out


def test_what_got_worse_by_more_than_allowed_leaves_with_one(scenario, two):
    assert scenario("compare", OLD, CAMPAIGN, "--worse-by", "20 %").code == 1
    assert scenario("compare", OLD, CAMPAIGN, "--worse-by", "60 %").code == 0
    assert scenario("compare", CAMPAIGN, OLD, "--worse-by", "0 %").code == 0
    said = scenario("compare", OLD, CAMPAIGN, "--worse-by", "3 m")
    assert (said.code, '"3 m" is in m' in said.err) == (2, True)


def test_a_verdict_that_turned_comes_first(scenario, two):
    two.rows = (*rows(failing=True), *rows(OLD))
    said = scenario("compare", OLD, CAMPAIGN, "--worse-by", "50 %")
    assert "✓ pass 5/5 → ✗ fail 4/5  pilot S1 no-contact  worse" in said.out
    assert said.code == 1


def test_files_of_results_are_as_good_as_campaigns(scenario, two, tmp_path):
    path = tmp_path / "before.json"
    path.write_text(scenario("results", OLD, "--json").out)
    two.empty = True
    found = json.loads(scenario("compare", str(path), str(path), "--json").out)
    assert found["schema"] == "scenario/compare/1"
    assert found["regressed"] is False
    assert [s["mean"] for s in found["comparison"]["shifts"]] == [0.0] * 4


@pytest.mark.parametrize("text", ["", "[]", '{"schema": "scenario/status/1"}', "{}"])
def test_a_file_of_anything_else_is_refused(scenario, tmp_path, text):
    path = tmp_path / "other.json"
    path.write_text(text)
    said = scenario("compare", str(path), str(path))
    assert said.code == 2
    assert "is no file of results" in said.err
    assert "scenario results CAMPAIGN --json" in said.err


def test_a_baseline_makes_results_a_gate(scenario, two):
    assert scenario("results", CAMPAIGN, "--exit-status").code == 0
    said = scenario("results", CAMPAIGN, "--baseline", OLD, "--worse-by", "20 %")
    assert said.code == 1
    assert "1 worse by more than 20 %" in said.out
    assert scenario("results", CAMPAIGN, "--baseline", OLD, "--worse-by", "60 %").code == 0


def test_the_gate_of_a_campaign_holds_it_against_the_last_green_one(scenario, two, fake):
    two.declares = replace(two.declares, gate=RegressionGate("last-green", 0.2))
    fake.more = (Entered(OLD, "first", rows(OLD), NOW - 90_000.0),)
    said = scenario("results", CAMPAIGN, "--exit-status")
    assert f"{OLD} → {CAMPAIGN}" in said.out
    assert said.code == 1


def test_without_an_earlier_green_one_there_is_nothing_to_compare_with(scenario, two):
    said = scenario("results", CAMPAIGN, "--baseline", "last-green")
    assert "no earlier campaign first was as expected" in said.err
    assert said.code == 0


@pytest.mark.parametrize(("allowed", "code"), [("20 %", 1), ("60 %", 0)])
def test_a_campaign_run_here_is_held_against_a_file(
    scenario, two, tmp_path, campaigns, monkeypatch, allowed, code
):
    path = tmp_path / "before.json"
    path.write_text(scenario("results", OLD, "--json").out)
    found = read_results(two, two.campaigns()[0])
    monkeypatch.setattr(execution, "run_here", lambda *_, **__: found)
    demo = str(campaigns / "demo" / "campaign.yaml")
    said = scenario("run", demo, "--json", "--baseline", str(path), "--worse-by", allowed)
    assert said.code == code
    assert any(shift["worse"] for shift in json.loads(said.out)["comparison"]["shifts"]) == code


def test_a_campaign_run_here_may_be_the_first(scenario, two, campaigns, monkeypatch):
    found = replace(
        read_results(two, two.campaigns()[0]),
        declared=AssessmentRules(gate=RegressionGate("last-green", 0)),
    )
    monkeypatch.setattr(execution, "run_here", lambda *_, **__: found)
    two.empty = True
    said = scenario("run", str(campaigns / "demo" / "campaign.yaml"))
    assert "no earlier campaign first was as expected: nothing to compare with yet" in said.err
    assert said.code == 0
