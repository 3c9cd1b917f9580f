"""Causes of failures: delta debugging, and searches when it is known what makes a run fail."""

import json
import shutil
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from daemon.analysis.blame import (
    BudgetSpentError,
    Candidate,
    CandidateRunner,
    NoFailureError,
    ddmin,
    load_case,
    save_campaign,
    story_lines,
)
from daemon.campaign import examine, load_campaign
from daemon.model.verdicts import Outcome
from grammars.floorplan import load_floorplan
from grammars.jsonld import scenery_document
from grammars.model.behaviour import Trigger
from grammars.model.grid import OCCUPIED
from grammars.model.map_files import write_map
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene
from grammars.text.diagnostics import InputError, Severity
from templates.occupancy import occupancy_grid
from tests.analysis.blame import (
    CAMPAIGN,
    HASTY,
    explain,
    explain_and_save,
    failing_if,
    pretend,
    write,
)

SIZES = st.integers(0, 40)
CAUSES = st.sets(st.integers(0, 39), max_size=5)


def steps(items, fails):
    """Every configuration on the way to the least that fails; each of them fails."""
    found = [tuple(items)]
    for one in ddmin(items, lambda tried: next((i for i, t in enumerate(tried) if fails(t)), None)):
        assert fails(one)
        found.append(one)
    return found


@given(SIZES, CAUSES)
def test_the_cause_of_a_monotone_failure_is_found_exactly(size, cause):
    cause = {item for item in cause if item < size}
    *_, last = steps(range(size), lambda remaining: cause <= set(remaining))
    assert last == tuple(sorted(cause))


@given(st.integers(1, 12), st.randoms(use_true_random=False))
def test_the_last_configuration_is_1_minimal_whatever_fails(size, chance):
    whole, verdicts = tuple(range(size)), {}

    def fails(remaining):
        return remaining == whole or verdicts.setdefault(remaining, chance.random() < 0.3)

    *_, last = steps(whole, fails)
    for index in range(len(last)):
        assert not fails(last[:index] + last[index + 1 :])


@given(SIZES, CAUSES)
def test_order_is_kept_and_every_step_is_smaller(size, cause):
    assume(cause & set(range(size)))
    ways = steps(range(size), lambda remaining: bool(cause & set(remaining)))
    assert all(list(step) == sorted(step) for step in ways)
    assert all(len(late) < len(early) for early, late in pairwise(ways))


def test_one_cause_among_many_takes_few_tests():
    asked = []

    def fails(remaining):
        asked.append(remaining)
        return 777 in remaining

    *_, last = ddmin(
        range(1024), lambda tried: next((i for i, t in enumerate(tried) if fails(t)), None)
    )
    assert last == (777,)
    assert len(asked) <= 2 * 10 + 1, "halving, not walking"


def shuts(spec):
    """The kitchen door shuts in the robot's face while it heads for the bedroom."""
    heads = any(w.id == "bedroom" for w in spec.mission.waypoints)
    return heads and any(
        isinstance(b, Trigger) and b.joint == "kitchen_door.hinge" for b in spec.behaviours
    )


def fast(spec):
    return spec.sut.parameters.get("max_speed") == 0.7


@pytest.fixture
def file(demo):
    """A campaign of one scenario with the layers of the demonstration."""
    return write(demo)


@pytest.fixture
def hasty(demo):
    """The same campaign with a system under test that has parameters."""
    (demo / "hasty.yaml").write_text(HASTY)
    return write(demo, pilot="hasty")


def without_a_door(sut):
    """Fails that system when its kitchen door shuts, or when nothing holds it open."""

    def rule(candidate):
        ways = {b.joint: b for b in candidate.spec.behaviours}
        door = any(thing.name == "kitchen_door" for thing in candidate.scene.objects)
        shut = isinstance(ways.get("kitchen_door.hinge"), Trigger | None)
        fails = door and shut and fast(candidate.spec) == (sut == "hasty")
        return Outcome.FAIL if fails else Outcome.PASS

    return rule


def fast_and_near(spec):
    return fast(spec) and any(isinstance(b, Trigger) and b.distance == 1.0 for b in spec.behaviours)


FAILS = {"rule": lambda _: Outcome.FAIL}
SHUTS = {"rule": failing_if(shuts)}
STORIES = {
    "the kitchen door shuts on the way to the bedroom": ("pilot", SHUTS),
    "the reason stays the same on the way": ("pilot", {"rule": without_a_door("pilot")}),
    "so it does for a hasty robot": ("hasty", {"rule": without_a_door("hasty")}),
    "everything fails": ("pilot", FAILS),
    "the oracle can be chosen": ("pilot", FAILS | {"oracle": "no-contact"}),
    "overrides and parameters are suspects too": ("hasty", {"rule": failing_if(fast_and_near)}),
    "a fast robot alone": ("hasty", {"rule": failing_if(fast)}),
    "the budget is spent": ("pilot", SHUTS | {"budget": 12}),
    "interrupted": ("pilot", SHUTS | {"interrupt_after": 14}),
}


def told(folder, monkeypatch, sut, rule, interrupt_after=10**9, **more):
    """The story of a failure, line by line, with the number of runs that it took."""
    pretended = pretend(monkeypatch, rule)
    pretended.interrupt_after = interrupt_after
    story = explain(write(folder, pilot=sut), sut, **more)
    assert len({spec.digest for spec in pretended.specs}) == len(pretended.specs)
    yield f"{story.verdict.oracle} fails, {len(pretended.specs)} runs; {story.stopped}"
    yield from story_lines(story, "pilot")


def test_stories_of_failures(demo, monkeypatch, golden):
    (demo / "hasty.yaml").write_text(HASTY)
    lines = []
    for name, (sut, how) in STORIES.items():
        lines += [f"--- {name}", *told(demo, monkeypatch, sut, **how)]
    golden("stories.txt", "\n".join([*lines, ""]))


def test_nothing_is_told_of_a_failure_that_was_not_seen(file, monkeypatch):
    pretend(monkeypatch, SHUTS["rule"]).interrupt_after = 0
    with pytest.raises(BudgetSpentError):
        explain(file, budget=0)
    with pytest.raises(KeyboardInterrupt):
        explain(file)


def test_a_parameter_is_called_by_its_setting_whatever_its_name_says(hasty, monkeypatch):
    pretend(monkeypatch, failing_if(fast))
    story = explain(hasty, "hasty")
    assert story.settings == ("max_speed",)
    (needed,) = story.layers
    reworded = replace(needed.element, name="0.7 for the speed: at most")
    lines = story_lines(replace(story, layers=(replace(needed, element=reworded),)), "pilot")
    assert "without max_speed: passes" in lines
    assert lines[-1] == "  parameters max_speed (of 2)"


@pytest.mark.parametrize("outcome", [Outcome.PASS, Outcome.ERROR, Outcome.INCONCLUSIVE])
def test_a_run_that_does_not_fail_is_not_to_blame(file, monkeypatch, outcome):
    pretended = pretend(monkeypatch, lambda _: outcome)
    with pytest.raises(NoFailureError, match=f"does not fail: reached {outcome}"):
        explain(file)
    assert len(pretended.specs) == 1


@pytest.mark.parametrize(
    ("scenario", "sut", "repeat", "message"),
    [
        ("rudd", "", 0, 'no scenario "rudd"(.|\n)*rude'),
        ("rude", "pilo", 0, 'no system under test "pilo"(.|\n)*pilot'),
        ("rude", "", 2, "no repeat 2(.|\n)*from 0"),
    ],
)
def test_a_run_that_the_campaign_has_not_is_refused(file, scenario, sut, repeat, message):
    with pytest.raises(InputError, match=message):
        load_case(file, scenario, sut, repeat)


def test_candidates_run_in_batches_up_to_the_first_that_fails(file, monkeypatch):
    pretended = pretend(monkeypatch, failing_if(lambda spec: spec.seed == 2))
    case = load_case(file, "rude", "pilot", 0)
    one = case.candidate(frozenset(), case.spec.oracles[0])
    tried = [Candidate(replace(one.spec, seed=seed), one.scene) for seed in range(6)]
    runner = CandidateRunner(4)
    assert runner.first_failing([None, *tried[:2]]) is None
    assert runner.first_failing(tried) == 2
    assert [spec.seed for spec in pretended.specs] == [0, 1, 2, 3], "the batch of the failing one"
    assert (runner.runs, runner.cached) == (4, 2)
    assert runner.recall(tried[2]).outcome is Outcome.FAIL
    with pytest.raises(BudgetSpentError):
        runner.first_failing(tried[4:])


@pytest.fixture
def save(monkeypatch):
    """Explain and save the failure of runs of a campaign file: ``save(path, fails)``."""

    def act(path, fails=lambda spec: bool(spec.behaviours), *words, **more):
        pretend(monkeypatch, failing_if(fails))
        return explain_and_save(path, *words, **more)

    return act


def same_run(saved):
    """Whether the saved campaign specifies the smallest run, whatever it is called."""
    smallest = saved.smallest
    named = replace(saved.run, campaign=smallest.campaign, scenario=smallest.scenario)
    return named.digest == smallest.digest


def split_layer(folder, name, at):
    """The text of a layer before and after its instances."""
    return (folder / f"{name}.scenery").read_text().split(at)


def test_a_saved_run_is_the_smallest_one(demo, save):
    (demo / "later.scenery").write_text("kitchen_door starts at 20 deg\ntom is frozen\n")
    models, instances = split_layer(demo, "people", at := "visitor       is a")
    (demo / "kinds.scenery").write_text(models)
    (demo / "people.scenery").write_text(at + instances)

    def fails(spec):
        joints = {b.joint for b in spec.behaviours}
        return {"kitchen_door.hinge", "visitor.x"} <= joints and spec.repeat == 1

    path = write(demo, **{"[doors, people]": "[kinds, doors, people, later]"})
    saved = save(path, fails, repeat=1)
    assert saved.story.objects == ("kitchen_door", "visitor")
    copy = saved.file.parent / "scenery" / "people.scenery"
    assert copy.read_bytes() == (demo / "people.scenery").read_bytes()
    campaign, findings = examine(saved.file)
    assert [run.repeat for run in saved.runs] == [0, 1]
    assert same_run(saved)
    assert campaign.cells[0].scenario.without
    assert "Repeat 1 fails" in saved.file.read_text()
    assert not [d for d in findings if d.severity is Severity.ERROR]


def test_doors_by_chance_and_missing_parts_stay_so(demo, save):
    (demo / "lively.scenery").write_text(
        "living_room_door toggles between closed and open after uniform 3 s to 9 s, from 1 s\n"
    )
    without = "mission: courier\n    without: [tom, waypoint 1]\n"
    lively = {"- doors_open\n": "- doors_open\n      - lively\n", "mission: courier\n": without}

    def fails(spec):
        moves = any(b.joint.startswith("living_room_door") for b in spec.behaviours)
        visited = [waypoint.id for waypoint in spec.mission.waypoints]
        return moves and "living-room" in visited and spec.repeat == 1

    saved = save(write(demo, **lively), fails, repeat=1)
    assert dict(saved.story.before)["waypoint"] == len(saved.case.spec.mission.waypoints)
    assert saved.story.objects == ("living_room_door",)
    assert len(saved.smallest.mission.waypoints) == 1
    assert same_run(saved)


def test_layers_of_one_name_in_two_folders_are_both_saved(demo, save):
    models, instances = split_layer(demo, "doors", at := "bedroom_door     is a")
    for name, part in (("kinds", models), ("flat", at + instances)):
        (demo / name).mkdir()
        (demo / name / "doors.scenery").write_text(part)
    both = "[kinds/doors.scenery, flat/doors.scenery]"
    assert same_run(save(write(demo, **{"[doors, people]": both})))


def test_a_run_that_fails_in_the_first_repeat_as_well_is_saved_as_one(demo, save):
    assert [run.repeat for run in save(write(demo), repeat=1).runs] == [0]


def test_the_three_mistakes_of_the_papers_stack_are_three_suspects(campaigns, tmp_path, save):
    folder = shutil.copytree(campaigns / "ortega2024", tmp_path / "ortega2024")
    path = folder / "ros.yaml"
    text = (folder / "first.yaml").read_text()
    path.write_text(text.replace("sut: [pilot]", "sut: [fro-diff, a2s]"))
    corrected, a2s = load_campaign(path).cells[0].suts
    settings = load_case(path, "S1", "a2s", 0).settings
    footprint, *others = settings.elements
    assert settings.like == "fro-diff"
    names = [element.setting for element in settings.elements]
    assert names == ["footprint", "scan/topic", "amcl/odom_model_type"]
    everything = settings.without(frozenset(settings.elements))
    assert everything.parameters == corrected.parameters
    assert settings.without(frozenset()) == a2s
    parameters = settings.without(frozenset(others)).parameters
    tiny = parameters["move_base"]["local_costmap"]["footprint"]

    def fails(spec):
        return bool(spec.sut.parameters["move_base"]["local_costmap"]["footprint"] == tiny)

    saved = save(path, fails, "a2s", scenario="S1")
    assert [str(one.element) for one in saved.story.layers] == [footprint.name]
    assert saved.run.sut.parameters == parameters
    assert "like:" in (saved.file.parent / "suts" / "a2s.yaml").read_text()


def test_a_variant_of_a_plan_and_layers_of_others_are_saved_as_they_are(demo, save):
    layers = [load_scenery(demo / f"{name}.scenery") for name in ("doors", "people")]
    document = scenery_document(layers[1], load_floorplan(demo / "flat.fpm"), layers)
    (demo / "crowd.jsonld").write_text(json.dumps(document))
    start, end = CAMPAIGN.index("    behaviours:"), CAMPAIGN.index("    mission:")
    text = CAMPAIGN[:start] + CAMPAIGN[end:]
    vary = {"floorplan: flat": "vary: {floorplan: flat, samples: 1}", ", no-contact": ""}
    path = write(demo, text, **{"[doors, people]": "[crowd]"}, **vary)
    saved = save(path, lambda s: any(b.joint == "tom.x" for b in s.behaviours), scenario="rude@3")
    assert saved.story.objects == ("tom",)
    assert saved.run.scene == saved.smallest.scene
    assert saved.run.behaviours == saved.smallest.behaviours


def test_files_that_would_specify_another_run_are_refused(demo, save, tmp_path):
    saved = save(write(demo))
    found = saved.found
    other = replace(found.smallest.spec, limit=17.0)
    changed = replace(found, smallest=Candidate(other, found.smallest.scene))
    with pytest.raises(ValueError, match="its limit differs"):
        save_campaign(saved.case, changed, tmp_path / "other", saved.runner)


def test_a_ros2_stack_is_saved_as_it_is_started_with_its_files(demo, save):
    (demo / "params.yaml").write_text("amcl: {}\n")
    (demo / "base.yaml").write_text(
        "sut: base\nkind: ros2\nlaunch: nav {map} {params}\nfiles: {params: params.yaml}\n"
        "environment: {setup: /a.bash}\nready: amcl\nlate: 10 %\n"
    )
    (demo / "nav2.yaml").write_text("sut: nav2\nlike: base\nstart-up: 2 min\n")
    saved = save(write(demo, pilot="nav2"), sut="nav2")
    assert saved.case.settings.elements == ()
    assert saved.run.sut == saved.case.spec.sut
    assert (saved.file.parent / "suts" / "files" / "params").read_text() == "amcl: {}\n"


@pytest.mark.parametrize("value", [OCCUPIED, 37])
def test_a_map_file_is_saved_beside_the_campaign(demo, monkeypatch, save, value):
    monkeypatch.setenv("XDG_CACHE_HOME", str(demo / "cache"))
    scene = compile_scene(load_floorplan(demo / "flat.fpm"), [])
    grid = occupancy_grid(scene, laser_height=0.2)
    grid.cells[:2, :3] = value
    write_map(grid, demo / "own", laser_height=0.2)
    saved = save(write(demo, f"{CAMPAIGN}map: {{file: own.yaml}}\n"))
    assert saved.run.map == saved.case.spec.map
    assert saved.run.map.file


def test_a_saved_campaign_draws_its_map_by_the_same_rule(demo, save):
    saved = save(write(demo, f"{CAMPAIGN}map: {{rule: centre}}\n"))
    assert (saved.run.map.rule, saved.run.map) == ("centre", saved.case.spec.map)


def test_values_beside_the_names_of_layers_are_saved_with_them(demo, save):
    values = {
        "floorplan: flat": "floorplan: {flat: {room_length: 3.1 m}}",
        "mission: courier": "mission: {courier: {start.y: 0.1}}",
        "robot: courier": "robot: {courier: {laser.noise: 2 cm}}",
        "sut: [pilot]": "sut: [{pilot: {max_speed: 0.4, lookahead: 0.5}}]",
    }

    def fails(spec):
        fast = spec.sut.parameters.get("max_speed") == 0.4
        return fast and "kitchen_door.hinge" in {b.joint for b in spec.behaviours}

    saved = save(write(demo, **values), fails)
    assert saved.story.parameters == ("max_speed: 0.4",)
    for part in ("scene", "sut", "robot", "mission"):
        assert getattr(saved.run, part) == getattr(saved.smallest, part)
    assert (saved.run.robot.laser.noise, saved.run.mission.start.y) == (0.02, 0.1)
