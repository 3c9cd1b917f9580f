"""The least of a failure that still fails, its candidates being runs of the search."""

import shutil
from collections.abc import Callable
from dataclasses import replace

import pytest

from daemon.analysis.blame import Candidate
from daemon.campaign import expand, load_campaign
from daemon.model.spec import LeadingMargin, RunResult, RunSpec, Timing, TraceInfo
from daemon.model.verdicts import Outcome, Verdict
from daemon.search.point_runner import PointRunner
from daemon.search.program import run_search
from daemon.search.shrinking import missing_words, shrink_failure
from grammars.model.behaviour import Trigger
from tests.analysis.search.cases import load_search_case
from tests.analysis.search.local_runs import LocalRuns

CAMPAIGN = """\
campaign: tiny
seed: 3
repeats: 2
limit: 16 s
robot: courier
oracles: navigation
matrix: {sut: [pilot]}
scenarios:
  rude:
    floorplan: flat
    objects: [doors, people]
    behaviours: [doors_open, doors_in_your_face]
    mission: courier
    oracles: [reached, keeps-clear]
search:
  near:
    scenario: rude
    minimise: keeps-clear
    over: {doors_in_your_face.near: 0.5 .. 2 m}
"""
Rule = Callable[[RunSpec], bool]


def judged_by(fails):
    """Executes nothing: runs fail keeps-clear by a rule about their specification."""

    def result(candidate):
        spec = candidate.spec
        margin = -0.02 if fails(spec) else 0.1
        outcome = Outcome.FAIL if margin < 0.0 else Outcome.PASS
        verdicts = tuple(
            Verdict(o.name, o.text, outcome, margin, margin, "m")
            if o.name == "keeps-clear"
            else Verdict(o.name, o.text, Outcome.PASS, 0.1, 0.1, "m")
            for o in spec.oracles
        )
        leads = tuple(LeadingMargin(v.oracle, v.lower, "m") for v in verdicts)
        trace, timing = TraceInfo("0" * 64, 0, 0), Timing(0.1, 0.1, 16.0)
        return RunResult(spec.digest, outcome, verdicts, "finished", trace, timing, leads=leads)

    return lambda candidates: [result(candidate) for candidate in candidates]


@pytest.fixture
def case(tmp_path, campaigns):
    for name in ("demo", "robots", "suts"):
        shutil.copytree(campaigns / name, tmp_path / name)
    file = tmp_path / "demo" / "tiny.yaml"
    file.write_text(CAMPAIGN)
    return load_search_case(file, "near")


def explored(case, fails):
    runs = LocalRuns(executor=judged_by(fails))
    points = PointRunner(case, runs)
    begun = points.begin((1.5,), "explore", "halton", guided=False)
    return points, runs, points.finish(begun)


def test_one_door_and_what_it_does_are_left(case):
    def fails(spec):
        doing = any(b.joint.startswith("kitchen_door") for b in spec.behaviours)
        return doing and any(w.id == "kitchen" for w in spec.mission.waypoints)

    points, runs, failure = explored(case, fails)
    assert failure.fails
    shrunk = shrink_failure(points, failure)
    assert shrunk.minimal
    assert shrunk.story[-2:] == (
        "  waypoints kitchen (of 4)",
        "  behaviours kitchen_door.hinge (of 5)",
    )
    assert shrunk.left == (
        "1 of 6 objects (kitchen_door), 1 of 4 waypoints (kitchen) and "
        "1 of 5 behaviours (kitchen_door.hinge) are left"
    )
    tried = [p for p in runs.proposals if p.phase == "shrink"]
    assert shrunk.runs == len(tried) > 5
    assert [p.number for p in tried] == list(range(1, len(tried) + 1)), "each is its own scenario"
    assert {p.values for p in tried} == {(1.5,)}
    assert any("without" in p.note and "bedroom" in p.note for p in tried)
    assert len(set(runs.digests)) == len(runs.digests)


def test_what_does_not_fail_is_not_shrunk(case):
    points, _, passing = explored(case, lambda spec: False)
    shrunk = shrink_failure(points, passing)
    assert shrunk.story == (
        "nothing to shrink: near.0/pilot/0 does not fail keeps-clear: "
        "reached pass, keeps-clear pass",
    )
    assert shrunk.runs == 0


def test_what_was_left_out_is_told(case):
    whole = case.run_case((1.5,), 0)
    everything = whole.remaining(frozenset())
    oracle = whole.spec.oracles[1]
    full = Candidate(whole.spec, whole.cell.scene)
    fewer = frozenset(e for e in everything if e.name in ("kitchen", "home"))
    assert missing_words(full, whole.candidate(fewer, oracle)) == (
        "without waypoint kitchen, waypoint home"
    )
    plain = frozenset(e for e in everything if e.kind == "override")
    assert missing_words(full, whole.candidate(plain, oracle)) == "with fewer values"


def test_a_whole_search_leaves_a_file_with_the_very_run_it_found(case):
    def fails(spec):
        near = {b.distance for b in spec.behaviours if isinstance(b, Trigger)}
        return any(distance > 1.2 for distance in near)

    task = replace(case.task, runs=6, method="halton", confirm=2, then=("nearest", "shrink"))
    searched = replace(case, task=task)
    runs = LocalRuns(executor=judged_by(fails))
    answer = run_search(searched, runs)
    assert answer.nearest is not None
    assert answer.shrunk is not None
    file = case.folder / "near.found.yaml"
    file.write_text(answer.found)
    (run,) = expand(load_campaign(file)).specs
    assert (
        run.digest
        == answer.told_failure.digest
        == runs.digests[answer.nearest.result.proposal.position]
    )
    assert run.label == answer.told_failure.label
    phases = list(dict.fromkeys(p.phase for p in runs.proposals))
    assert phases == ["explore", "confirm", "nearest", "shrink"]
