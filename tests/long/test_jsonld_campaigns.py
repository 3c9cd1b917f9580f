"""Campaigns that ship come back from JSON-LD, which fits the shapes."""

import dataclasses

import pytest

from grammars.floorplan import load_floorplan
from grammars.scenery import load_scenery
from tests.languages.test_jsonld_scenery import assert_the_same_comes_of, written_and_read

DEMO = ("flat", "doors", "doors_open", "doors_moving", "doors_in_your_face", "people")
PAPER = ("building_c", "doors", "doors_random", "doors_open", "close_on_approach")


@pytest.mark.parametrize(("folder", "names"), [("demo", DEMO), ("ortega2024", PAPER)])
def test_a_campaign_fits_the_shapes_and_comes_back(campaigns, tmp_path, folder, names):
    plan = load_floorplan(campaigns / folder / f"{names[0]}.fpm")
    layers = [load_scenery(campaigns / folder / f"{name}.scenery") for name in names[1:]]
    back_plan, back = written_and_read(tmp_path, plan, layers)
    assert back_plan == plan
    assert [space.placement for space in back_plan.spaces] == [s.placement for s in plan.spaces]
    assert [one.name for one in back] == list(names[1:])
    assert_the_same_comes_of(plan, layers, back_plan, back)
    for one, other in zip(back, layers, strict=True):
        assert dataclasses.replace(one, file=other.file, models=other.models) == other
