"""What commands ask of a daemon, what scripts are told, and how they stay until it is over."""

import json
from dataclasses import replace

import pytest

from daemon.analysis.results import read_results
from daemon.batch.ledger import LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.model.assessments import AssessmentRules, RegressionGate, RepeatPolicy
from daemon.model.messages import ReleaseRequest
from scenario_tui.library import execution, job
from tests.make import make_submission
from tests.people.fake import CAMPAIGN, OLD, spread_rows, state_paths

CONTACT = '{"endpoint": "%s", "pid": 1, "version": "0", "started_at": 0.0}'


def test_scripts_are_told_every_run_of_the_newest_campaign(scenario):
    body = json.loads(scenario("results", "--json").out)
    assert (body["campaign"]["id"], len(body["runs"])) == (CAMPAIGN, 10)
    assert body["runs"][5]["result"]["verdicts"][0]["oracle"] == "no-contact"
    assert body["assessment"]["exit_code"] == 1
    assert body["assessment"]["surprises"][0]["run"] == f"{CAMPAIGN}.6"
    assert body["declared"]["policy"]["n"] == 5
    begun = json.loads(scenario("results", "first-a", "--json").out)
    assert begun["campaign"]["id"] == CAMPAIGN


def test_stop_copes_with_a_daemon_that_is_gone_at_once(scenario, fake, monkeypatch, tmp_path):
    contact = tmp_path / "daemon.json"
    contact.write_text(CONTACT % "tcp/127.0.0.1:4711")
    monkeypatch.setattr(fake, "shutdown", contact.unlink)
    said = scenario("daemon", "--stop", "--state", str(tmp_path))
    assert said.code == 0
    assert "the daemon at tcp/127.0.0.1:4711 is stopping" in said.err


def test_people_see_the_path_of_a_socket_and_programs_the_endpoint(scenario, fake, tmp_path):
    endpoint = f"unixsock-stream/{tmp_path}/daemon.sock"
    (tmp_path / "daemon.json").write_text(CONTACT % endpoint)
    for command in (["status"], ["daemon", "--stop"]):
        said = scenario(*command, "--state", str(tmp_path))
        assert f"at {tmp_path}/daemon.sock" in said.out + said.err
        assert f'"{endpoint}"' in scenario(*command, "--state", str(tmp_path), "--json").out
    assert ("shutdown",) in fake.calls


def test_delete_removes_campaigns_and_says_what_went(scenario, fake):
    folder = state_paths().traces / OLD
    folder.mkdir()
    for name in "abc":
        (folder / f"{name}.mcap").write_bytes(bytes(2**20))
    said = scenario("delete", "nightly", "--dry-run")
    assert f"would have deleted {OLD}: 4 runs, 3 traces, 3.0 MiB" in said.err
    body = json.loads(scenario("delete", "nightly", OLD, "--yes", "--json").out)
    gone = {"campaign": OLD, "runs": 4, "traces": 3, "bytes": 3 * 2**20}
    assert body == {"schema": "scenario/delete/1", "dry_run": False, "campaigns": [gone]}
    assert (fake.campaign(OLD), folder.exists()) == (None, False)


def test_who_names_one_campaign_does_not_ask_for_all(scenario, fake):
    for command in ("pause", "cancel", "results", "retry"):
        scenario(command, CAMPAIGN)
    asked = [call for call in fake.calls if call[0] == "campaigns"]
    assert {call[1:3] for call in asked} == {(CAMPAIGN, "")}


def test_logs_tell_attempts_reasons_and_what_is_printed(scenario, tmp_path):
    places = StatePaths(tmp_path)
    with LedgerWriter.open(places) as ledger:
        ledger.submit(make_submission("c-1", 2), 1e6)
        (grant,) = ledger.lease("w", 1, 1e6)
        reason = "the SUT crashed\nsegfault"
        ledger.release(ReleaseRequest("w", grant.run, grant.token, reason, True), 1e6)
    output = tmp_path / "spool" / "w" / "c-1.1" / "attempt-1" / "output.txt"
    output.parent.mkdir(parents=True)
    output.write_text("loading the map\n")

    def told(run, *more):
        return scenario("show", run, "--log", "--state", str(tmp_path), *more).out

    lines = [line.split()[2:] for line in told("c.0").splitlines()[:2]]
    assert lines == [["running"], ["queued", "the", "SUT", "crashed"]]
    assert told("c.0").count("the SUT crashed") == 1
    steps = json.loads(told("c-1.0", "--json"))["steps"]
    assert [step["state"] for step in steps] == ["running", "queued"]
    assert "loading the map" in told("c-1.1")


def test_waiting_leaves_with_the_code_of_the_campaign(scenario, fake):
    looks = iter(range(10))
    fake.before = lambda daemon: next(looks, None) is None and daemon.finish()
    said = scenario("wait", "first")
    assert said == (1, "", f"{CAMPAIGN}: ✗ 2 runs unexpected\n")
    assert json.loads(scenario("wait", "first", "--json").out)["assessment"]["exit_code"] == 1


def test_leaving_stops_the_waiting_only(scenario, fake, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(job, "watch", interrupted)
    said = scenario("wait", "first")
    assert said.code == 130
    assert f"{CAMPAIGN} continues" in said.err
    assert fake.told("cancel") == []


@pytest.fixture
def away(fake, monkeypatch, tmp_path):
    """A state directory of a daemon that does not answer until it was asked four times."""
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path))
    asked = iter(range(4))
    fake.reachable = False

    def before(daemon):
        if next(asked, None) is None:
            daemon.reachable = True
            daemon.finish()

    fake.before = before
    return tmp_path


@pytest.mark.parametrize("by_name", [True, False])
def test_a_daemon_that_is_away_at_first_is_waited_for(scenario, away, by_name):
    if not by_name:
        (away / "ledger.db").touch()
    where = ("--connect", "tcp/127.0.0.1:7447") if by_name else ()
    said = scenario("wait", "first", *where)
    assert said.code == 1
    assert said.err.splitlines() == [
        "the daemon does not answer, waiting for it (Ctrl-C to leave)",
        f"{CAMPAIGN}: ✗ 2 runs unexpected",
    ]


def test_where_there_never_was_a_daemon_nobody_waits(scenario, away):
    said = scenario("wait", "first")
    assert said.code == 3
    assert "waiting" not in said.err
    (away / "ledger.db").touch()
    assert scenario("wait", "first", "--timeout", "0s").code == 3


@pytest.fixture
def two(fake):
    """The newest campaign has smaller margins than the one before, but passes."""
    fake.rows = (*spread_rows(CAMPAIGN, 0.2), *spread_rows(OLD))
    fake.declares = AssessmentRules(RepeatPolicy(5))
    return fake


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
    rules = AssessmentRules(gate=RegressionGate("last-green", 0))
    found = replace(read_results(two, two.campaigns()[0]), declared=rules)
    monkeypatch.setattr(execution, "run_here", lambda *_, **__: found)
    two.empty = True
    said = scenario("run", str(campaigns / "demo" / "campaign.yaml"))
    assert "no earlier campaign first was as expected: nothing to compare with yet" in said.err
    assert said.code == 0
