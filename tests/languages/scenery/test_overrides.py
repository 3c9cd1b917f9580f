import pytest

from grammars.scenery import configure, parse_scenery
from grammars.text.diagnostics import Where

LAYER = parse_scenery(
    """
    group doors: door_12, door_17
    parameter within = 1.3 m
    parameter slowly = 10 deg/s
    all doors go from ajar to closed when the robot is within within of their hinge
    """,
    "close_on_approach.scenery",
)
HERE = Where("campaign.yaml", 12, 9)


def test_a_campaign_gives_parameters_other_values():
    changed = configure(LAYER, {"within": "90 cm"}, HERE)
    assert changed.parameters[0].value.value == pytest.approx(0.9)
    assert LAYER.parameters[0].value.value == 1.3
    assert changed.sentences == LAYER.sentences


def test_a_campaign_gives_groups_other_members():
    assert str(configure(LAYER, {"doors": ["door_3", "door_4"]}).groups[0].members) == (
        "door_3, door_4"
    )
    assert str(configure(LAYER, {"doors": "door_3"}).groups[0].members) == "door_3"
