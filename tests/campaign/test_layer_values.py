"""Values beside the names of layers, in every slot of a scenario; scenarios on their own."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from daemon.campaign import LayerLibrary, campaign_text, expand, load_campaign, with_overrides
from grammars.text import codec
from tests.campaign.loaded import cells, digests, runs
from tests.stacks.cases import cases, written


@pytest.fixture
def changed(campaign):
    """Write a campaign with a scenario ``changed`` in which some slots are not those of calm."""

    def write(**slots):
        base = {"like": "calm", "behaviours": "doors_moving"}
        return campaign(scenarios={"plain": base, "changed": base | slots})

    return write


def cell(path):
    return cells(path)["changed"]


FILES = {
    "short.mission.yaml": "waypoints: [{x: 0.2, y: 0.1}, {x: 0.5, y: 0.0}]\n",
    "round.mission.yaml": (
        "waypoints: [{id: a, x: 0.2, y: 0}, {id: b, x: 0.5, y: 0}, {id: a, x: 0.2, y: 0}]\n"
    ),
    "mine.yaml": "sut: mine\nkind: pilot\nparameters: {max_speed: 0.2, max_turn: 0.8}\n",
    "two.scenery": "import doors\ngroup both: kitchen_door, bedroom_door\n",
}
VALUES = Path(__file__).with_name("values.txt")


def leaves(plain, at=()):
    """Return a nested value as lines; items of lists have the names that they say."""
    if not isinstance(plain, dict | list) or not plain:
        return {f"{'.'.join(at)}: {plain}"}
    items = plain.items() if isinstance(plain, dict) else enumerate(plain)
    return {line for key, one in items for line in leaves(one, (*at, str(key)))}


def described(found):
    """Return mission, robot and systems of a cell as lines."""
    parts = {"mission": found.mission, "robot": found.robot, "sut": found.suts[0]}
    return leaves({name: codec.to_plain(part) for name, part in parts.items()})


def test_values_reach_what_they_name(demo, changed, golden):
    """``values.txt``: slots of a scenario, and what differs from the slots before without values.

    Waypoints and lasers go by their names, parameters by either spelling, quantities by their own
    unit or by one that is written.
    """
    for name, text in FILES.items():
        (demo / name).write_text(text.replace("import doors", (demo / "doors.scenery").read_text()))
    told, plain = [], set()
    for name, _ in cases(VALUES):
        found = described(cell(changed(**yaml.safe_load(name))))
        lines = [f"- {one}" for one in plain - found] + [f"+ {one}" for one in found - plain]
        if "{" not in name[1:-1]:
            plain, lines = found, []
        told += written((name, []), sorted(lines, key=lambda line: (line[2:], line)))
    golden(VALUES.name, "\n".join(told) + "\n")


def test_values_at_the_top(campaign):
    suts = {"sut": {"pilot": {"max_speed": 0.3}}}
    (found,) = load_campaign(campaign(robot={"courier": {"mass": "40 kg"}}, matrix=suts)).cells
    assert (found.robot.mass, found.suts[0].parameters) == (40.0, {"max_speed": 0.3})


def test_a_draw_with_a_value_leaves_the_other_draws_as_they_were(campaign):
    value = {"kitchen_doorway.location.translation.x": "0.5 m"}
    plans = []
    for floorplan in ("flat", {"flat": value}):
        calm = {"vary": {"floorplan": floorplan, "samples": 3}, "mission": "courier",
                "oracles": ["reached"]}  # fmt: skip
        plans.append([c.plan for c in load_campaign(campaign(scenarios={"calm": calm})).cells])
    assert len(plans[0]) == len(plans[1]) == 3
    for one, other in zip(*plans, strict=True):
        differing = {a.name for a, b in zip(one.openings, other.openings, strict=True) if a != b}
        assert differing <= {"kitchen_doorway"}
        assert one.features == other.features


def test_one_file_is_read_once_for_all_values(demo, changed):
    scenario, library = cell(changed()).scenario, LayerLibrary(demo)
    library.mission(scenario.mission)
    (demo / "courier.mission.yaml").write_text("no mission any more")
    for n in range(20):
        moved = with_overrides(scenario, "mission", 0, {"start.y": n / 100})
        assert library.mission(moved.mission)[0].start.y == n / 100


def test_a_plan_that_was_compiled_with_other_values_is_as_it_was(demo, changed):
    scenario, library = cell(changed()).scenario, LayerLibrary(demo)
    text = library.plan_text(demo / "flat.fpm")
    plain = text.compile()
    wide = with_overrides(scenario, "floorplan", 0, {"room_length": "4 m"})
    assert library.floorplan(wide.floorplan) != plain
    assert text.compile() == plain == library.floorplan(scenario.floorplan)


def test_later_values_win_over_those_that_are_written(changed):
    scenario = cell(changed(behaviours=[{"doors_moving": {"swing": "50 deg/s"}}])).scenario
    later = with_overrides(scenario, "behaviours", 0, {"swing": "70 deg/s", "slide": "1 m/s"})
    assert later.behaviours[0].overrides == {"swing": "70 deg/s", "slide": "1 m/s"}
    for slot, number in (("sut", 1), ("vary", 0)):
        with pytest.raises(ValueError, match=f"no layer {number} in {slot}"):
            with_overrides(scenario, slot, number, {})


@pytest.mark.parametrize("name", ["demo/campaign", "two_lasers/campaign", "ortega2024/paper"])
def test_each_shipped_scenario_as_a_campaign_of_its_own_has_the_same_runs(
    tmp_path, campaigns, name
):
    file = shutil.copytree(campaigns, tmp_path / "all") / f"{name}.yaml"
    campaign = load_campaign(file)
    expected = {run.label: run.digest for run in expand(campaign).specs}
    alone = {}
    for one in campaign.cells:
        text = campaign_text(
            campaign, one.scenario, name=one.name, repeats=campaign.repeats or 1, comment="Alone."
        )
        file.write_text(text)
        alone |= {run.label: run.digest for run in runs(file)}
    assert alone == expected


def test_a_scenario_with_values_in_every_slot_runs_alone_as_it_does_there(demo, changed):
    (demo / "mine.yaml").write_text("sut: mine\nlike: pilot\n")
    path = changed(
        floorplan={"flat": {"room_length": "3.1 m"}},
        behaviours=[{"doors_moving": {"swing": "52.5 deg/s", "kitchen_opens": "8.54 s"}}],
        mission={"courier": {"start.y": 0.1, "waypoints.kitchen.x": "30 cm"}},
        robot={"courier": {"laser": {"noise": "2 cm"}}},
        sut=["mine", {"pilot": {"max_speed": "0.4 m/s"}}],
        map={"resolution": "4 cm", "doors": "initial"},
        chance="per campaign",
        limit="45.5 s",
    )
    campaign, expected = load_campaign(path), digests(path, "changed")
    scenario = cell(path).scenario
    expect = {"scenario": "changed", "oracle": "reached", "verdict": "fail", "why": "found"}
    text = campaign_text(
        campaign, scenario, name="changed", about="x", comment="Two\nlines", expect=[expect]
    )
    (demo / "alone.yaml").write_text(text)
    assert digests(demo / "alone.yaml") == expected
    assert len(expected) == 2
    assert load_campaign(demo / "alone.yaml").declared.expectations[0].why == "found"
    (demo / "alone.yaml").write_text(campaign_text(campaign, scenario, name="changed", sut=1))
    assert digests(demo / "alone.yaml") == expected[1:]


def test_variants_with_values_run_alone_as_they_do_there(demo, campaign):
    vary = {"floorplan": {"flat": {"slack": "0.1 m"}}, "samples": 2}
    calm = {"vary": vary, "mission": "courier", "oracles": ["reached"]}
    path = campaign(scenarios={"calm": calm})
    made = load_campaign(path)
    scenario = replace(made.cells[0].scenario, name="other")
    (demo / "alone.yaml").write_text(campaign_text(made, scenario, name="calm"))
    assert digests(demo / "alone.yaml") == digests(path)
