"""cancel, retry, stop: they do what was asked and say what they did."""

import json

from tests.people.fake import CAMPAIGN, OLD, state_paths


def test_cancel_cancels_the_campaign_meant(scenario, fake):
    said = scenario("cancel", "first")
    assert ("cancel", CAMPAIGN) in fake.calls
    assert said.code == 0
    assert f"cancelled 2 runs of {CAMPAIGN}" in said.err
    assert said.out == ""


def test_cancel_needs_to_be_told_what(scenario, fake):
    assert scenario("cancel").code == 2
    assert fake.calls == []


def test_retry_queues_lost_and_cancelled_runs_again(scenario, fake):
    said = scenario("retry", "first", "--json")
    assert ("retry", CAMPAIGN, ("lost", "cancelled")) in fake.calls
    assert json.loads(said.out) == {"schema": "scenario/retry/1", "campaign": CAMPAIGN, "runs": 1}


def test_retry_can_be_told_which(scenario, fake):
    scenario("retry", "first", "--only", "fail|error")
    assert ("retry", CAMPAIGN, ("fail", "error")) in fake.calls


def test_a_campaign_is_paused_resumed_and_preferred(scenario, fake):
    said = scenario("pause", "first")
    go_on = f"`scenario pause {CAMPAIGN} --off`"
    assert f"paused {CAMPAIGN} with 1 run queued; go on with {go_on}" in said.err
    resumed = json.loads(scenario("pause", "first", "--off", "--json").out)
    assert resumed == {"schema": "scenario/resume/1", "campaign": CAMPAIGN, "runs": 1}
    preferred = json.loads(scenario("priority", "first", "--json", "--", "-3").out)
    assert preferred == {"schema": "scenario/priority/1", "campaign": CAMPAIGN, "priority": -3}
    calls = [call[1:] for call in fake.calls if call[0] == "steer"]
    assert calls == [(CAMPAIGN, True, None), (CAMPAIGN, False, None), (CAMPAIGN, None, -3)]


def test_what_went_wrong_in_a_campaign_is_acknowledged(scenario, fake):
    said = scenario("acknowledge", "first")
    assert ("acknowledge", CAMPAIGN) in fake.calls
    assert f"acknowledged {CAMPAIGN}: 4 runs did not pass" in said.err


def test_a_priority_has_bounds(scenario, fake):
    assert scenario("priority", "first", "1001").code == 2
    assert fake.calls == []


def test_stop_copes_with_a_daemon_that_is_gone_at_once(scenario, fake, monkeypatch, tmp_path):
    contact = tmp_path / "daemon.json"
    contact.write_text(
        '{"endpoint": "tcp/127.0.0.1:4711", "pid": 1, "version": "0", "started_at": 0.0}'
    )
    monkeypatch.setattr(fake, "shutdown", contact.unlink)
    said = scenario("daemon", "--stop", "--state", str(tmp_path))
    assert said.code == 0
    assert "the daemon at tcp/127.0.0.1:4711 is leaving" in said.err


def test_people_see_the_path_of_a_socket_and_programs_the_endpoint(scenario, fake, tmp_path):
    endpoint = f"unixsock-stream/{tmp_path}/daemon.sock"
    contact = f'{{"endpoint": "{endpoint}", "pid": 1, "version": "0", "started_at": 0.0}}'
    (tmp_path / "daemon.json").write_text(contact)
    for command in (["status"], ["daemon", "--stop"]):
        said = scenario(*command, "--state", str(tmp_path))
        assert f"at {tmp_path}/daemon.sock" in said.out + said.err
        assert f'"{endpoint}"' in scenario(*command, "--state", str(tmp_path), "--json").out


def test_stop_says_that_queued_work_waits(scenario, fake):
    said = scenario("daemon", "--stop")
    assert ("shutdown",) in fake.calls
    assert "2 unfinished runs go on when it is started again" in said.err


def test_delete_removes_campaigns_and_says_what_went(scenario, fake):
    folder = state_paths().traces / OLD
    folder.mkdir()
    for name in "abc":
        (folder / f"{name}.mcap").write_bytes(bytes(2**20))
    said = scenario("delete", "nightly", "--dry-run")
    assert f"would have deleted {OLD}: 4 runs, 3 traces, 3.0 MiB" in said.err
    said = scenario("delete", "nightly", OLD, "--yes", "--json")
    gone = {"campaign": OLD, "runs": 4, "traces": 3, "bytes": 3 * 2**20}
    body = json.loads(said.out)
    assert body == {"schema": "scenario/delete/1", "dry_run": False, "campaigns": [gone]}
    assert (fake.campaign(OLD), folder.exists()) == (None, False)


def test_delete_asks_and_not_where_nobody_can_answer(scenario, fake):
    said = scenario("delete", "nightly")
    assert said.code == 2
    assert "say --yes" in said.err
    assert not [call for call in fake.calls if call == ("delete", (OLD,), False)]


def test_who_names_one_campaign_does_not_ask_for_all(scenario, fake):
    for command in ("pause", "cancel", "results", "retry"):
        scenario(command, CAMPAIGN)
    asked = [call for call in fake.calls if call[0] == "campaigns"]
    assert {call[1:3] for call in asked} == {(CAMPAIGN, "")}
