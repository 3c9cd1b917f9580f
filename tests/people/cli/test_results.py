"""status and results: for people on a terminal, for scripts with --json."""

import json

from tests.people.fake import CAMPAIGN, OLD, make_row


def test_status_as_json_is_one_object_with_a_schema(scenario):
    said = scenario("status", "--json")
    body = json.loads(said.out)
    assert body["schema"] == "scenario/status/1"
    assert body["overview"]["failed"] == 2
    assert [row["id"] for row in body["campaigns"]] == [CAMPAIGN, OLD]
    assert body["workers"][0]["host"] == "bench"
    assert said.err == ""


def test_results_default_to_the_newest_campaign(scenario, fake):
    scenario("results")
    assert ("runs", CAMPAIGN, "", "", "", "index", False, 0, 500, "", "", True) in fake.calls


def test_a_campaign_is_found_by_name_and_by_its_beginning(scenario):
    assert json.loads(scenario("results", "nightly", "--json").out)["campaign"]["id"] == OLD
    assert json.loads(scenario("results", "first-a", "--json").out)["campaign"]["id"] == CAMPAIGN


def test_results_as_json_hold_every_run(scenario):
    body = json.loads(scenario("results", "--json").out)
    assert body["schema"] == "scenario/results/1"
    assert len(body["runs"]) == 10
    assert body["runs"][5]["outcome"] == "fail"
    assert body["runs"][5]["result"]["verdicts"][0]["oracle"] == "no-contact"
    assert body["assessment"]["exit_code"] == 1
    assert body["assessment"]["surprises"][0]["run"] == f"{CAMPAIGN}.6"
    assert body["declared"]["policy"]["n"] == 5


def test_all_runs_are_gathered_page_by_page(fake):

    fake.rows = tuple(make_row(i, repeat=i) for i in range(600))
    assert len(fake.all_runs(CAMPAIGN)) == 600
    assert [call[7] for call in fake.calls if call[0] == "runs"] == [0, 500]
