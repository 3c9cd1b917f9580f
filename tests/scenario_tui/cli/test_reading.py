"""status and results: for people on a terminal, for scripts with --json."""

from __future__ import annotations

import json

from tests.scenario_tui.fake import CAMPAIGN, OLD


def test_status_names_daemon_counts_and_campaigns(scenario) -> None:
    said = scenario("status")
    assert said.code == 0
    assert "daemon 0.1.0" in said.out
    assert "up 1 h 00 min" in said.out
    assert "1 worker with 6 slots" in said.out
    assert "✗ 2 fail" in said.out
    assert "! 1 lost" in said.out
    assert CAMPAIGN in said.out
    assert "8/10" in said.out
    assert "4 min ago" in said.out


def test_status_without_campaigns_says_what_to_type(scenario, fake) -> None:
    fake.empty = True
    assert "scenario submit" in scenario("status").out


def test_status_as_json_is_one_object_with_a_schema(scenario) -> None:
    said = scenario("status", "--json")
    body = json.loads(said.out)
    assert body["schema"] == "scenario/status/1"
    assert body["overview"]["failed"] == 2
    assert [row["id"] for row in body["campaigns"]] == [CAMPAIGN, OLD]
    assert body["workers"][0]["host"] == "bench"
    assert said.err == ""


def test_results_show_cells_problems_and_where_traces_lie(scenario) -> None:
    said = scenario("results", CAMPAIGN)
    assert said.code == 0
    cell = next(line for line in said.out.splitlines() if line.startswith("S2"))
    assert "✗✗▶…!" in cell
    assert "✗ 2 fail" in cell
    assert "no-contact −0.12 m" in cell
    assert "1 at 512.2 s" in cell
    assert "✗ fail  S2/pilot/0" in said.out
    assert "no-contact: −0.0312 m at 512.2 s, door-1, front left corner" in said.out
    assert "worker bench-1 went away" in said.out
    assert "traces in state/traces" in said.out
    assert "scenario tui" in said.out


def test_results_default_to_the_newest_campaign(scenario, fake) -> None:
    scenario("results")
    assert ("runs", CAMPAIGN, "", "", "", "index", False, 0, 500) in fake.calls


def test_a_campaign_is_found_by_name_and_by_its_beginning(scenario) -> None:
    assert json.loads(scenario("results", "nightly", "--json").out)["campaign"]["id"] == OLD
    assert json.loads(scenario("results", "first-a", "--json").out)["campaign"]["id"] == CAMPAIGN


def test_an_unknown_campaign_is_refused_with_a_suggestion(scenario) -> None:
    said = scenario("results", "nightlee")
    assert said.code == 2
    assert 'there is no campaign "nightlee": did you mean "nightly"?' in said.err


def test_results_leave_with_the_verdicts_code_when_asked(scenario) -> None:
    assert scenario("results").code == 0
    assert scenario("results", "--exit-status").code == 1
    assert scenario("results", "--outcome", "pass", "--exit-status").code == 0
    assert scenario("results", "--outcome", "inconclusive", "--exit-status").code == 4


def test_results_list_every_run_with_its_trace(scenario) -> None:
    said = scenario("results", "--runs")
    assert f"state/traces/{CAMPAIGN}/S1.pilot.3.mcap" in said.out
    assert "S2/pilot/4" in said.out


def test_results_as_json_hold_every_run(scenario) -> None:
    body = json.loads(scenario("results", "--json").out)
    assert body["schema"] == "scenario/results/1"
    assert len(body["runs"]) == 10
    assert body["runs"][5]["outcome"] == "fail"


def test_all_runs_are_gathered_page_by_page(fake) -> None:
    from scenario_tui import asking

    fake.rows = fake.rows * 60
    assert len(asking.all_runs(fake, CAMPAIGN)) == 600
    assert [call[7] for call in fake.calls if call[0] == "runs"] == [0, 500]
