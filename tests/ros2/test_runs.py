"""Whole runs with a real ROS 2 stack: what is recorded, and what each way to fail is called."""

from __future__ import annotations

import uuid
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import psutil
import pytest

from daemon.campaign import expand, load_campaign
from daemon.model.spec import RunResult, SutReference
from daemon.run import execute
from daemon.trace import Trace, read_outputs, read_trace
from grammars.model.mission import Mission, Waypoint

STANDIN = Path(__file__).parent / "standin.py"
NEAR = (Waypoint("near", 0.8, 0.0),)
"""In front of the robot, which starts at the origin of the demo's flat."""
ROUND = (Waypoint("ahead", 0.5, 0.0), Waypoint("left", 0.6, 0.5), Waypoint("back", 0.1, 0.3))
NODES = ["map_server", "amcl", "controller_server", "planner_server", "bt_navigator"]


@pytest.fixture(scope="module")
def demo(campaigns):
    return expand(load_campaign(campaigns / "demo" / "campaign.yaml"))


@dataclass(frozen=True)
class Recorded:
    """A run, its trace, and what was said while the stack came up."""

    result: RunResult
    trace: Trace
    output: str
    waited_for: tuple[str, ...]

    @property
    def said(self):
        return "\n".join(event.text for event in self.trace.events)


Drive = Callable[..., Recorded]


@pytest.fixture
def drive(demo, tmp_path, ros2_python):
    """Run a mission of the demo's open house with the stand-in; ``options`` are its own."""

    def run(options="", *, waypoints=NEAR, name="run", limit=20.0, **parameters):
        spec = specified(demo, ros2_python, options, waypoints, limit, parameters)
        path = tmp_path / f"{name}.mcap"
        waited = []

        def hear(snapshot):
            if snapshot.waiting:
                waited.append(snapshot.waiting)

        result = execute(spec, demo.scenes[0], trace_path=path, on_progress=hear)
        output = read_outputs(path).get("stack.txt", "")
        return Recorded(result, read_trace(path, views=True), output, tuple(waited))

    return run


def specified(demo, python, options, waypoints, limit, parameters):
    spec = next(s for s in demo.specs if s.scenario == "open-house")
    settings = {
        "launch": f"{python} {STANDIN} map:={{map}} {options}",
        "python": str(python),
        "ready": NODES,
        # Six processes share two cores with whatever else is tested.
        "start-up": "120 s",
        "patience": "30 s",
        "repeatable": False,
        **{key.replace("_", "-"): value for key, value in parameters.items()},
    }
    mission = Mission("short", spec.mission.start, waypoints)
    return replace(
        spec, sut=SutReference("standin", "ros2", settings), mission=mission, limit=limit
    )


@pytest.mark.short
def test_a_stack_drives_the_robot_and_the_trace_tells_everything(drive):
    run = drive(waypoints=ROUND, limit=60.0)
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
    assert {"bt_navigator", "amcl"} <= {event.source for event in run.trace.events}
    assert "Begin navigating" in run.said
    assert "Managed nodes are active" in run.output
    assert any("nodes active" in text for text in run.waited_for)


@pytest.mark.parametrize("mission", ["follow", "through"])
def test_all_waypoints_may_be_one_goal(drive, mission):
    run = drive(waypoints=ROUND, limit=60.0, mission=mission, patience="2 s")
    assert run.result.ended == "finished", run.result.note
    assert [p.reached for p in run.trace.progress] == [0, 1, 2, 3]
    assert run.said.count("accepted") == 1


@pytest.mark.short
@pytest.mark.one_distribution
def test_the_same_run_gets_the_same_commands(drive):
    runs = [drive(name=str(i)) for i in range(2)]
    first, second = (run.trace.command for run in runs)
    assert len(first.time) > 20
    for name in ("time", "vx", "vy", "wz"):
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes()


@pytest.mark.one_distribution
@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("fault:=crash after:=5", "exit code 3"),
        ("fault:=crash after:=5 signal:=11", "SIGSEGV"),
        ("fault:=crash-at-start node:=amcl", "did not come up: the launch command ended"),
        ("fault:=goal-rejected", "rejected the goal near"),
        ("fault:=wrong-frame", "not ready within"),
        ("fault:=no-tf", "not ready within"),
        ("fault:=never-ready node:=bt_navigator", "4 of 5 nodes active, bt_navigator is inactive"),
    ],
)
def test_what_is_not_the_robots_doing_is_an_error_with_the_stacks_words(drive, options, words):
    waits = "not ready" in words or "nodes active" in words
    # What crashes shows when the wait for its command is over.
    run = drive(options, **({"start_up": "12 s"} if waits else {"patience": "2 s"}))
    assert run.result.ended == "crashed"
    assert run.result.outcome == "error"
    assert words in run.result.note
    assert "the stack printed" in run.result.note
    assert run.output


@pytest.mark.short
@pytest.mark.one_distribution
def test_an_abort_is_a_failure_of_the_robot(drive):
    run = drive("fault:=goal-aborted after:=5 error_code:=105 error_msg:=stuck")
    assert run.result.ended == "finished"
    assert run.result.outcome == "fail"
    assert run.trace.progress[-1].state == "aborted"
    assert "goal near aborted, error code 105: stuck" in run.said


@pytest.mark.one_distribution
def test_a_stack_that_hangs_is_given_up(drive):
    run = drive("fault:=hang after:=10", patience="1 s", limit=120.0)
    assert run.result.outcome == "error"
    assert run.trace.valid_until > 0.4
    assert "no command within 1 s: the last one holds" in run.said


@pytest.mark.one_distribution
def test_a_stack_that_cannot_keep_up_is_an_error(drive):
    run = drive("fault:=late every:=3 seconds:=0.4", waypoints=ROUND, patience="0.1 s", limit=60.0)
    assert run.result.outcome == "error"
    assert "could not keep up" in run.result.note


@pytest.mark.one_distribution
def test_an_action_server_that_vanishes_is_an_error(drive):
    run = drive("fault:=no-server after:=10", limit=60.0, patience="2 s")
    assert run.result.outcome == "error"
    assert "is gone" in run.result.note


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
        assert run.trace.command.vx.tobytes() == alone.trace.command.vx.tobytes()
        assert run.said.count("Begin navigating") == 1


@pytest.mark.short
def test_nothing_is_left_running(drive):
    mark = uuid.uuid4().hex
    run = drive(f"error_msg:={mark}")
    assert run.result.ended == "finished", run.result.note
    running = [" ".join(p.info["cmdline"] or ()) for p in psutil.process_iter(["cmdline"])]
    assert not [command for command in running if mark in command]
