"""The ROS 2 of the tests is genuine, and the stand-in does on its wire what Nav2 does."""

import json
import os
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

from grammars.model.grid import FREE, OCCUPIED, OccupancyGrid
from grammars.model.map_files import write_map
from tests.ros2 import environment

HERE = Path(__file__).parent
SUCCEEDED, ABORTED = 4, 6
"""Of action_msgs/GoalStatus."""
SEND_GOAL = "RIHS01_a4fcb3bee1bf32e21a0e541a943b221aa0826996e2c98f079b47022b256f48b5"
"""Hash of NavigateToPose_SendGoal in Nav2 of Kilted."""

Drive = Callable[..., dict[str, Any]]


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """A map of 5 m by 4 m, walls around and one that juts out between start and far end."""
    cells = np.full((80, 100), FREE, dtype=np.int8)
    cells[:2] = cells[-2:] = OCCUPIED
    cells[:, :2] = cells[:, -2:] = OCCUPIED
    cells[:40, 48:52] = OCCUPIED
    grid = OccupancyGrid(0.05, -1.0, -1.5, cells)
    return write_map(grid, tmp_path_factory.mktemp("map") / "room", laser_height=0.3)[1]


@pytest.fixture
def drive(ros2_environment, ros2_variables, room, tmp_path):
    """Launch the stand-in, let the robot of the tests give it a goal, end it; what happened."""

    def run(*options, **request):
        log = tmp_path / "stack.txt"
        python = str(ros2_environment.python)
        launch = [python, str(HERE / "launch_standin.py"), f"map:={room}", *options]
        with (
            log.open("w") as file,
            subprocess.Popen(
                launch, env=ros2_variables, stdout=file, stderr=file, start_new_session=True
            ) as stack,
        ):
            try:
                done = subprocess.run(
                    [python, str(HERE / "robot.py"), str(room), json.dumps(request)],
                    env=ros2_variables,
                    capture_output=True,
                    text=True,
                    timeout=240,
                    check=False,
                )
                nodes = psutil.Process(stack.pid).children(recursive=True)
                stack.send_signal(signal.SIGINT)
                stack.wait(60)
            finally:
                if stack.poll() is None:
                    os.killpg(stack.pid, signal.SIGKILL)
        _, alive = psutil.wait_procs(nodes, timeout=60)
        assert not alive
        assert done.returncode == 0, done.stderr + log.read_text("utf-8")
        return json.loads(done.stdout) | {"log": log.read_text("utf-8")}

    return run


def hashes(ros2, action):
    file = ros2.prefix / "share" / "nav2_msgs" / "action" / f"{action}.json"
    entries = json.loads(file.read_text("utf-8"))["type_hashes"]
    return {entry["type_name"].split("/")[-1]: entry["hash_string"] for entry in entries}


@pytest.mark.one_distribution
def test_own_definitions_have_the_hash_of_nav2(ros2_environment):
    assert hashes(ros2_environment, "NavigateToPose")["NavigateToPose_SendGoal"] == SEND_GOAL


def test_interfaces_are_those_of_the_distribution(ros2_environment):
    code = (
        "import tf2_msgs.msg, nav2_msgs.msg as m, nav2_msgs.action as a;"
        "print(hasattr(m, 'WaypointStatus'),"
        " a.NavigateThroughPoses.Goal.get_fields_and_field_types()['poses'])"
    )
    answer = subprocess.run(
        [ros2_environment.python, "-c", code], capture_output=True, text=True, check=True
    )
    assert (
        answer.stdout.split()
        == {
            "jazzy": ["False", "sequence<geometry_msgs/PoseStamped>"],
            "kilted": ["True", "nav_msgs/Goals"],
        }[ros2_environment.distribution]
    )


@pytest.mark.parametrize(
    ("action", "poses"),
    [
        ("navigate_to_pose", [[3.2, -0.5, 0.0]]),
        ("navigate_through_poses", [[0.5, 1.0, 0.0], [3.2, 1.0, 0.0]]),
        ("follow_waypoints", [[0.5, 1.0, 0.0], [0.5, 0.0, 1.5]]),
    ],
)
def test_the_stand_in_comes_up_and_drives(drive, action, poses):
    done = drive("one_process:=true", action=action, poses=poses)
    assert done["status"] == SUCCEEDED, done["log"]
    assert np.hypot(done["pose"][0] - poses[-1][0], done["pose"][1] - poses[-1][1]) < 0.3
    feedback = done["feedback"][0]
    if action == "follow_waypoints":
        assert done["feedback"][-1] == {"current_waypoint": 1}
    else:
        assert feedback["distance_remaining"] > done["feedback"][-1]["distance_remaining"]


@pytest.mark.one_distribution
@pytest.mark.parametrize(
    ("options", "frame", "outcome"),
    [
        (["fault:=goal-rejected"], "map", {"status": "rejected"}),
        ([], "nowhere", {"status": "rejected"}),
        (
            ["fault:=goal-aborted", "error_code:=105", "error_msg:=stuck"],
            "map",
            {"status": ABORTED, "error_code": 105, "error_msg": "stuck"},
        ),
    ],
)
def test_goals_are_refused_and_given_up(drive, options, frame, outcome):
    done = drive("one_process:=true", *options, frame=frame, poses=[[3.2, -0.5, 0.0]])
    assert {name: done[name] for name in outcome} == outcome


@pytest.mark.one_distribution
def test_a_crash_is_told_and_the_launcher_goes_on(drive):
    done = drive("fault:=crash", "after:=20", limit=120, patience=0.2, poses=[[3.2, -0.5, 0.0]])
    assert done["status"] == "unfinished"
    assert "process has died" in done["log"]
    assert "exit code 3" in done["log"]
    assert "user interrupted" in done["log"]


@pytest.mark.one_distribution
def test_bring_up_fails_when_the_clock_begins_late(drive):
    done = drive("one_process:=true", "fault:=clock-start", first_clock=150.0, start_up=10.0)
    assert done["status"] == "never ready"
    assert "bring-up is aborted" in done["log"]


def test_an_unknown_distribution_is_refused():
    with pytest.raises(environment.EnvironmentBuildError, match="not one of jazzy, kilted"):
        environment.make_environment("boxturtle")


def test_missing_tools_are_named(monkeypatch, tmp_path):
    monkeypatch.setenv("SCENARIO_ROS2_ENVIRONMENTS", str(tmp_path))
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(environment.EnvironmentBuildError, match=r"lacks cmake, g\+\+, make"):
        environment.make_environment("kilted")
    assert environment.environment_python("kilted") is None
