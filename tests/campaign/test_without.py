"""The key ``without``: parts of a scenario that are left out once it is composed."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from daemon.campaign import Composer, LayerLibrary, campaign_text, expand, load_campaign
from grammars.text.diagnostics import InputError
from tests.campaign.findings import findings_of

CAMPAIGN = """\
campaign: tiny
seed: 3
repeats: 3
limit: 3 min
robot: courier
oracles: navigation
matrix: {sut: pilot}
scenarios:
  whole:
    floorplan: flat
    objects: doors
    behaviours: restless
    mission: courier
    oracles: [reached]
  less:
    like: whole
"""
RESTLESS = """\
every hinged_door toggles between closed and open every 5 s, with probability 0.5, up to 3 s late
living_room_door stays open
"""
WAITING = """\
bedroom_door goes from closed to open when leg 3 begins
kitchen_door stays open
living_room_door goes from closed to open when bedroom_door starts to move
"""


@pytest.fixture
def folder(tmp_path, campaigns):
    for name in ("demo", "robots", "suts"):
        shutil.copytree(campaigns / name, tmp_path / name)
    (tmp_path / "demo" / "restless.scenery").write_text(RESTLESS)
    (tmp_path / "demo" / "waiting.scenery").write_text(WAITING)
    return tmp_path / "demo"


def load(folder, *less, text=CAMPAIGN):
    path = folder / "tiny.yaml"
    path.write_text(text + "".join(f"    {line}\n" for line in less))
    return load_campaign(path)


def cells(folder, *less):
    campaign = load(folder, *less)
    return {cell.name: cell for cell in campaign.cells}


def refusals(folder, *less):
    with pytest.raises(InputError) as caught:
        load(folder, *less)
    return [
        f"{Path(d.where.file).name}:{d.where.line}: {d.message} [{d.hint}]"
        for d in caught.value.findings
    ]


def test_draws_of_what_remains_stay_when_an_object_is_left_out(folder):
    found = cells(folder, "without: kitchen_door")
    whole, less = found["whole"], found["less"]
    assert [o.name for o in less.scene.objects] == [
        o.name for o in whole.scene.objects if o.name != "kitchen_door"
    ]
    assert less.behaviours == tuple(
        tuple(b for b in script if b.joint != "kitchen_door.hinge") for script in whole.behaviours
    )
    assert len(set(less.behaviours)) == 3


def test_a_waypoint_is_left_out_by_its_id_or_its_number(folder):
    by_id = cells(folder, "without: waypoint kitchen")["less"].mission
    assert by_id == cells(folder, "without: [waypoint 1]")["less"].mission
    assert [w.id for w in by_id.waypoints] == ["living-room", "bedroom", "home"]


@pytest.mark.parametrize("name", ["kitchen_door", "kitchen_door.hinge"])
def test_a_behaviour_is_left_out_by_its_object_or_its_joint(folder, name):
    found = cells(folder, f"without: behaviour of {name}")
    assert found["less"].scene == found["whole"].scene
    whole, less = (found[n].behaviours[0] for n in ("whole", "less"))
    assert less == tuple(b for b in whole if b.joint != "kitchen_door.hinge")


def test_legs_are_numbered_anew(folder):
    cell = cells(folder, "behaviours: waiting", "without: waypoint 2")["less"]
    (reaction,) = (b for b in cell.behaviours[0] if b.joint == "bedroom_door.hinge")
    assert reaction.event.leg == 2


def test_nothing_waits_for_what_is_left_out(folder):
    layers = "behaviours: waiting"
    assert refusals(folder, layers, "without: [waypoint 3]") == [
        "tiny.yaml:18: bedroom_door.hinge waits for what is left out "
        '[leave "behaviour of bedroom_door.hinge" out as well]'
    ]
    assert refusals(folder, layers, "without: [bedroom_door]") == [
        "tiny.yaml:18: living_room_door.rail waits for what is left out "
        '[leave "behaviour of living_room_door.rail" out as well]'
    ]
    less = "without: [bedroom_door, behaviour of living_room_door]"
    assert [b.joint for b in cells(folder, layers, less)["less"].behaviours[0]] == [
        "kitchen_door.hinge"
    ]


def test_a_behaviour_that_waits_for_no_waypoint_of_the_mission_is_left_to_the_pre_flight(folder):
    waiting = folder / "waiting.scenery"
    waiting.write_text(WAITING.replace("leg 3 begins", 'waypoint "attic" is reached'))
    (folder / "tiny.yaml").write_text(
        f"{CAMPAIGN}    behaviours: waiting\n    without: waypoint 1\n"
    )
    (found,) = findings_of(folder / "tiny.yaml")
    assert "attic" in found.message


def test_it_is_inherited_and_replaced_as_a_list(folder):
    more = "without: kitchen_door\n  same:\n    like: less\n  all:\n    like: less\n    without: []"
    found = cells(folder, more)
    assert found["same"].scene == found["less"].scene
    assert found["all"].scene == found["whole"].scene


def test_a_cell_composed_anew_is_without_the_same_parts(folder):
    campaign = load(folder, "without: [kitchen_door, waypoint 2]")
    composer = Composer(LayerLibrary(folder), campaign.seed)
    for cell in campaign.cells:
        for repeat, script in enumerate(cell.behaviours):
            anew = composer.cell(cell, cell.scenario, repeat)
            assert anew == replace(cell, behaviours=(script,))


def test_a_scenario_alone_says_what_it_leaves_out(folder):
    campaign = load(folder, "without: [kitchen_door, waypoint 2]")
    (_, less) = campaign.cells
    text = campaign_text(campaign, less.scenario, name="less", repeats=3)
    alone = load(folder, text=text)
    expected = [run for run in expand(campaign).specs if run.scenario == "less"]
    assert [replace(run, campaign="tiny").digest for run in expand(alone).specs] == [
        run.digest for run in expected
    ]
