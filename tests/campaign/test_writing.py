"""How campaigns are written: defaults, and answers to what people write in the wrong place."""

import shutil
from pathlib import Path

import pytest

from daemon.campaign import expand, load_campaign

CAMPAIGN = """\
campaign: tiny
limit: 30 s
robot: courier
oracles: navigation
matrix: {sut: [pilot]}
defaults:
  floorplan: flat
  objects: doors
  mission: courier
  oracles: [reached]
  limit: 40 s
scenarios:
  calm:
    behaviours: doors_open
  rude:
    like: calm
    behaviours: doors_in_your_face
    oracles+: [no-contact]
  other:
    robot: shuttle
    sut: idle
    limit: 50 s
"""


@pytest.fixture
def folder(tmp_path, campaigns):
    """The files of a campaign far from everything that ships."""
    return Path(shutil.copytree(campaigns / "demo", tmp_path / "mine"))


def write(folder, text):
    path = folder / "tiny.yaml"
    path.write_text(text)
    return path


def test_defaults_hold_where_a_scenario_says_nothing_itself_or_by_like(folder):
    runs = {run.scenario: run for run in expand(load_campaign(write(folder, CAMPAIGN))).specs}
    assert {name: [o.name for o in run.oracles] for name, run in runs.items()} == {
        "calm": ["reached"],
        "rude": ["reached", "no-contact"],
        "other": ["reached"],
    }
    assert {name: run.limit for name, run in runs.items()} == {
        "calm": 40.0,
        "rude": 40.0,
        "other": 50.0,
    }
    assert (runs["calm"].robot.name, runs["other"].robot.name) == ("courier", "shuttle")
    assert (runs["calm"].sut.kind, runs["other"].sut.kind) == ("pilot", "idle")


def test_defaults_make_the_same_runs_as_writing_it_out(folder):
    a, b = CAMPAIGN.index("defaults:"), CAMPAIGN.index("scenarios:")
    slots = "".join(f"  {line}\n" for line in CAMPAIGN[a:b].splitlines()[1:])
    spelled = CAMPAIGN[:a] + CAMPAIGN[b:].replace("  calm:\n", f"  calm:\n{slots}").replace(
        "  other:\n", f"  other:\n{slots.replace('    limit: 40 s', '')}"
    )
    here, there = (expand(load_campaign(write(folder, text))) for text in (CAMPAIGN, spelled))
    assert here.runs == there.runs
    assert here.scenes == there.scenes


def test_variants_may_be_a_default(folder):
    text = CAMPAIGN.replace("  floorplan: flat\n", "  vary: {floorplan: flat, samples: 1}\n")
    cells = load_campaign(write(folder, text)).cells
    assert {cell.name for cell in cells} == {"calm@0", "rude@0", "other@0"}


def test_robots_and_systems_that_ship_come_last(folder, campaigns):
    text = CAMPAIGN.replace("[pilot]", "[pilot, fro-omni]")
    shipped = load_campaign(write(folder, text))
    assert [sut.name for sut in shipped.cells[0].suts] == ["pilot", "fro-omni"]
    own = (campaigns / "robots" / "courier.yaml").read_text().replace("mass: 30", "mass: 31")
    (folder / "courier.yaml").write_text(own)
    (folder / "suts").mkdir()
    (folder / "suts" / "fro-omni.yaml").write_text("sut: mine\nlike: a2s\n")
    cell = load_campaign(write(folder, text)).cells[0]
    assert cell.robot.mass == 31.0
    # What one that ships is like is found beside it.
    assert [sut.name for sut in cell.suts] == ["pilot", "mine"]
