"""Folders of traces, single traces and files of results, where commands take campaigns and runs."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from daemon.analysis.results import write_campaign_note
from daemon.model.assessments import AssessmentRules, Expectation
from daemon.model.submission import Submission
from scenario_tui.cli import invoke
from tests.analysis.report.recordings import DECLARED, NAME, OPEN, SHUT, SUTS, record, spec
from tests.engine.judging.traces import CORRIDOR
from tests.people.cli.outputs import declared
from tests.people.recorded import record_run

FAILS = "my traces/a.mcap"
PASSES = "my traces/b.mcap"
SPECS = (spec(OPEN, SUTS[0], 0), spec(SHUT, SUTS[1], 0))
STACK = b"\x1b[0m[INFO] [launch]: started\r\n" + b"".join(b"line %d\n" % i for i in range(60))
RELAY = b"10 %\r50 %\rup\x07 \xff\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder of two traces, where nothing was ever submitted."""
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path / "state"))
    monkeypatch.delenv("SCENARIO_CONNECT", raising=False)
    monkeypatch.chdir(tmp_path)
    for name, run in zip((FAILS, PASSES), SPECS, strict=True):
        record(tmp_path / name, run)
    note(DECLARED)
    return tmp_path / "my traces"


def note(rules):
    """Have the campaign of the traces declare something about its results."""
    plain = Submission.of("c", SPECS, (CORRIDOR,))
    write_campaign_note(Path("my traces"), replace(plain, name=NAME, declared=rules))


def test_a_folder_of_traces_is_a_campaign(folder, transcript):
    (folder / "c.mcap").write_bytes(b"nothing of the kind")
    transcript("folder")


@pytest.mark.parametrize("verdict", ["fail", "mixed", "any", "undeclared"])
def test_a_trace_knows_what_the_note_beside_it_expects(verdict, folder, transcript):
    known = Expectation("*", "buffer", (), verdict, "it is narrow")
    if verdict == "undeclared":
        (folder / "campaign.json").unlink()
    else:
        note(AssessmentRules(expectations=(known,)))
    transcript(f"folder_{verdict}")


def test_a_trace_is_a_run(tmp_path, monkeypatch, transcript):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    record_run(tmp_path / "run.mcap")
    record_run(tmp_path / "slow.mcap", index=6, speed=0.4)
    record_run(tmp_path / "external.mcap", outputs={"stack.txt": STACK, "relay.txt": RELAY})
    (tmp_path / "broken.mcap").write_bytes(b"not a trace")
    transcript("trace")


@pytest.fixture
def call(folder, capsys):
    def call(*words, code=0):
        assert invoke(words) == code
        return capsys.readouterr().out

    return call


def test_a_folder_of_one_trace_is_a_run(call):
    Path(FAILS).unlink()
    assert f"scenario show '{PASSES}' --log" in call("show", "my traces")


def test_a_file_of_results_is_as_good_as_the_campaign(call, capsys):
    text = call("results", "my traces", "--json")
    Path("r.json").write_text(text)
    body = declared(call("results", "r.json", "--json"))
    assert body["campaign"]["id"] == "r.json"
    assert body["runs"] == json.loads(text)["runs"]
    assert "0 changed" in call("compare", "r.json", "my traces")
    call("results", "my traces", "--baseline", "r.json", code=1)  # as bad as before
    assert invoke(["report", "r.json"]) == 2
    assert "name the campaign or a folder of its traces" in capsys.readouterr().err


def test_the_newest_folder_is_meant_where_nothing_was_submitted(call, capsys):
    assert invoke(["results"]) == 2
    assert "no campaign was submitted here" in capsys.readouterr().err
    Path("scenario-results").mkdir()
    Path("my traces").rename("scenario-results/new-1")
    assert "scenario results scenario-results/new-1 --runs" in call("results")


def test_outputs_of_a_stack_are_whole_for_scripts(tmp_path, scenario):
    trace = record_run(tmp_path / "run.mcap", outputs={"stack.txt": STACK, "relay.txt": RELAY})
    body = json.loads(scenario("show", str(trace), "--log", "--json").out)
    assert body["printed"]["stack.txt"] == STACK.decode()
    assert body["printed"]["relay.txt"].startswith("10 %\r50 %")
    assert [said["level"] for said in body["recorded"]] == ["warn", "info", "warn", "info"]
