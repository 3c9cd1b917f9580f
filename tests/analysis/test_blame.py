"""Causes of failures: delta debugging, and searches when it is known what makes a run fail."""

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
    story_lines,
)
from daemon.model.verdicts import Outcome
from grammars.model.behaviour import Trigger
from grammars.text.diagnostics import InputError
from tests.analysis.blame import HASTY, explain, failing_if, pretend, write

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


def words_of(story):
    """How the run ends without each layer."""
    return {str(one.element): one.word for one in story.layers}


def test_a_case_put_together_again_is_the_run_itself(file):
    case = load_case(file, "rude", "pilot", 1)
    (first, _) = case.spec.oracles
    again = case.candidate(frozenset(), first)
    assert again.scene == case.cell.scene
    assert again.spec == replace(case.spec, oracles=(first,))


def test_the_layer_the_door_and_the_waypoint_are_found(file, monkeypatch):
    pretended = pretend(monkeypatch, failing_if(shuts))
    story = explain(file, "")
    assert words_of(story) == {"doors": "unresolved", "doors_in_your_face": "pass"}
    assert story.objects == ("kitchen_door",)
    assert story.waypoints == ("bedroom",)
    assert story.behaviours == ("kitchen_door.hinge",)
    assert (story.minimal, story.stopped) == (True, "")
    assert dict(story.before) == {"object": 6, "waypoint": 4, "behaviour": 5, "parameter": 0}
    digests = {spec.digest for spec in pretended.specs}
    assert len(digests) == len(pretended.specs) < 40, "no run is executed twice"


@pytest.mark.parametrize("sut", ["pilot", "hasty"])
def test_the_reason_stays_the_same_on_the_way(demo, hasty, monkeypatch, sut):
    def rule(candidate):
        """Fails a hasty robot whose kitchen door shuts, or that nothing holds open."""
        ways = {b.joint: b for b in candidate.spec.behaviours}
        door = any(thing.name == "kitchen_door" for thing in candidate.scene.objects)
        shuts = isinstance(ways.get("kitchen_door.hinge"), Trigger | None)
        return (
            Outcome.FAIL
            if door and shuts and fast(candidate.spec) == (sut == "hasty")
            else Outcome.PASS
        )

    pretend(monkeypatch, rule)
    story = explain(write(demo, pilot=sut), sut)
    assert story.behaviours == ("kitchen_door.hinge",), "without, the door would be shut"
    expected = {"doors": "unresolved", "doors_open": "fail", "doors_in_your_face": "pass"}
    assert words_of(story) == expected | ({"max_speed: 0.7": "pass"} if sut == "hasty" else {})


def test_a_run_that_fails_without_any_layer_needs_one_waypoint(file, monkeypatch):
    pretend(monkeypatch, lambda _: Outcome.FAIL)
    story = explain(file)
    assert (story.layers, story.objects, len(story.waypoints)) == ((), (), 1)
    assert story.minimal


def test_overrides_and_parameters_are_suspects_too(hasty, monkeypatch):
    def fails(spec):
        near = any(isinstance(b, Trigger) and b.distance == 1.0 for b in spec.behaviours)
        return near and fast(spec)

    pretend(monkeypatch, failing_if(fails))
    story = explain(hasty, "hasty")
    names = {"doors", "doors_in_your_face", "doors_in_your_face: near 1 m", "max_speed: 0.7"}
    assert set(words_of(story)) == names
    assert story.parameters == ("max_speed: 0.7",)


def test_a_parameter_is_called_by_its_setting_whatever_its_name_says(hasty, monkeypatch):
    pretend(monkeypatch, failing_if(fast))
    story = explain(hasty, "hasty")
    assert story.settings == ("max_speed",)
    (needed,) = story.layers
    reworded = replace(needed.element, name="0.7 for the speed: at most")
    lines = story_lines(replace(story, layers=(replace(needed, element=reworded),)), "pilot")
    assert "without max_speed: passes" in lines
    assert lines[-1] == "  parameters max_speed (of 2)"


def test_the_oracle_can_be_chosen(file, monkeypatch):
    pretend(monkeypatch, lambda _: Outcome.FAIL)
    assert explain(file).verdict.oracle == "reached"
    assert explain(file, oracle="no-contact").verdict.oracle == "no-contact"
    with pytest.raises(InputError, match=r'no oracle "contact"\s+did you mean "no-contact"'):
        explain(file, oracle="contact")


@pytest.mark.parametrize("outcome", [Outcome.PASS, Outcome.ERROR, Outcome.INCONCLUSIVE])
def test_a_run_that_does_not_fail_is_not_to_blame(file, monkeypatch, outcome):
    pretended = pretend(monkeypatch, lambda _: outcome)
    with pytest.raises(NoFailureError, match=f"does not fail: reached {outcome}"):
        explain(file)
    assert len(pretended.specs) == 1


def test_a_spent_budget_keeps_the_smallest_failure_so_far(file, monkeypatch):
    pretended = pretend(monkeypatch, failing_if(shuts))
    story = explain(file, budget=12)
    assert len(pretended.specs) <= 12
    assert "budget of 12 runs" in story.stopped
    assert not story.minimal
    assert "kitchen_door" in story.objects
    assert len(story.objects) < 6
    with pytest.raises(BudgetSpentError):
        explain(file, budget=0)


def test_an_interrupt_keeps_the_smallest_failure_so_far(file, monkeypatch):
    pretend(monkeypatch, failing_if(shuts)).interrupt_after = 14
    story = explain(file)
    assert (story.stopped, story.minimal) == ("interrupted", False)
    assert "kitchen_door" in story.objects
    pretend(monkeypatch, failing_if(shuts)).interrupt_after = 0
    with pytest.raises(KeyboardInterrupt):
        explain(file)


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
    assert runner.known(tried[2]).verdict.outcome is Outcome.FAIL
    with pytest.raises(BudgetSpentError):
        runner.first_failing(tried[4:])
