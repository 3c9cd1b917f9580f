"""``scenario run --wall --attempts``, and ``check``, with stacks that hang, die and give up."""

import json
import sys
from pathlib import Path

import pytest

from daemon.trace import read_trace
from scenario_tui.cli import invoke
from tests.people.cli.outputs import declared
from tests.plugins import MODULE, install_plugins

CAMPAIGN = """
campaign: limits
seed: 7
limit: 20 s
robot: courier
oracles: navigation
matrix: {sut: [%s]}
scenarios:
  house:
    floorplan: flat
    objects: doors
    behaviours: doors_open
    mission: courier
    oracles: [reached, no-contact]
"""


@pytest.fixture(autouse=True)
def plugged(tmp_path, monkeypatch):
    (tmp_path / "packages").mkdir()
    install_plugins(tmp_path / "packages", monkeypatch)
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path / "state"))
    yield
    sys.modules.pop(MODULE, None)


def campaign(folder, campaigns, *suts):
    """Write a campaign in the demo's flat with those systems under test."""
    for layer in (*(campaigns / "demo").iterdir(), campaigns / "robots", campaigns / "suts"):
        if not (folder / layer.name).exists():
            (folder / layer.name).symlink_to(layer)
    path = folder / "limits.yaml"
    path.write_text(CAMPAIGN % ", ".join(suts))
    return path


def test_what_dies_gives_up_and_hangs_is_told_apart(tmp_path, campaigns, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = campaign(tmp_path, campaigns, "crashes", "gives-up", "hangs-for-hours")
    code = invoke(["run", str(file), "--attempts", "1", "--json", "--wall", "3h"])
    rows = {row["sut"]: row for row in declared(capfd.readouterr().out)["runs"]}
    assert {sut: (row["state"], row["outcome"]) for sut, row in rows.items()} == {
        "crashes": ("lost", None),
        "gives-up": ("done", "fail"),
        "hangs-for-hours": ("done", "error"),
    }
    assert code == 1
    assert "killed by SIGSEGV" in rows["crashes"]["reason"]
    trace = read_trace(Path(rows["hangs-for-hours"]["trace"]))
    assert trace.complete
    assert trace.note.startswith("stopped after 10800 s of wall clock time")
    assert f"in one call of update() ({MODULE}.py:" in trace.note
    # What is not as expected is named by a trace that other commands read.
    trace = rows["gives-up"]["id"]
    assert trace.startswith("scenario-results/limits-")
    assert invoke(["show", trace, "--log"]) == 0
    assert invoke(["results", str(Path(trace).parent)]) == 0
    assert f"→ {trace}" in capfd.readouterr().out
    assert not (tmp_path / "state").exists()


def test_a_factory_is_checked_at_its_line(tmp_path, campaigns, capfd):
    file = campaign(tmp_path, campaigns, "factory-leaves")
    assert invoke(["check", str(file), "--json"]) == 2
    body = json.loads(capfd.readouterr().out)
    # The 5 s that are enough for those that hang are not for the mission, which is said as well.
    (found,) = [d for d in body["files"][str(file)] if "too short" not in d["message"]]
    assert "cannot be made: SystemExit: 2" in found["message"]
    assert found["where"]["line"] == 7


def test_what_a_factory_prints_spoils_no_answer(tmp_path, campaigns, capfd):
    file = campaign(tmp_path, campaigns, "factory-prints")
    assert invoke(["check", str(file), "--json"]) == 0
    said = capfd.readouterr()
    assert json.loads(said.out)["schema"] == "scenario/check/1"
    assert "loading weights" in said.err
