"""The demonstration: packaged, valid, and a success also when it shows a robot that fails."""

from types import SimpleNamespace

import pytest

from daemon.model.run_state import RunState
from daemon.model.verdicts import Outcome
from scenario_tui.cli import execute, invoke
from tests.scenario_tui.fake import make_row


def _row(word):
    if word == "lost":
        return make_row(0, state=RunState.LOST, outcome=None)
    return make_row(0, outcome=Outcome(word))


@pytest.mark.parametrize(
    ("words", "code"),
    [(("pass", "fail", "inconclusive"), 0), (("pass", "lost"), 3), (("error",), 3)],
)
def test_the_demo_succeeds_when_every_run_was_judged(monkeypatch, capsys, words, code):
    given = []

    def run_here(submission, *_):
        given.append(submission)
        return SimpleNamespace(rows=[_row(word) for word in words])

    monkeypatch.setattr(execute, "run_here", run_here)
    assert invoke(["demo"]) == code
    (submission,) = given
    assert submission.name == "demo"
    assert submission.runs
    assert "scenario submit my-tests/campaign.yaml" in capsys.readouterr().out
