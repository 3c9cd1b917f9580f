"""Commands that others have taken in: they work for one release and say what to type now."""

import json

import pytest

from scenario_tui.cli.commands import COMMANDS, OLD_WORDS
from tests.scenario_tui.fake import CAMPAIGN

CALLS = {
    "layers": ((), ("new", "--layers")),
    "metrics": ((), ("status", "--metrics")),
    "stop": ((), ("daemon", "--stop")),
    "resume": (("first",), ("pause", "first", "--off")),
    "logs": (("none.mcap",), ("show", "none.mcap", "--log")),
    "fetch": (("none",), ("export", "none", "traces")),
    "vscode": (("-o", "there"), ("schema", "--vscode", "there")),
}


def test_every_old_word_is_tried():
    assert set(CALLS) == set(OLD_WORDS)
    assert not set(OLD_WORDS) & set(COMMANDS)


@pytest.mark.parametrize("word", CALLS)
def test_an_old_word_does_the_same_and_says_once_what_to_type(
    word, scenario, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    old, now = CALLS[word]
    before, after = scenario(word, *old), scenario(*now)
    assert (before.code, before.out) == (after.code, after.out)
    assert before.err.count(f"is now `{OLD_WORDS[word].instead}`") == 1
    assert " ".join(now[:1]) in OLD_WORDS[word].instead


def test_scripts_that_read_json_notice_nothing(scenario):
    said = scenario("resume", "first", "--json")
    assert json.loads(said.out) == {"schema": "scenario/resume/1", "campaign": CAMPAIGN, "runs": 2}
    assert said.code == 0


def test_help_names_no_old_word_and_their_own_help_says_what_to_type(scenario):
    listed = {line.split()[1] for line in scenario("--help").out.splitlines() if "│ " in line}
    assert set(COMMANDS) <= listed
    assert not listed & set(OLD_WORDS)
    assert "Type now: scenario daemon --stop" in scenario("stop", "--help").out


def test_a_picture_has_an_old_word_too(scenario, tmp_path):
    said = scenario("report", "--run", str(tmp_path / "none.mcap"))
    assert said.code == 2
    assert "is now `scenario export RUN picture`" in said.err
