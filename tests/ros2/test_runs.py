"""Whole runs with a real ROS 2 stack: what is recorded, and what each way to fail is called."""

import uuid
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import psutil
import pytest

from daemon.campaign import expand, load_campaign
from daemon.model.spec import SutReference
from daemon.run import execute
from daemon.trace import read_outputs, read_trace
from grammars.model.mission import Mission, Waypoint

STANDIN = Path(__file__).parent / "standin.py"
LAUNCHER = STANDIN.with_name("launch_standin.py")
NEAR = (Waypoint("near", 0.8, 0.0),)
"""In front of the robot, which starts at the origin of the demo's flat."""
ROUND = (Waypoint("ahead", 0.5, 0.0), Waypoint("left", 0.6, 0.5), Waypoint("back", 0.1, 0.3))
NODES = ["map_server", "amcl", "controller_server", "planner_server", "bt_navigator"]
FAILURES = {
    # Options of the stand-in, other settings, what the error has to say. Of a launcher each node
    # has a process of its own, and launch says how it ended.
    "planner dies, launched": (
        "fault:=dies,goal-aborted node:=planner_server signal:=11", {},
        "planner_server died with exit code -11 (SIGSEGV) at"),
    "action server vanishes": ("fault:=no-server", {"patience": "2 s"}, "is gone"),
    "goal rejected": ("fault:=goal-rejected", {}, "rejected the goal near"),
    "amcl dies at start, launched": (
        "fault:=dies-at-start node:=amcl", {},
        "the stack did not come up: amcl died with exit code 3"),
    "late response": (
        "fault:=late-response node:=controller_server seconds:=1", {},
        "lifecycle_manager_navigation: Failed to change state for node: controller_server"),
}  # fmt: skip
SHORT = ("planner dies, launched",)


@pytest.fixture(scope="module")
def demo(campaigns):
    return expand(load_campaign(campaigns / "demo" / "campaign.yaml"))


def specified(demo, python, waypoints, limit, parameters, options="", program=STANDIN):
    """A mission in the demo's open house with the stand-in, which gets these options."""
    spec = next(s for s in demo.specs if s.scenario == "open-house")
    settings = {
        "launch": f"{python} {program} map:={{map}} {options}",
        "python": str(python),
        "ready": NODES,
        # Two cores are shared with whatever else is tested.
        "start-up": "120 s",
        "patience": "30 s",
        "repeatable": False,
        **{key.replace("_", "-"): value for key, value in parameters.items()},
    }
    mission = Mission("short", spec.mission.start, waypoints)
    sut = SutReference("standin", "ros2", settings)
    return replace(spec, sut=sut, mission=mission, limit=limit)


def recorded(
    demo, python, folder, options="", *, name="run", waypoints=NEAR, limit=20.0, launcher=False,
    **more,
):  # fmt: skip
    """Run the stand-in: the result, the trace, what was said in the run, and while it came up.

    With ``launcher`` the node that fails has a process of its own; other settings are the stack's.
    """
    program = LAUNCHER if launcher else STANDIN
    spec = specified(demo, python, waypoints, limit, more, options, program)
    path, waited = folder / f"{name}.mcap", []
    result = execute(
        spec, demo.scenes[0], trace_path=path, on_progress=lambda one: waited.append(one.waiting)
    )
    trace = read_trace(path, views=True)
    said = "\n".join(event.text for event in trace.events)
    output = read_outputs(path).get("stack.txt", "")
    return SimpleNamespace(result=result, trace=trace, output=output, waited_for=waited, said=said)


@pytest.fixture
def drive(demo, tmp_path, ros2_python):
    """Run the stand-in: ``drive(options, launcher=True)``."""
    return partial(recorded, demo, ros2_python, tmp_path)


@pytest.mark.short
def test_a_stack_drives_the_robot_and_the_trace_tells_everything(drive):
    run = drive(waypoints=ROUND, limit=60.0, record=["behavior tree", "global costmap"])
    assert run.result.ended == "finished", run.result.note
    assert [p.reached for p in run.trace.progress] == [0, 1, 2, 3]
    assert run.trace.progress[-1].state == "succeeded"
    end = run.trace.ground_truth
    assert np.hypot(end.x[-1] - 0.1, end.y[-1] - 0.3) < 0.35
    # Every cycle with a goal is answered, and by the command of that cycle.
    assert len(run.trace.latency.seconds) > 0.9 * len(run.trace.command.time)
    assert "holds" not in run.said, "no answer was late"
    assert len(run.trace.estimate.time) > 20
    assert run.trace.plans
    assert [costmap.scope for costmap in run.trace.costmaps] == ["global"]
    changes = [change for log in run.trace.reports for change in log.changes]
    assert [change.current for change in changes] == 3 * ["RUNNING", "SUCCESS"]
    assert {"bt_navigator", "amcl"} <= {event.source for event in run.trace.events}
    assert "Begin navigating" in run.said
    assert "Managed nodes are active" in run.output
    assert any("nodes active" in text for text in run.waited_for if text)


def moving(run):
    """Return times and commands since the robot began to move.

    Nothing is awaited until the first answer, so that one may be heard a cycle later.
    """
    command = run.trace.command
    table = np.array([command.time, command.vx, command.vy, command.wz])
    return table[:, np.flatnonzero(command.vx)[0] :]


@pytest.mark.short
@pytest.mark.one_distribution
def test_the_same_run_gets_the_same_commands(drive):
    first, second = (moving(drive(name=str(i))) for i in range(2))
    assert first.shape[1] > 20
    assert first.tobytes() == second.tobytes()


@pytest.mark.one_distribution
@pytest.mark.parametrize(
    "failure", [pytest.param(n, marks=pytest.mark.short if n in SHORT else ()) for n in FAILURES]
)
def test_what_is_not_the_robots_doing_is_an_error_with_its_cause(drive, failure):
    options, settings, words = FAILURES[failure]
    run = drive(options, launcher="launched" in failure, **settings)
    assert run.result.ended == "crashed"
    assert run.result.outcome == "error"
    assert words in run.result.note
    assert "the stack printed" in run.result.note
    assert run.output


@pytest.mark.short
@pytest.mark.one_distribution
def test_an_abort_is_a_failure_of_the_robot(drive):
    run = drive("fault:=goal-aborted error_code:=105 error_msg:=stuck")
    assert run.result.ended == "finished"
    assert run.result.outcome == "fail"
    assert run.trace.progress[-1].state == "aborted"
    assert "goal near aborted, error code 105: stuck" in run.said


@pytest.mark.short
@pytest.mark.one_distribution
def test_a_second_start_follows_one_that_failed(drive, tmp_path):
    options = f"fault:=late-response node:=amcl seconds:=1 once:={tmp_path / 'once'}"
    run = drive(options, attempts=2)
    assert run.result.ended == "finished", run.result.note
    assert "the first start failed" in run.said


@pytest.mark.short
@pytest.mark.one_distribution
def test_two_runs_at_once_do_not_hear_each_other(drive):
    alone = drive(name="alone")
    with ThreadPoolExecutor(2) as both:
        asked = [both.submit(drive, name=name) for name in ("one", "other")]
        runs = [each.result() for each in asked]
    for run in runs:
        assert run.result.ended == "finished", run.result.note
        # Who heard the other's clock, scan or goal would have driven otherwise.
        assert moving(run).tobytes() == moving(alone).tobytes()
        assert run.said.count("Begin navigating") == 1


@pytest.mark.short
def test_nothing_is_left_running(drive):
    mark = uuid.uuid4().hex
    run = drive(f"error_msg:={mark}")
    assert run.result.ended == "finished", run.result.note
    running = [" ".join(p.info["cmdline"] or ()) for p in psutil.process_iter(["cmdline"])]
    assert not [command for command in running if mark in command]
