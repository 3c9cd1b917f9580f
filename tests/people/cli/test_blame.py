"""``scenario blame``: the story people and scripts are told."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from daemon.analysis.results import write_campaign_note
from daemon.batch.ledger import LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.campaign import campaign_origin, expand, load_campaign
from daemon.model.verdicts import Outcome
from daemon.run import execute
from scenario_tui.cli import invoke
from tests.analysis.blame import CAMPAIGN, failing_if, pretend, write
from tests.people.cli.outputs import declared


@pytest.fixture
def campaign(place, monkeypatch):
    monkeypatch.setenv("SCENARIO_STATE", str(place / "state"))
    (place / "demo" / "hasty.yaml").write_text(
        "sut: hasty\nlike: pilot\nparameters: {max_speed: 0.7}\n"
    )
    return str(write(place / "demo", CAMPAIGN.replace("sut: [pilot]", "sut: [hasty]")))


def shuts_fast(spec):
    shut = any(b.joint == "kitchen_door.hinge" for b in spec.behaviours)
    return shut and spec.sut.parameters.get("max_speed") == 0.7


def blamed(capsys, *words):
    """Return the code and everything that was said."""
    code = invoke(["blame", *map(str, words)])
    said = capsys.readouterr()
    return code, " ".join((said.out + said.err).replace("│", " ").split())


def test_the_story_is_told_and_the_scenario_saved(campaign, monkeypatch, transcript):
    pretend(monkeypatch, failing_if(shuts_fast))
    transcript("blame")


def test_scripts_get_the_story_as_json(campaign, monkeypatch, capsys):
    pretended = pretend(monkeypatch, failing_if(shuts_fast))
    assert invoke(["blame", campaign, "rude", "-o", "kept", "--json"]) == 0
    body = declared(capsys.readouterr().out)
    assert (body["runs"], body["saved"]) == (len(pretended.specs), "kept/campaign.yaml")
    assert (body["blame"]["parameters"], body["blame"]["minimal"]) == (["max_speed: 0.7"], True)


def test_an_interrupt_tells_what_was_found(campaign, monkeypatch, capsys):
    pretend(monkeypatch, failing_if(shuts_fast)).interrupt_after = 14
    code, said = blamed(capsys, campaign, "rude")
    assert code == 130
    assert "without max_speed: passes" in said
    assert "stopped before the smallest scenario was found: interrupted" in said
    assert "scenario run scenario-results" in said


@pytest.fixture
def short(campaign, monkeypatch):
    """A campaign file whose runs are over after a second, with what it submits; none fails."""
    pretend(monkeypatch, lambda _: Outcome.PASS)
    file = write(Path(campaign).parent, CAMPAIGN.replace("16 s", "1 s"))
    planned = load_campaign(file)
    return file, replace(expand(planned), origin=campaign_origin(planned, file))


def test_a_trace_is_of_the_campaign_file_that_its_record_names(short, tmp_path, capsys):
    file, submission = short
    # As a search leaves it: a copy that specifies the same run.
    shutil.copytree(file.parent, tmp_path / "a_copy")
    trace = tmp_path / "results" / "run.mcap"
    trace.parent.mkdir()
    execute(submission.specs[1], submission.scenes[0], trace_path=trace)
    code, said = blamed(capsys, trace)
    assert (code, "no record names the campaign file" in said) == (2, True)
    write_campaign_note(trace.parent, submission)
    code, said = blamed(capsys, trace)
    assert (code, "rude/pilot/1 does not fail" in said) == (4, True)

    file.write_text(file.read_text().replace("near: 1 m", "near: 99 cm"))
    code, said = blamed(capsys, trace)
    assert (code, "does not specify this run any more: use --campaign" in said) == (2, True)
    code, said = blamed(capsys, trace, "--campaign", file)
    assert (code, "its layers have changed since" in said) == (4, True)
    file.unlink()
    code, said = blamed(capsys, trace)
    assert (code, "tiny.yaml does not exist any more: name it with --campaign" in said) == (2, True)


def test_a_run_of_the_ledger_is_of_the_file_it_was_submitted_from(short, tmp_path, capsys):
    _, submission = short
    places = StatePaths(tmp_path / "state")
    places.state.mkdir()
    with LedgerWriter.open(places) as ledger:
        ledger.submit(submission, 0.0)
    trace = places.traces / submission.campaign / "rude.pilot.0.mcap"
    trace.parent.mkdir(parents=True)
    execute(submission.specs[0], submission.scenes[0], trace_path=trace)
    code, said = blamed(capsys, trace)
    assert (code, "rude/pilot/0 does not fail" in said) == (4, True)
    (trace.parent / "rude.pilot.1.mcap").touch()
    code, said = blamed(capsys, trace.parent)
    assert "has 2 traces (rude.pilot.0.mcap, rude.pilot.1.mcap): name one of them" in said


def test_a_repeat_in_reserve_is_a_run_like_others(campaign, tmp_path, monkeypatch, capsys):
    pretend(monkeypatch, lambda _: Outcome.PASS)
    policy = "repeats: {n: 1, pass: rate >= 80 %, until: decided, at-most: 2}"
    text = CAMPAIGN.replace("16 s", "1 s").replace("repeats: 2", policy)
    file = write(Path(campaign).parent, text)
    planned = expand(load_campaign(file))
    spec = planned.spec(planned.reserve[0])
    trace = tmp_path / "rude.pilot.1.mcap"
    execute(spec, planned.scenes[0], trace_path=trace)
    _, said = blamed(capsys, trace, "--campaign", file)
    assert said.startswith("scenario: rude/pilot/1 does not fail")
