"""The demonstration: packaged, valid, and a success also when it shows a robot that fails."""

from types import SimpleNamespace

import pytest

from scenario_tui.cli import invoke, run


@pytest.mark.parametrize(
    ("words", "code"),
    [(("pass", "fail", "inconclusive"), 0), (("pass", "lost"), 3), (("error",), 3)],
)
def test_the_demo_succeeds_when_every_run_was_judged(monkeypatch, capsys, words, code):
    campaigns = []

    def run_it(campaign, *_):
        campaigns.append(campaign)
        rows = tuple(SimpleNamespace(state=word, outcome=None) for word in words)
        unused = dict.fromkeys(("row", "declared", "assessment", "origin"))
        return SimpleNamespace(rows=rows, **unused)

    monkeypatch.setattr(run, "_run", run_it)
    monkeypatch.setattr(run, "_print_results", lambda *_: None)
    assert invoke(["demo"]) == code
    (campaign,) = campaigns
    assert (campaign.name, campaign.runs, campaign.check()) == ("demo", 15, [])
    assert "scenario submit my-tests/campaign.yaml" in capsys.readouterr().out
