"""What campaigns exercise: features, pairs, doors, margins."""

from itertools import pairwise

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from daemon.analysis.coverage import (
    MAX_BINS,
    MODEL,
    Coverage,
    RecognisedFeatures,
    bin_edges,
    feature_leaves,
    margin_histograms,
    pair_counts,
    planned_coverage,
    trace_coverage,
)
from daemon.campaign import expand, load_campaign
from daemon.model.verdicts import Outcome, Verdict
from daemon.run import execute
from grammars.text import codec


@pytest.fixture(scope="module")
def paper(campaigns):
    planned = expand(load_campaign(campaigns / "ortega2024" / "paper.yaml"))
    return planned_coverage(planned.runs, planned.scenes)


def planned(found):
    return {feature.feature: feature.planned for feature in found.features}


def test_the_model_is_a_tree_whose_leaves_can_be_recognised():
    paths = [feature.path for feature in MODEL.features]
    assert len(set(paths)) == len(paths)
    for index, feature in enumerate(MODEL.features):
        assert feature.parent in ("", *paths[:index])
        inner = any(other.parent == feature.path for other in MODEL.features)
        told = feature.planned is not None or feature.named is not None
        assert inner != told, feature.path
        assert feature.about
    roots = [feature.path for feature in MODEL.features if not feature.parent]
    assert roots == ["objective", "sut", "mission", "scenery"]
    for exclusion in MODEL.exclusions:
        assert {exclusion.first, exclusion.second} <= set(paths)


def test_the_papers_campaign_has_the_objectives_and_dynamics_of_section_4(paper):
    runs = planned(paper)
    assert paper.runs == 40
    assert runs["objective/functional"] == 40
    assert runs["objective/robustness"] == 5, "only S2 has doors that move by the clock"
    assert runs["scenery/dynamics/timed"] == 5
    assert runs["scenery/dynamics/triggered"] == 20, "S3.1 to S3.4"
    assert runs["mission/waypoints/one"] == 5, "task 1"
    assert runs["scenery/objects/sliding"] == 0
    assert "sut/configuration/pilot" in runs


def test_alternatives_are_met_once_a_run(paper):
    runs = planned(paper)
    for group in (f.path for f in MODEL.features if f.group == "alternative"):
        members = [count for path, count in runs.items() if path.rpartition("/")[0] == group]
        assert sum(members) == paper.runs, group


def test_pairs_are_exercised_missing_or_excluded(paper):
    pairs, count = paper.pairs, len(paper.features)
    assert pairs.possible + pairs.excluded == count * (count - 1) // 2
    missing = {frozenset(pair) for pair in pairs.missing}
    assert frozenset(("mission/waypoints/one", "scenery/dynamics/timed")) in missing
    assert frozenset(("scenery/dynamics/static", "scenery/dynamics/timed")) not in missing
    met = {frozenset((pair.first, pair.second)): pair.runs for pair in pairs.exercised}
    assert met[frozenset(("mission/waypoints/one", "scenery/dynamics/triggered"))] == 5
    assert not missing & set(met)


PATHS = sorted(f.path for f in MODEL.features if f.planned is not None)
RUNS = st.lists(st.frozensets(st.sampled_from(PATHS)), max_size=6)


@given(RUNS, st.frozensets(st.sampled_from(PATHS)))
def test_another_run_never_takes_a_pair_away(runs, more):
    told = [RecognisedFeatures(tuple(run), tuple(run), False) for run in runs]
    before = {(p.first, p.second) for p in pair_counts(MODEL, told).exercised}
    told.append(RecognisedFeatures(tuple(more), tuple(more), False))
    after = pair_counts(MODEL, told)
    assert before <= {(p.first, p.second) for p in after.exercised}
    assert (
        after.possible + after.excluded == len(feature_leaves(MODEL, told)) * (len(PATHS) - 1) / 2
    )


def verdict(outcome, margin, unit="m"):
    return Verdict("clear", "always(clearance >= 0 m)", outcome, margin, margin, unit)


def test_margins_are_counted_on_their_side_of_zero():
    judged = [
        verdict(Outcome.PASS, 0.1),
        verdict(Outcome.PASS, 0.0),
        verdict(Outcome.FAIL, -0.05),
        verdict(Outcome.FAIL, None),
        verdict(Outcome.INCONCLUSIVE, 0.3),
        verdict(Outcome.ERROR, None, unit=""),
        verdict(Outcome.MEASURE, 3.0),
    ]
    (found,) = margin_histograms(judged)
    assert (found.passed, found.failed, found.undecided, found.unbounded) == (2, 2, 2, 1)
    assert (found.least, found.greatest, found.unit) == (-0.05, 0.1, "m")
    zero = found.edges.index(0.0)
    assert sum(found.counts[:zero]) == 1
    assert sum(found.counts[zero:]) == 2


@given(st.lists(st.floats(-1e6, 1e6).filter(lambda v: v == 0 or abs(v) > 1e-9), min_size=1))
@example([0.7])
@example([-0.07, -0.07])
def test_bins_hold_every_margin_and_have_an_edge_at_zero(values):
    edges = bin_edges(values)
    assert edges[0] <= min(values) <= max(values) < edges[-1]
    assert 0.0 in edges
    assert all(low < high for low, high in pairwise(edges))
    assert 2 <= len(edges) <= MAX_BINS + 4


@pytest.fixture(scope="module")
def rude(campaigns, tmp_path_factory):
    """One run of the demonstration in which doors shut in the robot's face."""
    submission = expand(load_campaign(campaigns / "demo" / "campaign.yaml"))
    spec = next(run for run in submission.runs if run.scenario == "rude-house")
    path = tmp_path_factory.mktemp("coverage") / "rude.mcap"
    execute(spec, submission.scenes[0], trace_path=path)
    return path


def test_a_recorded_run_tells_what_happened_not_what_was_planned(rude):
    found = trace_coverage([rude], near=1.2)
    assert (found.runs, found.recorded) == (1, 1)
    features = {f.feature: (f.planned, f.done) for f in found.features}
    assert features["scenery/dynamics/triggered"] == (1, 1)
    assert features["mission/reach/across-rooms"] == (1, 0), "no door let it in"
    exercised = {path for pair in found.pairs.exercised for path in (pair.first, pair.second)}
    assert "mission/reach/across-rooms" not in exercised
    doors = {door.door: door for door in found.doors}
    assert (doors["kitchen_door"].triggered, doors["kitchen_door"].moved) == (1, 1)
    assert (doors["living_room_door"].planned, doors["living_room_door"].moved) == (0, 0)
    assert doors["kitchen_door"].nearest is not None
    assert doors["kitchen_door"].nearest < 1.2
    (floor,) = found.floor
    assert 0.0 < floor.driven < floor.seen <= floor.free
    assert {margin.oracle for margin in found.margins} >= {"keeps-clear", "no-contact"}
    assert codec.from_json(Coverage, codec.to_json(found)) == found


def test_a_file_that_is_no_trace_is_told(rude, tmp_path):
    (tmp_path / "junk.mcap").write_bytes(b"nothing of the kind")
    found = trace_coverage([tmp_path / "junk.mcap", rude])
    assert found.runs == 1
    (one,) = found.unreadable
    assert one.trace.endswith("junk.mcap")
    assert one.problem
