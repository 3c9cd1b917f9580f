"""status and results: for people on a terminal, for scripts with --json."""

import json
from dataclasses import replace

from daemon.model.assessments import AssessmentRules, Expectation, RepeatPolicy, ScenarioComparison
from tests.people.fake import CAMPAIGN, OLD, make_row, make_rows


def test_status_names_daemon_counts_and_campaigns(scenario):
    said = scenario("status")
    assert said.code == 0
    assert "daemon 0.1.0" in said.out
    assert "up 1 h 00 min" in said.out
    assert "2 workers with 6 slots" in said.out
    assert "✗ 2 fail" in said.out
    assert "∅ 1 lost" in said.out
    assert CAMPAIGN in said.out
    assert "8/10" in said.out
    assert "4 min ago" in said.out


def test_status_says_how_many_workers_are_away(scenario, fake):
    fake.away = True
    assert "1 worker with 2 slots, 1 away" in scenario("status").out


def test_status_without_campaigns_says_what_to_type(scenario, fake):
    fake.empty = True
    assert "scenario submit" in scenario("status").out


def test_status_as_json_is_one_object_with_a_schema(scenario):
    said = scenario("status", "--json")
    body = json.loads(said.out)
    assert body["schema"] == "scenario/status/1"
    assert body["overview"]["failed"] == 2
    assert [row["id"] for row in body["campaigns"]] == [CAMPAIGN, OLD]
    assert body["workers"][0]["host"] == "bench"
    assert said.err == ""


def test_results_show_the_matrix_what_is_unexpected_and_where_traces_lie(scenario):
    said = scenario("results", CAMPAIGN)
    assert said.code == 0
    cell = next(line for line in said.out.splitlines() if line.startswith("S2"))
    assert "✗ fail 0/5 ✗✗▶…∅ !  no-contact −0.12 m at 512.2 s" in cell
    assert "2 runs unexpected:" in said.out
    assert "pilot S2 no-contact  −0.12 m  at 512.2 s  door-1  front left corner" in said.out
    assert f"(2 of 5 fail)  → {CAMPAIGN}.6" in said.out
    assert "∅ lost  S2/pilot/4  worker bench-1 went away" in said.out
    assert "not as expected" in said.out
    assert "traces in state/traces" in said.out
    assert "scenario tui" in said.out


def test_what_is_known_is_no_surprise_and_says_why(scenario, fake):
    known = Expectation("S2", "no-contact", ("pilot",), "mixed", "the door is fast")
    fake.declares = replace(fake.declares, expectations=(known,))
    fake.rows = fake.rows[:4] + fake.rows[5:7]
    said = scenario("results", "--exit-status")
    assert "✗ fail 0/2 ✗✗ a  no-contact" in said.out
    assert "a known: the door is fast" in said.out
    assert "everything is as expected" in said.out
    assert "2 of 2 shows a pass rate of at least 22.3 %" in said.out, "of the runs that are there"
    assert (said.code, "unexpected" in said.out) == (0, False)
    assert "known: the door is fast" in scenario("status").out
    listed = scenario("results", "--outcome", "fail").out
    assert listed.count("✗ fail a") == 2
    assert "a known: the door is fast" in listed


def test_news_are_marked_in_status_and_in_lists(scenario):
    assert "! 2 runs unexpected" in scenario("status").out
    assert scenario("results", "--runs").out.count("✗ fail ! ") == 2


def test_a_pass_nobody_expected_is_red_too(scenario, fake):
    known = Expectation("S1", "no-contact", (), "fail", "it always hits")
    fake.declares = replace(fake.declares, expectations=(known,))
    fake.rows = fake.rows[:4]
    said = scenario("results", "--exit-status")
    assert said.code == 1
    assert "passes 4 of 4, expected fail  known: it always hits" in said.out


def test_what_is_not_shown_yet_says_how_many_runs_are_missing(scenario, fake):
    fake.declares = AssessmentRules(RepeatPolicy(5, "rate", 0.8))
    fake.rows = tuple(make_row(i) for i in range(5))
    said = scenario("results", "--exit-status")
    assert said.code == 4
    assert "2 oracles undecided:" in said.out
    assert "pilot S1 no-contact  5 of 5 shows at least 54.9 %, 9 more runs needed" in said.out


def test_systems_under_test_stand_side_by_side(scenario, fake):
    fake.rows = tuple(
        make_row(10 * (s - 1) + 5 * j + i, scenario=f"S{s}", sut=sut, repeat=i,
                 simulated=300.0 + 10 * s * (1 + j) + i / 7)
        for s in (1, 2) for j, sut in enumerate(("slow", "fast")) for i in range(5)
    )  # fmt: skip
    delay = ScenarioComparison(
        "late", "delay", "S2", "S1", None, "<=", 15.0, "s", "delay(S2 vs S1) <= 15 s"
    )
    fake.declares = AssessmentRules(RepeatPolicy(5), (delay,))
    said = scenario("results", "--exit-status").out.splitlines()
    head = next(line for line in said if line.startswith("scenario"))
    assert head.split() == ["scenario", "slow", "fast"]
    assert (
        next(line for line in said if line.startswith("S1")).split()[1:] == ["✓", "pass", "5/5"] * 2
    )
    late = next(line for line in said if line.startswith("late"))
    assert "✓ pass +10 s [+10, +10] n=5" in late
    assert "✗ fail +20 s [+20, +20] n=5 !" in late
    assert "delay(S2 vs S1) <= 15 s" in late


def test_what_is_not_repeatable_is_marked_where_it_is_named(scenario, fake):
    fake.rows = tuple(
        make_row(i + j, sut=sut, repeat=i, repeatable=sut == "pilot")
        for j, sut in ((0, "pilot"), (2, "nav2"))
        for i in range(2)
    )
    said = scenario("results").out
    head = next(line for line in said.splitlines() if line.startswith("scenario"))
    assert head.split("  ")[-1].strip() == "nav2 (not repeatable)"
    assert "pilot (not" not in said
    assert "nav2: not repeatable, equal runs may differ and no result is used again" in said
    assert [row["repeatable"] for row in json.loads(scenario("results", "--json").out)["runs"]] == [
        True,
        True,
        False,
        False,
    ]


def test_results_default_to_the_newest_campaign(scenario, fake):
    scenario("results")
    assert ("runs", CAMPAIGN, "", "", "", "index", False, 0, 500, "", "", True) in fake.calls


def test_a_campaign_is_found_by_name_and_by_its_beginning(scenario):
    assert json.loads(scenario("results", "nightly", "--json").out)["campaign"]["id"] == OLD
    assert json.loads(scenario("results", "first-a", "--json").out)["campaign"]["id"] == CAMPAIGN


def test_an_unknown_campaign_is_refused_with_a_suggestion(scenario):
    said = scenario("results", "nightlee")
    assert said.code == 2
    assert 'there is no campaign "nightlee": did you mean "nightly"?' in said.err


def test_a_run_in_place_of_a_campaign_is_told_from_a_typing_error(scenario):
    said = scenario("results", "first.1")
    assert said.code == 2
    assert f"first.1 is a run of {CAMPAIGN}: `scenario show` tells about it" in said.err
    assert "is no run: those of" in scenario("results", "first.99").err


def test_results_leave_with_the_campaigns_code_when_asked(scenario, fake):
    assert scenario("results").code == 0
    assert scenario("results", "--exit-status").code == 1
    fake.rows = fake.rows[:4]
    assert scenario("results", "--exit-status").code == 0
    fake.rows = (*fake.rows, make_rows()[9])
    assert scenario("results", "--exit-status").code == 3


def test_runs_that_cannot_be_reproduced_are_named(scenario, fake):
    differing = make_row(1, reason="this gave a, old.1 gave b", nondeterministic=True)
    fake.rows = (make_row(0, reason="nondeterministic: a word, no more"), differing)
    said = scenario("results").out
    assert "1 run not reproducible:" in said
    assert "✓ pass  S1/pilot/1  this gave a, old.1 gave b" in said


def test_a_filter_lists_the_runs_it_admits(scenario):
    said = scenario("results", "--outcome", "fail")
    listed = [line.split()[:2] for line in said.out.splitlines()[2:-1]]
    assert listed == [[f"{CAMPAIGN}.5", "S2/pilot/0"], [f"{CAMPAIGN}.6", "S2/pilot/1"]]


def test_a_cached_run_says_so(scenario, fake):
    fake.rows = (make_row(0, cached="old.3"), make_row(1, cached="old.4", trace="", reason="gone"))
    said = scenario("results", "--runs").out
    assert "S1.pilot.0.mcap (cached)" in said
    assert "gone (cached)" in said


def test_results_list_every_run_with_its_trace(scenario):
    said = scenario("results", "--runs")
    assert f"state/traces/{CAMPAIGN}/S1.pilot.3.mcap" in said.out
    assert "S2/pilot/4" in said.out


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
