"""The key ``without``: parts of a scenario that are left out once it is composed."""

from dataclasses import replace

import pytest

from daemon.campaign import Composer, LayerLibrary, campaign_text, expand, load_campaign
from tests.campaign.loaded import cells, messages

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
def less(demo, campaign):
    """Write a campaign whose scenario ``less`` is like ``calm`` without some parts."""
    (demo / "restless.scenery").write_text(RESTLESS)
    (demo / "waiting.scenery").write_text(WAITING)

    def write(*parts, behaviours="restless", **scenarios):
        less = {"like": "calm", "behaviours": behaviours, "without": list(parts)}
        scenarios = {"whole": less | {"without": []}, "less": less} | scenarios
        return campaign(scenarios=scenarios, repeats=3, limit="3 min")

    return write


def test_draws_of_the_remaining_objects_stay_when_one_is_left_out(less):
    made = cells(less("kitchen_door"))
    whole, part = made["whole"], made["less"]
    assert [o.name for o in part.scene.objects] == [
        o.name for o in whole.scene.objects if o.name != "kitchen_door"
    ]
    assert part.behaviours == tuple(
        tuple(b for b in script if b.joint != "kitchen_door.hinge") for script in whole.behaviours
    )
    assert len(set(part.behaviours)) == 3


def test_a_waypoint_is_left_out_by_its_id_or_its_number(less):
    by_id = cells(less("waypoint kitchen"))["less"].mission
    assert by_id == cells(less("waypoint 1"))["less"].mission
    assert [w.id for w in by_id.waypoints] == ["living-room", "bedroom", "home"]


@pytest.mark.parametrize("name", ["kitchen_door", "kitchen_door.hinge"])
def test_a_behaviour_is_left_out_by_its_object_or_its_joint(less, name):
    made = cells(less(f"behaviour of {name}"))
    assert made["less"].scene == made["whole"].scene
    whole, part = (made[n].behaviours[0] for n in ("whole", "less"))
    assert part == tuple(b for b in whole if b.joint != "kitchen_door.hinge")


def test_legs_are_numbered_anew(less):
    cell = cells(less("waypoint 2", behaviours="waiting"))["less"]
    (reaction,) = (b for b in cell.behaviours[0] if b.joint == "bedroom_door.hinge")
    assert reaction.event.leg == 2


def test_nothing_waits_for_a_part_that_is_left_out(less):
    for part, waiting in (("waypoint 3", "bedroom_door.hinge"),
                          ("bedroom_door", "living_room_door.rail")):  # fmt: skip
        (message,) = messages(less(part, behaviours="waiting"))
        assert message.endswith(
            f": {waiting} waits for what is left out\n"
            f'    leave "behaviour of {waiting}" out as well'
        )
    both = less("bedroom_door", "behaviour of living_room_door", behaviours="waiting")
    assert [b.joint for b in cells(both)["less"].behaviours[0]] == ["kitchen_door.hinge"]


def test_a_behaviour_that_waits_for_no_waypoint_of_the_mission_is_left_to_the_pre_flight(
    less, demo
):
    path = less("waypoint 1", behaviours="waiting")
    text = WAITING.replace("leg 3 begins", 'waypoint "attic" is reached')
    (demo / "waiting.scenery").write_text(text)
    assert any("attic" in message for message in messages(path))


def test_it_is_inherited_and_replaced_as_a_list(less):
    made = cells(less("kitchen_door", same={"like": "less"}, all={"like": "less", "without": []}))
    assert made["same"].scene == made["less"].scene != made["whole"].scene
    assert made["all"].scene == made["whole"].scene


def test_a_cell_composed_anew_is_without_the_same_parts(less, demo):
    campaign = load_campaign(less("kitchen_door", "waypoint 2"))
    composer = Composer(LayerLibrary(demo), campaign.seed)
    for cell in campaign.cells:
        for repeat, script in enumerate(cell.behaviours):
            again = composer.cell(cell, cell.scenario, repeat)
            assert again == replace(cell, behaviours=(script,))


def test_a_scenario_alone_says_what_it_leaves_out(less, demo):
    campaign = load_campaign(less("kitchen_door", "waypoint 2"))
    cell = campaign.cells[-1]
    text = campaign_text(campaign, cell.scenario, name="less", repeats=3)
    (demo / "alone.yaml").write_text(text)
    alone = expand(load_campaign(demo / "alone.yaml")).specs
    assert [run.digest for run in alone] == [
        run.digest for run in expand(campaign).specs if run.scenario == "less"
    ]
