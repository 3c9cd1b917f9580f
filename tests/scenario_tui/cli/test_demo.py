"""The demonstration: packaged, valid, and a success also when it shows a robot that fails."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from daemon.model.status import Submission
from scenario_tui.cli import execute, invoke


@pytest.mark.parametrize(
    ("words", "code"),
    [(("pass", "fail", "inconclusive"), 0), (("pass", "lost"), 3), (("error",), 3)],
)
def test_the_demo_succeeds_when_every_run_was_judged(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words, code
) -> None:
    given: list[Submission] = []

    def run_here(submission: Submission, *_: object) -> SimpleNamespace:
        given.append(submission)
        return SimpleNamespace(words=tuple(words))

    monkeypatch.setattr(execute, "run_here", run_here)
    assert invoke(["demo"]) == code
    (submission,) = given
    assert submission.name == "demo"
    assert submission.runs
    assert "scenario submit CAMPAIGN.yaml" in capsys.readouterr().out
