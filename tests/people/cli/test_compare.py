"""compare and --baseline: two campaigns, from the ledger or from files."""

import json
from dataclasses import replace

import pytest

from daemon.analysis.results import read_results
from daemon.model.assessments import AssessmentRules, RegressionGate, RepeatPolicy
from scenario_tui.library import execution
from tests.people.fake import CAMPAIGN, OLD, spread_rows


@pytest.fixture
def two(fake):
    """The newest campaign has smaller margins than the one before, but passes."""
    fake.rows = (*spread_rows(CAMPAIGN, 0.2), *spread_rows(OLD))
    fake.declares = AssessmentRules(RepeatPolicy(5))
    return fake


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
