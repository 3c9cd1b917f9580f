import pytest

from grammars.scenery import configure, parse_scenery
from grammars.text.diagnostics import InputError, Where

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


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (
            {"witin": "1 m"},
            'layer close_on_approach has no parameter "witin"\n    did you mean "within"?',
        ),
        (
            {"within": 1.3},
            "within: a unit is missing after 1.3\n    write within: 1.3 m",
        ),
        (
            {"within": "3 s"},
            "within: a length is needed here, 3 s is a time\n    write within: 1.3 m",
        ),
        ({"within": ["1 m"]}, "within is a quantity\n    write within: 1.3 m"),
        ({"doors": 17}, "doors is a group\n    write doors: [door_1, door_2]"),
        ({"doors": []}, "doors is a group\n    write doors: [door_1, door_2]"),
        (
            {"doors": [17]},
            'doors: "17" is not the name of an object\n    write names, such as door_1',
        ),
    ],
)
def test_overrides_that_do_not_fit_are_refused(overrides, message):
    with pytest.raises(InputError) as caught:
        configure(LAYER, overrides, HERE)
    assert str(caught.value) == f"campaign.yaml:12:9: {message}"


def test_every_wrong_override_is_reported():
    with pytest.raises(InputError) as caught:
        configure(LAYER, {"a": 1, "within": "1 kg"}, HERE)
    assert len(caught.value.diagnostics) == 2
