"""Whole runs over rmw_zenoh, with a pretended stack that is started by its launch command."""

import json
import os
import shlex
import sys
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from daemon.campaign import expand, load_campaign
from daemon.model.spec import SutReference
from daemon.run import execute
from daemon.trace import read_trace
from grammars.model.mission import Mission, Waypoint
from tests.daemon.stacks.ros2 import pretended_zenoh_stack
from tests.daemon.stacks.ros2.pretended_zenoh_stack import Options

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def demo(campaigns):
    return expand(load_campaign(campaigns / "demo" / "campaign.yaml"))


def specified(demo, options, **parameters):
    """Return a run of one waypoint with a stack like that."""
    spec = next(one for one in demo.runs if one.scenario == "open-house")
    words = shlex.quote(json.dumps(asdict(replace(options, forever=True, state="active"))))
    command = f"{sys.executable} -m {pretended_zenoh_stack.__name__} {words}"
    settings = {
        # Braces would be placeholders.
        "launch": f"cd {ROOT} && {command.replace('{', '{{').replace('}', '}}')}",
        "environment": {"PYTHONPATH": os.pathsep.join([str(ROOT), *filter(None, sys.path)])},
        "transport": "zenoh",
        "distribution": "jazzy",
        "ready": ["bt_navigator"],
        "initial-pose": "none",
        "start-up": "120 s",
        "patience": "60 s",
        "repeatable": False,
        **parameters,
    }
    mission = Mission("short", spec.mission.start, (Waypoint("near", 0.8, 0.0),))
    return replace(
        spec, sut=SutReference("pretended", "ros2", settings), mission=mission, limit=20.0
    )


@pytest.mark.short
def test_a_run_without_a_relay(demo, tmp_path):
    path = tmp_path / "run.mcap"
    spec = specified(demo, Options(ticks=40))
    result = execute(spec, demo.scenes[0], trace_path=path)
    assert result.ended == "finished", result.note
    trace = read_trace(path)
    assert [one.state for one in trace.progress][-1] == "succeeded"
    # Every cycle from the goal to its result was answered.
    assert len(trace.latency.seconds) >= 38
    said = "\n".join(event.text for event in trace.events)
    assert "rmw_zenoh_cpp" in said
    assert "goal near accepted" in said
    assert "holds" not in said


def test_a_stack_of_another_distribution_is_told_so(demo, tmp_path):
    spec = specified(demo, Options(distribution="humble"))
    result = execute(spec, demo.scenes[0], trace_path=tmp_path / "run.mcap")
    assert result.ended == "crashed"
    assert "It is that of humble: write distribution: humble" in result.note


def test_definitions_of_the_user_are_used(demo, tmp_path):
    action = tmp_path / "nav2_msgs" / "action" / "NavigateToPose.action"
    action.parent.mkdir(parents=True)
    action.write_text("geometry_msgs/PoseStamped pose\n---\nuint16 error_code\n---\n", "utf-8")
    spec = specified(demo, Options(), definitions=str(tmp_path))
    result = execute(spec, demo.scenes[0], trace_path=tmp_path / "run.mcap")
    assert result.ended == "crashed"
    # The stack's are Jazzy's, so what would meet now does not.
    assert "the definitions differ, nothing would arrive" in result.note
