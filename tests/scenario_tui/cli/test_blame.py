"""``scenario blame``: the story people and scripts are told."""

import shutil
from pathlib import Path

import pytest

from daemon.batch.ledger import LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.campaign import expand, load_campaign
from daemon.model.verdicts import Outcome
from scenario_tui.cli import invoke
from tests.daemon.analysis.blame.cases import CAMPAIGN, failing_if, pretend, write
from tests.scenario_tui.cli.outputs import declared


@pytest.fixture
def campaign(tmp_path, campaigns, monkeypatch):
    for name in ("demo", "robots", "suts"):
        shutil.copytree(campaigns / name, tmp_path / name)
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path / "state"))
    monkeypatch.chdir(tmp_path)
    text = CAMPAIGN.replace("sut: [pilot]", "sut: [hasty]")
    (tmp_path / "demo" / "hasty.yaml").write_text(
        "sut: hasty\nlike: pilot\nparameters: {max_speed: 0.7}\n"
    )
    return str(write(tmp_path / "demo", text))


def shuts_fast(spec):
    shut = any(b.joint == "kitchen_door.hinge" for b in spec.behaviours)
    return shut and spec.sut.parameters.get("max_speed") == 0.7


def test_the_story_is_told_and_the_scenario_saved(campaign, monkeypatch, capsys):
    pretend(monkeypatch, failing_if(shuts_fast))
    assert invoke(["blame", campaign, "rude", "hasty", "1"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("rude/hasty/1 fails reached:")
    assert "fails with doors, doors_in_your_face and max_speed: 0.7 on top of pilot" in out
    assert "without max_speed: passes" in out
    assert "minimal: kitchen_door (of 6)" in out
    saved = Path("scenario-results/blame/tiny/rude.hasty.1/campaign.yaml")
    assert f"scenario run {saved}" in out
    assert invoke(["check", str(saved)]) == 0


def test_scripts_get_the_story_as_json(campaign, tmp_path, monkeypatch, capsys):
    pretended = pretend(monkeypatch, failing_if(shuts_fast))
    place = tmp_path / "kept"
    assert invoke(["blame", campaign, "rude", "-o", str(place), "--json"]) == 0
    body = declared(capsys.readouterr().out)
    assert body["schema"] == "scenario/blame/1"
    assert body["blame"]["parameters"] == ["max_speed: 0.7"]
    assert body["blame"]["minimal"] is True
    assert body["runs"] == len(pretended.specs)
    assert body["saved"] == str(place / "campaign.yaml")


def test_what_does_not_fail_is_said_so(campaign, monkeypatch, capsys):
    pretend(monkeypatch, lambda _: Outcome.PASS)
    assert invoke(["blame", campaign, "rude"]) == 4
    assert "rude/hasty/0 does not fail: reached pass" in capsys.readouterr().err


def test_an_interrupt_tells_what_was_found(campaign, monkeypatch, capsys):
    pretend(monkeypatch, failing_if(shuts_fast)).interrupt_after = 14
    assert invoke(["blame", campaign, "rude"]) == 130
    out = capsys.readouterr().out
    assert "without max_speed: passes" in out
    assert "stopped before nothing else could go: interrupted" in out
    assert "scenario run scenario-results" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "SCENARIO SUT REPEAT"),
        (["rudd"], 'no scenario "rudd"'),
        (["rude", "hasty", "x"], "not the number of a repeat"),
    ],
)
def test_wrong_words_are_wrong_usage(campaign, words, message, capsys):
    assert invoke(["blame", campaign, *words]) == 2
    assert message in " ".join(capsys.readouterr().err.replace("│", " ").split())


def test_a_campaign_that_has_traces_is_not_called_one_without(campaign, tmp_path, capsys):
    submission, places = expand(load_campaign(campaign)), StatePaths(tmp_path / "state")
    places.state.mkdir()
    with LedgerWriter.open(places) as ledger:
        ledger.submit(submission, 0.0)
    folder = places.traces / submission.campaign
    folder.mkdir(parents=True)
    for name in ("rude.hasty.0.mcap", "rude.hasty.1.mcap"):
        (folder / name).touch()
    assert invoke(["blame", submission.campaign]) == 2
    told = " ".join(capsys.readouterr().err.replace("│", " ").split())
    assert "names 2 runs, name one of them" in told
