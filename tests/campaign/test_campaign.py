"""Campaign files: scenarios times systems times repeats, likeness, defaults, variants, layers."""

import shutil
from importlib.metadata import EntryPoint

import pytest

from daemon.campaign import LayerLibrary, LayerReference, examine, expand, load_campaign
from daemon.stacks import registry
from grammars.scenery.composition import compile_scene
from grammars.text.diagnostics import Where
from templates.jsonld import write_jsonld
from tests.campaign.loaded import cells, messages, runs
from tests.languages.plans import layer, two_rooms, world_of

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


VARIED = {"vary": {"floorplan": "flat", "samples": 2, "seed": 11}, **EMPTY}
del VARIED["floorplan"]
DEFAULTS = EMPTY | {"objects": "doors", "limit": "40 s"}
WRITTEN = {
    "calm": {"behaviours": "doors_open"},
    "rude": {"like": "calm", "behaviours": "doors_in_your_face", "oracles+": ["no-contact"]},
    "other": {"robot": "shuttle", "sut": "idle", "limit": "50 s"},
}
CAMPAIGNS = {
    "scenarios times systems times repeats": {
        "scenarios": RUDE, "repeats": 2, "matrix": {"sut": ["pilot", "idle"]}},
    "other values of a plan": {
        "scenarios": {
            "wide": {"like": "calm", "floorplan": {"flat": {"hinged-width": "1.05 m"}}}}},
    "variants of a plan, also of a scenario like another": {
        "scenarios": {"calm": VARIED, "rude": {"like": "calm"}}, "repeats": 2},
    "other variants than the campaign": {
        "scenarios": {
            "calm": EMPTY,
            "rude": {"like": "calm", "vary": {"floorplan": "flat", "samples": 1, "seed": 9}}},
        "vary": {"floorplan": "flat", "samples": 2}},
    "defaults where a scenario says nothing itself or by like": {
        "defaults": DEFAULTS, "scenarios": WRITTEN},
    "variants by default": {
        "defaults": {"vary": {"floorplan": "flat", "samples": 1}, "mission": "courier",
                     "oracles": ["reached"]},
        "scenarios": {"calm": {}, "rude": {"like": "calm"}}},
}  # fmt: skip


def test_runs_of_campaigns(campaign, golden):
    """``runs.txt``: label, robot, system, limit, oracles and digests of scene and behaviours."""
    lines = []
    for name, changes in CAMPAIGNS.items():
        submission = expand(load_campaign(campaign(**changes)))
        scenes = [scene.digest for scene in submission.scenes]
        lines += [f"--- {name}: {len(scenes)} scenes"]
        for run in submission.specs:
            oracles = ", ".join(oracle.name for oracle in run.oracles)
            near = {b.distance for b in run.behaviours if b.kind == "trigger"}
            doors = ", ".join(f"within {distance:g} m" for distance in near)
            lines += [
                f"{run.label}: {run.robot.name} by {run.sut.kind}, {run.limit:g} s, "
                f"scene {scenes.index(run.scene)}, {oracles}; {doors}".rstrip("; ")
            ]
    golden("runs.txt", "\n".join(lines) + "\n")


def test_defaults_are_as_written_in_every_scenario(campaign):
    short = expand(load_campaign(campaign(defaults=DEFAULTS, scenarios=WRITTEN)))
    spelled = {name: slots if "like" in slots else DEFAULTS | slots
               for name, slots in WRITTEN.items()}  # fmt: skip
    long = expand(load_campaign(campaign(scenarios=spelled)))
    assert (long.runs, long.scenes) == (short.runs, short.scenes)


def test_a_scenario_gives_variables_of_its_plan_other_values(campaign):
    made = load_campaign(campaign(**CAMPAIGNS["other values of a plan"])).cells
    widths = [d.width for c in made for d in c.scene.doorways if d.name == "kitchen_doorway"]
    assert widths == pytest.approx([0.95, 1.05])


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


@pytest.mark.parametrize("last", ["calm", "c59"])
def test_a_long_chain_of_scenarios_is_refused_at_its_line(campaign, last):
    links = {"c0": {"like": last}} | {f"c{n}": {"like": f"c{n - 1}"} for n in range(1, 60)}
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


def test_layers_written_as_json_ld_make_the_same_scene(demo):
    """A folder of JSON-LD files is a layer, as exports of ours and published models are."""
    plan, doors = (
        two_rooms(),
        layer("d is a slider in kitchen_doorway, sliding left, on the inside"),
    )
    write_jsonld(world_of(plan, [doors]), demo / "floorplans" / "house")
    library = LayerLibrary(demo)
    by_name, by_path, objects = (
        LayerReference(name, {}, Where("campaign.yaml", 1, 1))
        for name in ("house", "floorplans/house", "floorplans/house/objects.json")
    )
    scene = compile_scene(library.floorplan(by_name), [library.scenery(objects)])
    assert scene == compile_scene(plan, [doors])
    assert library.floorplan(by_name) is library.floorplan(by_path)


def test_a_layer_in_yaml_may_end_in_yml(demo):
    (demo / "go.yml").write_bytes((demo / "courier.mission.yaml").read_bytes())
    one, other = (
        LayerLibrary(demo).mission(LayerReference(name, {}, Where("campaign.yaml", 1, 1)))[0]
        for name in ("go.yml", "courier")
    )
    assert one == other


def test_a_stack_that_cannot_be_loaded_is_found_before_anything_runs(campaign, monkeypatch):
    entry = EntryPoint("mine", "a_module_nobody_has:make", registry.ENTRY_POINT_GROUP)
    monkeypatch.setattr(registry, "installed", lambda group: {"mine": entry})
    (message,) = messages(campaign(matrix={"sut": ["pilot", "mine"]}))
    assert 'the system under test "mine" (a_module_nobody_has:make) cannot be loaded' in message
    assert message.startswith("campaign.yaml:")


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
