"""What the search finds when it is known what makes a run fail."""

import re
from dataclasses import replace

import pytest

from daemon.analysis.blame import (
    BudgetSpentError,
    CandidateRunner,
    NoFailureError,
    explain_failure,
    load_case,
    story_lines,
)
from daemon.model.verdicts import Outcome
from grammars.model.behaviour import Trigger
from grammars.text.diagnostics import InputError
from tests.analysis.blame.cases import CAMPAIGN, failing_if, pretend, write


def shuts(door):
    """Fails where this door shuts in the robot's face while it heads for the bedroom."""

    def fails(spec):
        heads = any(w.id == "bedroom" for w in spec.mission.waypoints)
        return heads and any(
            isinstance(b, Trigger) and b.joint == f"{door}.hinge" for b in spec.behaviours
        )

    return failing_if(fails)


def test_a_case_put_together_again_is_the_run_itself(folder):
    case = load_case(write(folder), "rude", "pilot", 1)
    (first, _) = case.spec.oracles
    again = case.candidate(frozenset(), first)
    assert (again.scene, again.spec.behaviours) == (case.cell.scene, case.spec.behaviours)
    assert (again.spec.seed, again.spec.repeat) == (case.spec.seed, 1)
    assert again.spec.oracles == (first,)


def test_the_layer_the_door_and_the_waypoint_are_found(folder, monkeypatch):
    pretended = pretend(monkeypatch, shuts("kitchen_door"))
    case = load_case(write(folder), "rude", "", 0)
    runner = CandidateRunner(budget=100)
    found = explain_failure(case, runner)
    story = found.story
    needed = {str(one.element): one.word for one in story.layers}
    assert needed == {"doors": "unresolved", "doors_in_your_face": "pass"}
    assert story.objects == ("kitchen_door",)
    assert story.waypoints == ("bedroom",)
    assert story.behaviours == ("kitchen_door.hinge",)
    assert (story.minimal, story.stopped) == (True, "")
    assert dict(story.before) == {"object": 6, "waypoint": 4, "behaviour": 5, "parameter": 0}
    assert runner.runs == len(pretended.specs) < 40
    digests = [spec.digest for spec in pretended.specs]
    assert len(set(digests)) == len(digests), "no run is executed twice"


@pytest.mark.parametrize("sut", ["pilot", "hasty"])
def test_the_reason_stays_the_same_on_the_way(folder, monkeypatch, sut):
    (folder / "hasty.yaml").write_text("sut: hasty\nlike: pilot\nparameters: {max_speed: 0.7}\n")

    def rule(candidate):
        """Fails a hasty robot whose kitchen door shuts, or that nothing holds open."""
        ways = {b.joint: b for b in candidate.spec.behaviours}
        door = any(thing.name == "kitchen_door" for thing in candidate.scene.objects)
        shuts = isinstance(ways.get("kitchen_door.hinge"), Trigger | None)
        hasty = candidate.spec.sut.parameters.get("max_speed") == (0.7 if sut == "hasty" else None)
        return Outcome.FAIL if door and shuts and hasty else Outcome.PASS

    pretend(monkeypatch, rule)
    text = CAMPAIGN.replace("sut: [pilot]", f"sut: [{sut}]")
    story = explain_failure(
        load_case(write(folder, text), "rude", sut, 0), CandidateRunner(200)
    ).story
    assert story.behaviours == ("kitchen_door.hinge",), "without, the door would be shut"
    ends = {str(one.element): one.word for one in story.layers}
    hasty = {"max_speed: 0.7": "pass"} if sut == "hasty" else {}
    expected = {"doors": "unresolved", "doors_open": "fail", "doors_in_your_face": "pass"}
    assert ends == expected | hasty


def test_what_fails_without_any_layer_is_told(folder, monkeypatch):
    pretend(monkeypatch, lambda _: Outcome.FAIL)
    story = explain_failure(load_case(write(folder), "rude", "", 0), CandidateRunner(100)).story
    assert (story.layers, story.objects) == ((), ())
    assert len(story.waypoints) == 1
    assert story.minimal


def test_overrides_and_parameters_are_suspects_too(folder, monkeypatch):
    (folder / "hasty.yaml").write_text(
        "sut: hasty\nlike: pilot\nparameters: {max_speed: 0.7, lookahead: 0.9}\n"
    )
    text = CAMPAIGN.replace("sut: [pilot]", "sut: [hasty]")

    def fails(spec):
        near = any(isinstance(b, Trigger) and b.distance == 1.0 for b in spec.behaviours)
        return near and spec.sut.parameters.get("max_speed") == 0.7

    pretend(monkeypatch, failing_if(fails))
    found = explain_failure(
        load_case(write(folder, text), "rude", "hasty", 0), CandidateRunner(200)
    )
    names = {str(one.element) for one in found.story.layers}
    assert names == {
        "doors",
        "doors_in_your_face",
        "doors_in_your_face: near 1 m",
        "max_speed: 0.7",
    }
    assert found.story.parameters == ("max_speed: 0.7",)
    assert found.smallest.spec.sut.parameters == {"max_speed": 0.7}


def test_a_parameter_is_called_by_its_setting_whatever_its_name_says(folder, monkeypatch):
    (folder / "hasty.yaml").write_text("sut: hasty\nlike: pilot\nparameters: {max_speed: 0.7}\n")
    text = CAMPAIGN.replace("sut: [pilot]", "sut: [hasty]")

    def fails(spec):
        return spec.sut.parameters.get("max_speed") == 0.7

    pretend(monkeypatch, failing_if(fails))
    case = load_case(write(folder, text), "rude", "hasty", 0)
    story = explain_failure(case, CandidateRunner(200)).story
    assert story.settings == ("max_speed",)
    (needed,) = story.layers
    reworded = replace(needed.element, name="0.7 for the speed: at most")
    lines = story_lines(replace(story, layers=(replace(needed, element=reworded),)), "pilot")
    assert "without max_speed: passes" in lines
    assert lines[-1] == "  parameters max_speed (of 1)"


def test_the_oracle_can_be_chosen(folder, monkeypatch):
    pretend(monkeypatch, lambda _: Outcome.FAIL)
    case = load_case(write(folder), "rude", "", 0)
    assert explain_failure(case, CandidateRunner(100)).story.verdict.oracle == "reached"
    assert (
        explain_failure(case, CandidateRunner(100), "no-contact").story.verdict.oracle
        == "no-contact"
    )
    with pytest.raises(InputError, match=r'no oracle "contact"\s+did you mean "no-contact"'):
        explain_failure(case, CandidateRunner(100), "contact")


@pytest.mark.parametrize("outcome", [Outcome.PASS, Outcome.ERROR, Outcome.INCONCLUSIVE])
def test_a_run_that_does_not_fail_is_not_to_blame(folder, monkeypatch, outcome):
    pretended = pretend(monkeypatch, lambda _: outcome)
    with pytest.raises(NoFailureError, match=f"does not fail: reached {outcome}"):
        explain_failure(load_case(write(folder), "rude", "", 0), CandidateRunner(100))
    assert len(pretended.specs) == 1


def test_a_spent_budget_keeps_what_was_found(folder, monkeypatch):
    pretended = pretend(monkeypatch, shuts("kitchen_door"))
    case = load_case(write(folder), "rude", "", 0)
    story = explain_failure(case, CandidateRunner(12)).story
    assert len(pretended.specs) <= 12
    assert "budget of 12 runs" in story.stopped
    assert not story.minimal
    assert "kitchen_door" in story.objects
    assert len(story.objects) < 6
    with pytest.raises(BudgetSpentError):
        explain_failure(case, CandidateRunner(0))


def test_an_interrupt_keeps_what_was_found(folder, monkeypatch):
    pretended = pretend(monkeypatch, shuts("kitchen_door"))
    pretended.interrupt_after = 14
    story = explain_failure(load_case(write(folder), "rude", "", 0), CandidateRunner(100)).story
    assert (story.stopped, story.minimal) == ("interrupted", False)
    assert "kitchen_door" in story.objects


def test_an_interrupt_before_anything_is_known_is_one(folder, monkeypatch):
    pretend(monkeypatch, shuts("kitchen_door")).interrupt_after = 0
    with pytest.raises(KeyboardInterrupt):
        explain_failure(load_case(write(folder), "rude", "", 0), CandidateRunner(100))


@pytest.mark.parametrize(
    ("scenario", "sut", "repeat", "message"),
    [
        ("rudd", "", 0, 'no scenario "rudd".*rude'),
        ("rude", "pilo", 0, 'no system under test "pilo".*pilot'),
        ("rude", "", 2, "no repeat 2.*from 0"),
    ],
)
def test_what_is_not_in_the_campaign_is_refused(folder, scenario, sut, repeat, message):
    with pytest.raises(InputError) as caught:
        load_case(write(folder), scenario, sut, repeat)
    (diagnostic,) = caught.value.findings
    assert re.search(message, f"{diagnostic.message} {diagnostic.hint}")
