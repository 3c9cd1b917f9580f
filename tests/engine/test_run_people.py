"""The demo flat with people in it: the same road as every run, nothing special on the way."""

import math
import shutil
from dataclasses import replace

import numpy as np
import pytest

from daemon.campaign import examine, expand
from daemon.run import execute
from daemon.trace import read_trace
from grammars.model.kinematics import link_poses
from grammars.text.diagnostics import Severity
from templates.occupancy import occupancy_grid

CROWDED = """
  crowded-house:
    like: open-house
    objects: [doors, people]
    behaviours: [doors_open, surprise]
"""
SURPRISE = """
bedroom_door goes from open to closed when waypoint living-room is reached, after 1 s
"""


@pytest.fixture(scope="module")
def submission(campaigns, tmp_path_factory):
    folder = tmp_path_factory.mktemp("crowd") / "campaigns"
    shutil.copytree(campaigns, folder)
    file = folder / "demo" / "campaign.yaml"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("\nexpect:", f"{CROWDED}\nexpect:"), encoding="utf-8")
    (folder / "demo" / "surprise.scenery").write_text(SURPRISE, encoding="utf-8")
    campaign, findings = examine(file)
    found = [d for d in findings if "people.scenery" in d.where.file]
    assert [str(d) for d in found if d.severity is Severity.ERROR] == []
    return expand(campaign)


@pytest.fixture(scope="module")
def spec(submission):
    return next(s for s in submission.specs if s.scenario == "crowded-house")


@pytest.fixture(scope="module")
def scene(submission, spec):
    return next(s for s in submission.scenes if s.digest == spec.scene)


@pytest.fixture(scope="module")
def trace(spec, scene, tmp_path_factory):
    path = tmp_path_factory.mktemp("trace") / "run.mcap"
    execute(spec, scene, trace_path=path)
    return read_trace(path)


def test_the_visitor_walks_in_the_trace(trace, scene):
    visitor = next(o for o in scene.objects if o.name == "visitor")
    first = scene.joint_names.index("visitor.x")
    states = trace.joints.position[:, first : first + 3]
    for row in (0, 40, len(states) // 2):
        pose = link_poses(visitor, states[row].tolist())["body"]
        assert 1.6 - 1e-9 <= pose.x <= 6.6 + 1e-9
        assert pose.y == pytest.approx(0.0, abs=1e-9)
    steps = np.diff(states[:, 0]) / np.diff(trace.joints.time)
    assert 0.69 < np.abs(steps).max() < 0.7 + 1e-6


def test_the_visitor_makes_way_for_the_robot(trace):
    texts = [event.text for event in trace.events if event.source == "visitor"]
    assert texts[0] == "sets out"
    assert "yields to the robot" in texts


def test_a_door_reacts_to_the_mission(trace):
    reached = [e.time for e in trace.events if e.text == "waypoint 2 reached"]
    reacted = [e.time for e in trace.events if e.source == "bedroom_door.hinge"]
    assert len(reached) == len(reacted) == 1
    assert 1.0 <= reacted[0] - reached[0] <= 1.2
    assert not math.isnan(reacted[0])


def test_the_map_of_a_crowded_house_shows_no_people(scene):
    person = next(o for o in scene.objects if o.name == "visitor")
    alone = replace(scene, objects=tuple(o for o in scene.objects if o is not person))
    crowded = occupancy_grid(scene, laser_height=0.3, joints={})
    empty = occupancy_grid(alone, laser_height=0.3, joints={})
    assert np.array_equal(crowded.cells, empty.cells)
