"""cancel, retry, stop: they do what was asked and say what they did."""

import json

from tests.people.fake import CAMPAIGN, OLD, state_paths


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


def test_who_names_one_campaign_does_not_ask_for_all(scenario, fake):
    for command in ("pause", "cancel", "results", "retry"):
        scenario(command, CAMPAIGN)
    asked = [call for call in fake.calls if call[0] == "campaigns"]
    assert {call[1:3] for call in asked} == {(CAMPAIGN, "")}
