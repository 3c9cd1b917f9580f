"""Folders of traces, single traces and files of results, where commands take campaigns and runs."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from daemon.analysis.results import write_campaign_note
from daemon.batch.ledger import connect
from daemon.model.assessments import AssessmentRules, Expectation
from daemon.model.submission import Submission
from scenario_tui.cli import invoke
from tests.analysis.report.recordings import DECLARED, NAME, OPEN, SHUT, SUTS, record, spec
from tests.engine.judging.traces import CORRIDOR
from tests.people.cli.outputs import declared

FAILS = "my traces/a.mcap"
PASSES = "my traces/b.mcap"


@pytest.fixture
def call(tmp_path, monkeypatch, capsys):
    """Call ``scenario ...`` beside a folder of two traces, where nothing was ever submitted."""
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path / "state"))
    monkeypatch.delenv("SCENARIO_CONNECT", raising=False)
    monkeypatch.chdir(tmp_path)
    specs = (spec(OPEN, SUTS[0], 0), spec(SHUT, SUTS[1], 0))
    for name, run in zip((FAILS, PASSES), specs, strict=True):
        record(tmp_path / name, run)
    plain = Submission.of("c", specs, (CORRIDOR,))
    write_campaign_note(tmp_path / "my traces", replace(plain, name=NAME, declared=DECLARED))

    def call(*words, code=0):
        assert invoke(words) == code
        return capsys.readouterr().out

    return call


def test_a_folder_of_traces_is_judged_and_assessed_as_its_campaign_declares(call):
    body = declared(call("results", "my traces", "--json"))
    assert body["campaign"]["id"] == "my traces"
    assert (body["campaign"]["failed"], body["campaign"]["passed"]) == (1, 1)
    assert [(run["id"], run["outcome"]) for run in body["runs"]] == [
        (FAILS, "fail"),
        (PASSES, "pass"),
    ]
    assert [found["oracle"] for found in body["assessment"]["surprises"]] == ["buffer"]
    assert body["declared"]["expectations"]
    call("results", "my traces", "--exit-status", code=1)


def test_commands_about_a_folder_can_be_typed_as_they_stand(call):
    assert "scenario results 'my traces' --runs" in call("results", "my traces")
    assert f"scenario show '{FAILS}'" in call("results", "my traces", "--runs")
    shown = call("show", FAILS)
    assert f"scenario replay '{FAILS}' --from buffer" in shown
    assert "20.0 s simulated\n" in shown


def test_a_folder_of_several_traces_is_no_run(call, capsys):
    assert invoke(["show", "my traces"]) == 2
    assert f"my traces means 2 traces ({FAILS}, {PASSES}): name one of them" in (
        capsys.readouterr().err
    )
    Path(FAILS).unlink()
    assert f"scenario show '{PASSES}' --log" in call("show", "my traces")


def test_runs_of_a_folder_are_filtered(call):
    rows = declared(call("results", "my traces", "--outcome", "pass", "--json"))["runs"]
    assert [row["id"] for row in rows] == [PASSES]
    rows = declared(call("results", "my traces", "--filter", "BUFFER", "--json"))["runs"]
    assert FAILS in [row["id"] for row in rows]


def test_a_trace_is_a_campaign_of_one_run(call):
    body = declared(call("results", FAILS, "--json"))
    assert [run["id"] for run in body["runs"]] == [body["campaign"]["id"]] == [FAILS]


def test_a_file_of_results_is_as_good_as_the_campaign(call):
    text = call("results", "my traces", "--json")
    Path("r.json").write_text(text)
    body = declared(call("results", "r.json", "--json"))
    assert body["campaign"]["id"] == "r.json"
    assert body["runs"] == json.loads(text)["runs"]
    assert "0 changed" in call("compare", "r.json", "my traces")
    call("results", "my traces", "--baseline", "r.json", code=1)  # as bad as before


def test_a_file_of_results_has_no_specifications(call, capsys):
    Path("r.json").write_text(call("results", "my traces", "--json"))
    assert invoke(["report", "r.json"]) == 2
    assert "name the campaign or a folder of its traces" in capsys.readouterr().err


def test_a_trace_that_cannot_be_read_is_said_and_left_out(call):
    Path("my traces/c.mcap").write_bytes(b"nothing of the kind")
    assert "not read: my traces/c.mcap: is not an MCAP file" in call("results", "my traces")


def test_a_folder_has_no_history(call, capsys):
    Path("state").mkdir()
    connect(Path("state/ledger.db")).close()
    assert invoke(["report", "--history", "my traces"]) == 2
    said = capsys.readouterr().err
    assert "my traces is a folder of traces, and no campaign has that name" in said


def test_the_newest_folder_is_meant_where_nothing_was_submitted(call, capsys):
    assert invoke(["results"]) == 2
    assert "nothing was submitted here" in capsys.readouterr().err
    Path("scenario-results").mkdir()
    Path("my traces").rename("scenario-results/new-1")
    assert "scenario results scenario-results/new-1 --runs" in call("results")


def expect(verdict):
    """Have the campaign of the traces expect a verdict of its buffer."""
    expected = Expectation("*", "buffer", (), verdict, "it is narrow")
    note = Submission.of("c", (), ())
    rules = AssessmentRules(expectations=(expected,))
    write_campaign_note(Path("my traces"), replace(note, name=NAME, declared=rules))


@pytest.mark.parametrize("verdict", ["fail", "mixed", "any"])
def test_a_trace_knows_the_failures_that_the_note_beside_it_expects(call, verdict):
    expect(verdict)
    shown = call("show", FAILS)
    assert "✗ fail a  buffer" in shown
    assert "a known: it is narrow" in shown
    frame = call("replay", FAILS, "--frame", "buffer")
    assert "✗ fail a  buffer" in frame
    assert "known: it is narrow" in frame
    assert "✗ fail a" in call("replay", PASSES, FAILS)


def test_a_trace_that_passes_is_no_news_where_one_of_its_repeats_may_fail(call):
    expect("mixed")
    assert "✓ pass  buffer" in call("show", PASSES)
    expect("fail")
    assert "✓ pass !  buffer" in call("show", PASSES)


def test_of_a_trace_alone_nothing_is_said_to_be_news_or_known(call):
    assert "✗ fail !  buffer" in call("show", FAILS)
    Path("my traces/campaign.json").unlink()
    assert "✗ fail  buffer" in call("show", FAILS)
    assert "✗ fail  buffer" in call("replay", FAILS, "--frame", "buffer")
    assert json.loads(call("show", FAILS, "--json"))["marks"] == {}
