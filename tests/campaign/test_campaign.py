"""Campaign files: what they inherit, what they name, what is reported about them."""

import json
import shutil
from importlib.metadata import EntryPoint

import pytest

from daemon.campaign import examine, expand, load_campaign
from daemon.stacks import registry
from grammars.floorplan import load_floorplan
from grammars.jsonld import scene_document, scenery_document
from grammars.scenery import load_scenery
from grammars.text.diagnostics import InputError, Severity
from templates.jsonld import write_jsonld
from tests.languages.plans import world_of

CAMPAIGN = """\
campaign: tiny
seed: 3
repeats: 2
limit: 30 s
robot: courier
oracles: navigation
matrix: {sut: [pilot, idle]}
scenarios:
  calm:
    floorplan: flat
    objects: doors
    behaviours: doors_open
    mission: courier
    oracles: [reached]
  rude:
    like: calm
    behaviours:
      - doors_in_your_face: {near: 1 m}
    oracles+: [no-contact]
    limit: 1 min
"""


@pytest.fixture
def folder(tmp_path, campaigns):
    for name in ("demo", "robots", "suts"):
        shutil.copytree(campaigns / name, tmp_path / name)
    return tmp_path / "demo"


def write(folder, text):
    path = folder / "tiny.yaml"
    path.write_text(text)
    return path


def messages(path):
    with pytest.raises(InputError) as caught:
        load_campaign(path)
    return [str(d).replace(f"{path.parent}/", "") for d in caught.value.findings]


def test_runs_are_scenarios_times_suts_times_repeats(folder):
    submission = expand(load_campaign(write(folder, CAMPAIGN)))
    assert [r.label for r in submission.specs] == [
        f"{scenario}/{sut}/{repeat}"
        for scenario in ("calm", "rude")
        for sut in ("pilot", "idle")
        for repeat in (0, 1)
    ]
    assert len(submission.scenes) == 1


def test_a_scenario_is_like_another_except_for_what_it_says(folder):
    runs = {r.scenario: r for r in expand(load_campaign(write(folder, CAMPAIGN))).specs}
    assert [o.name for o in runs["calm"].oracles] == ["reached"]
    assert [o.name for o in runs["rude"].oracles] == ["reached", "no-contact"]
    assert (runs["calm"].limit, runs["rude"].limit) == (30.0, 60.0)
    assert runs["calm"].mission == runs["rude"].mission


def test_overrides_reach_the_layer_they_stand_beside(folder):
    runs = {r.scenario: r for r in expand(load_campaign(write(folder, CAMPAIGN))).specs}
    triggers = [b for b in runs["rude"].behaviours if b.kind == "trigger"]
    assert {t.distance for t in triggers} == {1.0}


def test_a_scenario_gives_variables_of_its_plan_other_values(folder):
    wider = CAMPAIGN.replace(
        "like: calm\n", "like: calm\n    floorplan: {flat: {hinged-width: 1.05 m}}\n"
    )
    campaign = load_campaign(write(folder, wider))
    widths = {
        cell.name: {d.name: d.width for d in cell.scene.doorways}["kitchen_doorway"]
        for cell in campaign.cells
    }
    assert widths == pytest.approx({"calm": 0.95, "rude": 1.05})
    assert len(expand(campaign).scenes) == 2


def test_the_same_campaign_has_the_same_id_until_something_changes(folder):
    path = write(folder, CAMPAIGN)
    first = expand(load_campaign(path)).campaign
    assert expand(load_campaign(path)).campaign == first
    assert expand(load_campaign(path), fresh=True).campaign != first
    assert (
        expand(load_campaign(write(folder, CAMPAIGN.replace("seed: 3", "seed: 4")))).campaign
        != first
    )


def test_random_doors_are_drawn_per_repeat_or_once(campaigns, tmp_path):
    shutil.copytree(campaigns, tmp_path / "all")
    path = tmp_path / "all" / "ortega2024" / "first.yaml"
    once = [r.behaviours for r in expand(load_campaign(path)).specs if r.scenario == "S2"]
    assert all(b == once[0] for b in once)
    path.write_text(path.read_text().replace("per campaign", "per repeat"))
    anew = [r.behaviours for r in expand(load_campaign(path)).specs if r.scenario == "S2"]
    assert len({str(b) for b in anew}) == 5


@pytest.mark.parametrize("last", ["calm", "c999"])
def test_a_long_chain_of_scenarios_is_refused_at_its_line(folder, last):
    """One of a thousand took a minute and ended with the recursion limit."""
    links = [f"  c0:\n    like: {last}\n"]
    links += [f"  c{n}:\n    like: c{n - 1}\n" for n in range(1, 1000)]
    before, calm, after = CAMPAIGN.partition("  rude:")
    found = messages(write(folder, before + "".join(links) + calm + after))
    assert any("more than 50 scenarios are like one another in a row" in one for one in found)


def test_shared_folders_are_found_from_inside_the_campaigns_folder(folder, monkeypatch):
    write(folder, CAMPAIGN)
    monkeypatch.chdir(folder)
    assert len(load_campaign("tiny.yaml").cells) == 2


@pytest.mark.parametrize("name", ["demo/campaign.yaml", "ortega2024/first.yaml"])
def test_the_campaigns_that_ship_pass_their_own_check(campaigns, name):
    found = examine(campaigns / name)[1]
    assert [str(d) for d in found if d.severity is Severity.ERROR] == []


DOORLESS = CAMPAIGN.replace("    objects: doors\n    behaviours: doors_open\n", "").replace(
    "    behaviours:\n      - doors_in_your_face: {near: 1 m}\n", ""
)
VARIED = DOORLESS.replace(
    "    floorplan: flat\n", "    vary: {floorplan: flat, samples: 3, seed: 11}\n"
)


def test_a_varied_scenario_runs_in_every_variant_of_its_plan(folder):
    text = VARIED.replace("sut: [pilot, idle]", "sut: idle")
    submission = expand(load_campaign(write(folder, text)))
    scenarios = list(dict.fromkeys(run.scenario for run in submission.specs))
    assert scenarios == [f"{name}@{seed}" for name in ("calm", "rude") for seed in (11, 12, 13)]
    assert len(submission.scenes) == 3
    assert len(submission.specs) == 2 * 3 * 2
    again = expand(load_campaign(write(folder, text)))
    assert again.campaign == submission.campaign


def test_a_scenario_may_draw_other_variants_than_the_campaign(folder):
    text = DOORLESS.replace("repeats: 2", "repeats: 2\nvary: {floorplan: flat, samples: 2}")
    text = text.replace(
        "    like: calm\n", "    like: calm\n    vary: {floorplan: flat, samples: 1, seed: 9}\n"
    )
    scenarios = {run.scenario for run in expand(load_campaign(write(folder, text))).specs}
    assert scenarios == {"calm@3", "calm@4", "rude@9"}


def test_layers_written_as_json_ld_make_the_same_runs(folder):
    plan, doors = load_floorplan(folder / "flat.fpm"), load_scenery(folder / "doors.scenery")
    (folder / "flat2.jsonld").write_text(json.dumps(scene_document(plan)))
    (folder / "doors2.jsonld").write_text(json.dumps(scenery_document(doors, plan)))
    text = CAMPAIGN.replace("floorplan: flat", "floorplan: flat2.jsonld")
    text = text.replace("objects: doors", "objects: doors2.jsonld")
    written = expand(load_campaign(write(folder, CAMPAIGN))).scenes[0]
    read = expand(load_campaign(write(folder, text))).scenes[0]
    assert read == written


def test_a_folder_of_json_ld_files_is_a_layer(folder):
    """As exports of ours and published models are."""
    plan, doors = load_floorplan(folder / "flat.fpm"), load_scenery(folder / "doors.scenery")
    write_jsonld(world_of(plan, [doors]), folder / "floorplans" / "house")
    written = expand(load_campaign(write(folder, CAMPAIGN))).scenes[0]
    for name in ("house", "floorplans/house"):
        text = CAMPAIGN.replace("floorplan: flat", f"floorplan: {name}")
        text = text.replace("objects: doors", "objects: floorplans/house/objects.json")
        assert expand(load_campaign(write(folder, text))).scenes[0] == written


def test_a_stack_that_cannot_be_loaded_is_found_before_anything_runs(folder, monkeypatch):
    entry = EntryPoint("mine", "a_module_nobody_has:make", registry.ENTRY_POINT_GROUP)
    monkeypatch.setattr(registry, "installed", lambda group: {"mine": entry})
    (found,) = messages(write(folder, CAMPAIGN.replace("[pilot, idle]", "[pilot, mine]")))
    assert 'the system under test "mine" (a_module_nobody_has:make) cannot be loaded' in found
    assert found.startswith("tiny.yaml:")
