"""What campaigns exercise: features, doors, floor."""

from dataclasses import replace

import numpy as np
import pytest

from daemon.analysis.coverage import (
    Coverage,
    planned_coverage,
    run_coverage,
    sum_coverage,
    trace_coverage,
)
from daemon.campaign import expand, load_campaign
from daemon.run import execute
from grammars.model.scene import Region
from grammars.text import codec
from tests.engine.judging.traces import CORRIDOR, along, box, make_trace, mission


@pytest.fixture(scope="module")
def paper(campaigns):
    planned = expand(load_campaign(campaigns / "ortega2024" / "paper.yaml"))
    return planned_coverage(planned.specs, planned.scenes)


def planned(found):
    return {feature.feature: feature.planned for feature in found.features}


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


@pytest.mark.parametrize(
    "group",
    ["sut/configuration", "sut/base", "sut/odometry", "sut/map", "mission/waypoints",
     "mission/distance", "mission/reach"],
)  # fmt: skip
def test_alternatives_are_met_once_a_run(paper, group):
    (members,) = (one for one in paper.groups if one.path == group)
    assert sum(feature.planned for feature in members.planned) == paper.runs


@pytest.mark.parametrize("rate", [1.0, 20.0, 100.0])
def test_rooms_are_crossed_at_any_rate_of_poses(rate):
    rooms = (
        Region("west", box(-1.0, -1.0, 5.0, 1.0)),
        Region("east", box(5.0, -1.0, 11.0, 1.0)),
    )
    time = np.arange(12.0 * rate) / rate
    scene = replace(CORRIDOR, regions=rooms)
    trace = make_trace(along(time, speed=0.75), scene=scene, goal=mission((8.0, 0.0)))
    (reach,) = (
        feature
        for feature in sum_coverage([run_coverage(trace)]).features
        if feature.feature == "mission/reach/across-rooms"
    )
    assert (reach.planned, reach.done) == (1, 1)


@pytest.fixture(scope="module")
def rude(campaigns, tmp_path_factory):
    """One run of the demonstration in which doors shut in the robot's face."""
    submission = expand(load_campaign(campaigns / "demo" / "campaign.yaml"))
    spec = next(run for run in submission.specs if run.scenario == "rude-house")
    path = tmp_path_factory.mktemp("coverage") / "rude.mcap"
    execute(spec, submission.scenes[0], trace_path=path)
    return path


def test_a_recorded_run_tells_what_happened_not_what_was_planned(rude):
    found = trace_coverage([rude], near=1.2)
    assert (found.runs, found.recorded) == (1, 1)
    features = {f.feature: (f.planned, f.done) for f in found.features}
    assert features["scenery/dynamics/triggered"] == (1, 1)
    assert features["mission/reach/across-rooms"] == (1, 0), "no door let it in"
    doors = {door.door: door for door in found.doors}
    assert (doors["kitchen_door"].triggered, doors["kitchen_door"].moved) == (1, 1)
    assert (doors["living_room_door"].planned, doors["living_room_door"].moved) == (0, 0)
    assert doors["kitchen_door"].nearest is not None
    assert doors["kitchen_door"].nearest < 1.2
    (floor,) = found.floor
    assert 0.0 < floor.driven < floor.seen <= floor.free
    assert codec.from_json(Coverage, codec.to_json(found)) == found


def test_a_file_that_is_no_trace_is_told(rude, tmp_path):
    (tmp_path / "junk.mcap").write_bytes(b"nothing of the kind")
    found = trace_coverage([tmp_path / "junk.mcap", rude])
    assert found.runs == 1
    (one,) = found.unreadable
    assert one.trace.endswith("junk.mcap")
    assert one.problem
