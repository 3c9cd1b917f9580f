"""Campaign files: scenarios times systems times repeats, likeness, defaults, variants, layers."""

import json
import shutil
from importlib.metadata import EntryPoint

import pytest

from daemon.campaign import LayerLibrary, LayerReference, examine, expand, load_campaign
from daemon.stacks import registry
from grammars.floorplan import load_floorplan
from grammars.jsonld import scene_document, scenery_document
from grammars.scenery import load_scenery
from grammars.text.diagnostics import Where
from templates.jsonld import write_jsonld
from tests.campaign.loaded import cells, messages, runs
from tests.languages.plans import world_of

RUDE = {
    "rude": {
        "like": "calm",
        "behaviours": [{"doors_in_your_face": {"near": "1 m"}}],
        "oracles+": ["no-contact"],
        "limit": "1 min",
    }
}
EMPTY = {"floorplan": "flat", "mission": "courier", "oracles": ["reached"]}
RESTLESS = "every hinged_door toggles between closed and open every 5 s, with probability 0.5"


def test_runs_are_scenarios_times_suts_times_repeats(campaign):
    submission = expand(
        load_campaign(campaign(scenarios=RUDE, repeats=2, matrix={"sut": ["pilot", "idle"]}))
    )
    assert [r.label for r in submission.specs] == [
        f"{scenario}/{sut}/{repeat}"
        for scenario in ("calm", "rude")
        for sut in ("pilot", "idle")
        for repeat in (0, 1)
    ]
    assert len(submission.scenes) == 1


def test_a_scenario_is_like_another_except_for_its_own_words(campaign):
    calm, rude = runs(campaign(scenarios=RUDE))
    assert [o.name for o in calm.oracles] == ["reached"]
    assert [o.name for o in rude.oracles] == ["reached", "no-contact"]
    assert (calm.limit, rude.limit) == (30.0, 60.0)
    assert calm.mission == rude.mission
    assert {b.distance for b in rude.behaviours if b.kind == "trigger"} == {1.0}


def test_a_scenario_gives_variables_of_its_plan_other_values(campaign):
    wide = {"like": "calm", "floorplan": {"flat": {"hinged-width": "1.05 m"}}}
    path = campaign(scenarios={"wide": wide})
    widths = [
        next(d.width for d in cell.scene.doorways if d.name == "kitchen_doorway")
        for cell in load_campaign(path).cells
    ]
    assert widths == pytest.approx([0.95, 1.05])
    assert len(expand(load_campaign(path)).scenes) == 2


def test_the_same_campaign_has_the_same_id_until_something_changes(campaign):
    path = campaign()
    first = expand(load_campaign(path)).campaign
    assert expand(load_campaign(path)).campaign == first
    assert expand(load_campaign(path), fresh=True).campaign != first
    assert expand(load_campaign(campaign(seed=4))).campaign != first


@pytest.mark.parametrize(("chance", "draws"), [("per campaign", 1), ("per repeat", 5)])
def test_random_doors_are_drawn_per_repeat_or_once(demo, campaign, chance, draws):
    (demo / "restless.scenery").write_text(RESTLESS)
    restless = {"like": "calm", "behaviours": "restless", "chance": chance}
    path = campaign(scenarios={"restless": restless}, limit="2 min", repeats=5)
    assert len({str(r.behaviours) for r in runs(path) if r.scenario == "restless"}) == draws


@pytest.mark.parametrize("last", ["calm", "c999"])
def test_a_long_chain_of_scenarios_is_refused_at_its_line(campaign, last):
    """A chain of a thousand took a minute and ended with the recursion limit."""
    links = {"c0": {"like": last}} | {f"c{n}": {"like": f"c{n - 1}"} for n in range(1, 1000)}
    refusals = messages(campaign(scenarios=links))
    assert any("more than 50 scenarios are like one another in a row" in one for one in refusals)


def test_shared_folders_are_found_from_inside_the_campaigns_folder(campaign, monkeypatch):
    monkeypatch.chdir(campaign().parent)
    assert len(load_campaign("campaign.yaml").cells) == 1


@pytest.mark.parametrize(
    "name", ["demo/campaign", "ortega2024/first", "ortega2024/paper", "two_lasers/campaign"]
)
def test_the_campaigns_that_ship_have_no_findings(campaigns, name):
    assert [str(d) for d in examine(campaigns / f"{name}.yaml")[1]] == []


def test_a_varied_scenario_runs_in_every_variant_of_its_plan(campaign):
    vary = {"floorplan": "flat", "samples": 3, "seed": 11}
    varied = {"vary": vary, "mission": "courier", "oracles": ["reached"]}
    path = campaign(scenarios={"calm": varied, "rude": {"like": "calm"}}, repeats=2)
    submission = expand(load_campaign(path))
    scenarios = list(dict.fromkeys(run.scenario for run in submission.specs))
    assert scenarios == [f"{name}@{seed}" for name in ("calm", "rude") for seed in (11, 12, 13)]
    assert len(submission.scenes) == 3
    assert len(submission.specs) == 2 * 3 * 2
    assert expand(load_campaign(path)).campaign == submission.campaign


def test_a_scenario_may_draw_other_variants_than_the_campaign(campaign):
    own = {"like": "calm", "vary": {"floorplan": "flat", "samples": 1, "seed": 9}}
    path = campaign(
        scenarios={"calm": EMPTY, "rude": own}, vary={"floorplan": "flat", "samples": 2}
    )
    assert {run.scenario for run in runs(path)} == {"calm@3", "calm@4", "rude@9"}


def test_layers_written_as_json_ld_make_the_same_runs(demo, campaign):
    plan, doors = load_floorplan(demo / "flat.fpm"), load_scenery(demo / "doors.scenery")
    (written,) = expand(load_campaign(campaign())).scenes
    (demo / "flat2.jsonld").write_text(json.dumps(scene_document(plan)))
    (demo / "doors2.jsonld").write_text(json.dumps(scenery_document(doors, plan)))
    # A folder of JSON-LD files is a layer too, as exports of ours and published models are.
    write_jsonld(world_of(plan, [doors]), demo / "floorplans" / "house")
    for floorplan, objects in (
        ("flat2.jsonld", "doors2.jsonld"),
        ("house", "floorplans/house/objects.json"),
    ):
        other = {"like": "calm", "floorplan": floorplan, "objects": objects}
        read = cells(campaign(scenarios={"other": other}))["other"].scene
        assert read == written, floorplan
    library, here = LayerLibrary(demo), Where("campaign.yaml", 1, 1)
    names = ("house", "floorplans/house")
    by_name, by_path = (library.floorplan(LayerReference(name, {}, here)) for name in names)
    assert by_name is by_path


def test_a_stack_that_cannot_be_loaded_is_found_before_anything_runs(campaign, monkeypatch):
    entry = EntryPoint("mine", "a_module_nobody_has:make", registry.ENTRY_POINT_GROUP)
    monkeypatch.setattr(registry, "installed", lambda group: {"mine": entry})
    (message,) = messages(campaign(matrix={"sut": ["pilot", "mine"]}))
    assert 'the system under test "mine" (a_module_nobody_has:make) cannot be loaded' in message
    assert message.startswith("campaign.yaml:")


DEFAULTS = {
    "floorplan": "flat",
    "objects": "doors",
    "mission": "courier",
    "oracles": ["reached"],
    "limit": "40 s",
}
WRITTEN = {
    "calm": {"behaviours": "doors_open"},
    "rude": {"like": "calm", "behaviours": "doors_in_your_face", "oracles+": ["no-contact"]},
    "other": {"robot": "shuttle", "sut": "idle", "limit": "50 s"},
}


def test_defaults_hold_where_a_scenario_says_nothing_itself_or_by_like(campaign):
    short = expand(load_campaign(campaign(defaults=DEFAULTS, scenarios=WRITTEN)))
    found = [(r.scenario, [o.name for o in r.oracles], r.limit, r.robot.name, r.sut.kind)
             for r in short.specs]  # fmt: skip
    assert found == [
        ("calm", ["reached"], 40.0, "courier", "pilot"),
        ("rude", ["reached", "no-contact"], 40.0, "courier", "pilot"),
        ("other", ["reached"], 50.0, "shuttle", "idle"),
    ]
    spelled = {name: slots if "like" in slots else DEFAULTS | slots
               for name, slots in WRITTEN.items()}  # fmt: skip
    long = expand(load_campaign(campaign(scenarios=spelled)))
    assert (long.runs, long.scenes) == (short.runs, short.scenes)


def test_variants_may_be_a_default(campaign):
    defaults = {"vary": {"floorplan": "flat", "samples": 1}, "mission": "courier",
                "oracles": ["reached"]}  # fmt: skip
    path = campaign(defaults=defaults, scenarios={"calm": {}, "rude": {"like": "calm"}})
    assert set(cells(path)) == {"calm@3", "rude@3"}


def test_robots_and_systems_that_ship_come_last(demo, campaign, campaigns):
    path = campaign(matrix={"sut": ["pilot", "fro-omni"]})
    assert [sut.name for sut in cells(path)["calm"].suts] == ["pilot", "fro-omni"]
    own = (campaigns / "robots" / "courier.yaml").read_text().replace("mass: 30", "mass: 31")
    (demo / "courier.yaml").write_text(own)
    (demo / "suts").mkdir()
    (demo / "suts" / "fro-omni.yaml").write_text("sut: mine\nlike: a2s\n")
    cell = cells(path)["calm"]
    assert cell.robot.mass == 31.0
    # The system that one is like may be one that ships.
    assert [sut.name for sut in cell.suts] == ["pilot", "mine"]


def test_folders_beside_the_campaign_hold_robots_and_systems(campaign, campaigns):
    path = campaign(robot="mine", matrix={"sut": "own"})
    for folder in ("robots", "suts"):
        (path.parent.parent / folder).mkdir()
    shutil.copy(campaigns / "robots" / "courier.yaml", path.parent.parent / "robots" / "mine.yaml")
    (path.parent.parent / "suts" / "own.yaml").write_text("sut: own\nlike: pilot\n")
    assert [(r.robot.name, r.sut.name) for r in runs(path)] == [("courier", "own")]
