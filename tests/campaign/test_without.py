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


def described(cell):
    """Return objects, waypoints and behaviours of a cell; each draw has a number."""
    draws = {script: str(number) for number, script in enumerate(dict.fromkeys(cell.behaviours))}
    yield f"objects: {', '.join(thing.name for thing in cell.scene.objects)}"
    yield f"waypoints: {', '.join(waypoint.id for waypoint in cell.mission.waypoints)}"
    yield f"draws: {', '.join(draws[script] for script in cell.behaviours)}"
    for act in cell.behaviours[0]:
        times = [round(frame.time, 3) for frame in getattr(act, "frames", ())[:5]]
        leg = f" on leg {act.event.leg}" if hasattr(getattr(act, "event", 0), "leg") else ""
        yield f"{act.kind} of {act.joint}{leg} {times or ''}".rstrip()


def test_what_remains_is_as_it_was_without_the_parts(less, golden):
    """``without.txt``: a campaign of random doors, then of doors that wait for something."""
    text = ""
    for parts, behaviours in (
        ([], "restless"),
        (["kitchen_door"], "restless"),
        (["waypoint kitchen"], "restless"),
        (["waypoint 1"], "restless"),
        (["behaviour of kitchen_door"], "restless"),
        (["behaviour of kitchen_door.hinge"], "restless"),
        ([], "waiting"),
        (["waypoint 2"], "waiting"),
        (["bedroom_door", "behaviour of living_room_door"], "waiting"),
    ):
        lines = "\n".join(described(cells(less(*parts, behaviours=behaviours))["less"]))
        text += f"--- {behaviours} without {', '.join(parts) or 'nothing'}\n{lines}\n"
    golden("without.txt", text)


def test_nothing_waits_for_a_part_that_is_left_out(less):
    for part, waiting in (("waypoint 3", "bedroom_door.hinge"),
                          ("bedroom_door", "living_room_door.rail")):  # fmt: skip
        (message,) = messages(less(part, behaviours="waiting"))
        assert message.endswith(
            f': {waiting} waits for this part\n    leave "behaviour of {waiting}" out as well'
        )


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
