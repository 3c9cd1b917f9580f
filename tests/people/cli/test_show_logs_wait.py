"""show, logs, wait: one run in words, what happened in it, staying until a campaign is over."""

import json
from contextlib import closing
from dataclasses import replace

import pytest

from daemon.batch.ledger import LedgerWriter, connect
from daemon.model.assessments import Expectation
from daemon.model.messages import ReleaseRequest
from daemon.model.run_state import RunState
from daemon.model.verdicts import Outcome
from scenario_tui.library import job, watching
from tests.make import make_submission
from tests.people.fake import CAMPAIGN, make_live
from tests.people.recorded import record_run

NOW = 1_000_000.0


def test_a_run_is_shown_as_in_the_dashboard_with_what_to_type_next(scenario):
    said = scenario("show", f"{CAMPAIGN}.5")
    assert (said.code, said.err) == (0, "")
    assert said.out.startswith("S2/pilot/0  ✗ fail !\n")
    assert "✗ fail !  no-contact  −0.0312 m" in said.out
    assert "at 512.2 s, door-1" in said.out
    assert f"scenario replay {CAMPAIGN}.5 --from no-contact" in said.out
    assert f"scenario blame {CAMPAIGN}.5" in said.out
    assert "blame" not in scenario("show", f"{CAMPAIGN}.0").out


def test_a_known_failure_says_why(scenario, fake):
    known = Expectation("S2", "no-contact", ("pilot",), "mixed", "the door is fast")
    fake.declares = replace(fake.declares, expectations=(known,))
    said = scenario("show", f"{CAMPAIGN}.5").out
    assert "✗ fail a  no-contact  −0.0312 m" in said
    assert "a known: the door is fast" in said
    body = json.loads(scenario("show", f"{CAMPAIGN}.5", "--json").out)
    mark = {"kind": "known", "letter": "a", "reason": "the door is fast"}
    assert body["marks"] == {"no-contact": mark}


def test_a_run_of_what_is_not_repeatable_says_so(scenario, fake):
    fake.rows = tuple(replace(row, repeatable=False) for row in fake.rows)
    said = scenario("show", f"{CAMPAIGN}.5").out
    assert "pilot (pilot, not repeatable)" in said
    assert f"scenario verify {CAMPAIGN}.5" in said


def test_a_run_is_named_by_campaign_and_number(scenario):
    body = json.loads(scenario("show", "first.6", "--json").out)
    assert body["run"]["row"]["id"] == f"{CAMPAIGN}.6"
    assert body["run"]["row"]["result"]["outcome"] == "fail"


@pytest.mark.parametrize("wanted", ["first", "first.99", f"{CAMPAIGN}.99"])
def test_what_is_no_run_is_answered_with_those_there_are(scenario, wanted):
    said = scenario("show", wanted)
    assert said.code == 2
    assert f'"{wanted}" is no run: those of {CAMPAIGN} are {CAMPAIGN}.0 to {CAMPAIGN}.9' in said.err


def test_a_run_of_an_unknown_campaign_says_what_was_meant(scenario):
    assert 'did you mean "first"?' in scenario("show", "frist.3").err


@pytest.fixture
def state(tmp_path):
    """A state directory: run 0 was given back once and has a trace, run 1 prints something."""
    folder = tmp_path / "state"
    folder.mkdir()
    with closing(connect(folder / "ledger.db")) as ledger:
        book = LedgerWriter(ledger)
        book.submit(make_submission("c-1", 2), NOW)
        (grant,) = book.lease("w", 1, NOW)
        book.release(
            ReleaseRequest("w", grant.run, grant.token, "the SUT crashed\nsegfault", True), NOW
        )
    output = folder / "spool" / "w" / "c-1.1" / "attempt-1" / "output.txt"
    output.parent.mkdir(parents=True)
    output.write_text("loading the map\n")
    return folder


def test_logs_tell_attempts_and_reasons(scenario, state):
    said = scenario("show", "c.0", "--log", "--state", str(state))
    assert said.code == 0
    assert [line.split()[2:] for line in said.out.splitlines()[:2]] == [
        ["running"],
        ["queued", "the", "SUT", "crashed"],
    ]
    assert said.out.count("the SUT crashed") == 1
    body = json.loads(scenario("show", "c-1.0", "--log", "--state", str(state), "--json").out)
    assert [step["state"] for step in body["steps"]] == ["running", "queued"]


def test_logs_tell_what_an_attempt_prints(scenario, state):
    assert "loading the map" in scenario("show", "c-1.1", "--log", "--state", str(state)).out


def test_logs_tell_what_a_trace_recorded(scenario, tmp_path):
    trace = record_run(tmp_path / "run.mcap")
    said = scenario("show", str(trace), "--log")
    lines = [line.split(maxsplit=3) for line in said.out.splitlines() if " s  " in line]
    assert [(line[0], line[2], line[3]) for line in lines] == [
        ("6.0", "mission", "w1 reached, 1 of 3"),
        ("6.0", "contact", "robot touches door-1.leaf"),
        ("10.0", "run", "finished"),
    ]
    body = json.loads(scenario("show", str(trace), "--log", "--json").out)
    assert [said["level"] for said in body["recorded"]] == ["info", "warn", "info"]


STACK = b"\x1b[0m[INFO] [launch]: started\r\n" + b"".join(b"line %d\n" % i for i in range(60))
RELAY = b"10 %\r50 %\rup\x07 \xff\n"


@pytest.fixture
def external(tmp_path):
    """A trace of an external system that printed 61 lines, and one."""
    printed = {"stack.txt": STACK, "relay.txt": RELAY}
    return str(record_run(tmp_path / "run.mcap", outputs=printed))


def test_logs_end_with_the_last_lines_of_what_a_stack_printed(scenario, external):
    lines = scenario("show", external, "--log").out.splitlines()
    assert any(line.endswith("planner_server  no path yet") for line in lines)
    begin = lines.index("stack.txt")
    assert lines[begin + 1] == (
        f"(21 lines before these: scenario show {external} --output stack.txt)"
    )
    assert lines[begin + 2 : begin + 42] == [f"line {i}" for i in range(20, 60)]
    # A bell and a byte that is no UTF-8 are to be seen and not to be heard.
    assert lines[lines.index("relay.txt") + 1 :] == ["up\ufffd \ufffd"]


def test_logs_print_all_of_an_output_when_it_is_asked_for(scenario, external):
    whole = ["[INFO] [launch]: started", *(f"line {i}" for i in range(60))]
    assert scenario("show", external, "--log", "--output", "stack.txt").out.splitlines() == whole
    lines = scenario("show", external, "--log", "--all").out.splitlines()
    begin = lines.index("stack.txt")
    assert lines[begin + 1 : begin + 62] == whole
    body = json.loads(scenario("show", external, "--log", "--json").out)
    assert body["printed"]["stack.txt"] == STACK.decode()
    assert body["printed"]["relay.txt"].startswith("10 %\r50 %")


def test_an_output_that_a_run_has_not_is_answered_with_those_it_has(scenario, external, tmp_path):
    said = scenario("show", external, "--log", "--output", "stak.txt")
    assert said.code == 2
    assert 'did you mean "stack.txt"?' in " ".join(said.err.split())
    silent = str(record_run(tmp_path / "silent.mcap"))
    said = scenario("show", silent, "--log", "--output", "stack.txt")
    assert said.code == 2
    assert "printed nothing" in said.err
    assert json.loads(scenario("show", silent, "--log", "--json").out)["printed"] == {}


def test_logs_need_a_state_directory_or_a_trace(scenario, tmp_path):
    said = scenario("show", "c-1.0", "--log", "--state", str(tmp_path))
    assert said.code == 2
    assert "c-1.0 is no trace, no folder, no campaign or run in" in said.err
    assert scenario("show", str(tmp_path / "none.mcap"), "--log").code == 2


def _finish(daemon):
    daemon.rows = tuple(
        replace(row, state=RunState.DONE, outcome=row.outcome or Outcome.PASS)
        for row in daemon.rows
    )


def test_waiting_leaves_with_the_code_of_the_campaign(scenario, fake, monkeypatch):
    monkeypatch.setattr(watching, "INTERVAL", 0.001)
    looks = iter(range(10))
    fake.before = lambda daemon: next(looks, None) is None and _finish(daemon)
    said = scenario("wait", "first")
    assert (said.code, said.out) == (1, "")
    assert said.err == f"{CAMPAIGN}: ✗ 2 runs unexpected\n"
    assert json.loads(scenario("wait", "first", "--json").out)["assessment"]["exit_code"] == 1


def test_waiting_ends_when_the_time_is_up(scenario, fake, monkeypatch):
    monkeypatch.setattr(watching, "INTERVAL", 0.001)
    said = scenario("wait", "first", "--timeout", "0s")
    assert said.code == 4
    assert said.err.startswith(f"{CAMPAIGN}: 2 runs left after 0 s")
    said = scenario("wait", "first", "--timeout", "12")
    assert said.code == 2
    assert "is not a time" in said.err
    assert scenario("wait", "frist").code == 2


def test_leaving_stops_the_waiting_only(scenario, fake, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(job, "watch", interrupted)
    said = scenario("wait", "first")
    assert said.code == 130
    assert f"{CAMPAIGN} goes on" in said.err
    assert not [call for call in fake.calls if call[0] == "cancel"]


@pytest.fixture
def away(fake, monkeypatch, tmp_path):
    """A state directory of a daemon that does not answer until it was asked four times."""
    monkeypatch.setattr(watching, "INTERVAL", 0.001)
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path))
    asked = iter(range(4))
    fake.reachable = False

    def before(daemon):
        if next(asked, None) is None:
            daemon.reachable = True
            _finish(daemon)

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
    assert scenario("wait", "first").code == 1


def test_a_run_that_runs_is_shown_with_how_far_it_is(scenario, fake, monkeypatch):
    live = make_live(7, time=61.0)
    watch = fake.watch

    def told(run, on_live):
        on_live(live)
        return watch(run, on_live)

    monkeypatch.setattr(fake, "watch", told)
    said = scenario("show", f"{CAMPAIGN}.7").out
    assert "1/3 wp  61 s of 1200 s" in said
    assert fake.watchers == {}
