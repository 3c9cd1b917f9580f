import shlex

import pytest

from daemon.model.attachments import SutMissing
from daemon.model.execution import decide_on_commands
from daemon.stacks.registry import make_sut
from daemon.stacks.ros2.placeholders import (
    PlaceholderError,
    fill,
    placeholders_in,
    run_values,
)
from daemon.stacks.ros2.settings import (
    fill_settings,
    placeholder_names,
    read_settings,
    warnings_about,
)
from grammars.model.geometry import Pose2
from grammars.model.robot import Laser, Mount

LASER = Laser(Mount(0.0), 0.3, -1.0, 1.0, 3, 0.05, 5.0, 10.0, 0.01, 0.0)
LAUNCH = "ros2 launch my_robot nav.launch.py map:={map} params_file:={params}"
STACK = {
    "launch": LAUNCH,
    "files": {"params": "nav2.yaml"},
    "ready": ["amcl", "bt_navigator"],
    "repeatable": False,
}


def warnings(**changed):
    return [str(problem) for problem in warnings_about(read_settings(STACK | changed))]


def test_what_is_left_out_is_as_documented():
    found = read_settings(STACK)
    assert (found.scan_topic(LASER), found.topics.tf_static) == ("/scan", "/tf_static")
    assert (found.action, found.action_kind) == ("/navigate_to_pose", "navigate_to_pose")
    assert (found.start_up, found.patience, found.late) == (60.0, 1.0, 0.05)
    assert (found.tolerance, found.idle, found.period) == (0.0, 0.02, 0.05)
    assert found.environment.domain == "own"
    assert found.ready == ("/amcl", "/bt_navigator")
    assert warnings() == []


def test_names_are_resolved_in_the_namespace():
    found = read_settings(
        STACK
        | {
            "namespace": "robot1",
            "topics": {"scan": "/front/scan", "initial-pose": "pose_guess"},
            "mission": "follow",
            "ready": ["amcl", "/map_server"],
        }
    )
    assert found.namespace == "/robot1"
    assert (found.scan_topic(LASER), found.topics.odom) == ("/front/scan", "/robot1/odom")
    assert found.topics.initial_pose == "/robot1/pose_guess"
    assert found.topics.tf == "/tf"
    assert (found.action, found.action_kind) == ("/robot1/follow_waypoints", "follow_waypoints")
    assert found.ready == ("/robot1/amcl", "/map_server")


def test_values_come_with_units_and_in_words():
    found = read_settings(
        STACK
        | {
            "start-up": "2 min",
            "patience": "500 ms",
            "late": "1 %",
            "environment": {
                "setup": ["/opt/ros/jazzy/setup.bash", "~/ws/install/setup.bash"],
                "ROS_DOMAIN_ID": 7,
                "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
            },
            "qos": {"scan": "reliable"},
            "container": {"image": "my/nav2:1.4", "options": ["--gpus", "all"]},
        }
    )
    assert (found.start_up, found.patience, found.late) == (120.0, 0.5, 0.01)
    assert found.environment.setup == ("/opt/ros/jazzy/setup.bash", "~/ws/install/setup.bash")
    assert (found.environment.domain, found.environment.variables) == (
        7,
        {"RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"},
    )
    assert (found.qos.scan, found.qos.odom) == ("reliable", "best effort")
    assert (found.container.engine, found.container.network) == ("podman", "none")
    assert found.container.options == ("--gpus", "all")


def test_an_image_needs_no_command():
    found = read_settings({"container": {"image": "my/nav2"}, "files": {}})
    assert found.launch == ""


def test_values_are_one_word_to_the_shell():
    awkward = "a b'; rm -rf $HOME #"
    filled = fill("run {params} {{x}} ${{HOME}}", {"params": awkward})
    assert filled == f"run {shlex.quote(awkward)} {{x}} ${{HOME}}"
    assert shlex.split("run " + fill("{params}", {"params": awkward})) == ["run", awkward]
    assert fill("{params}", {"params": awkward}, quoted=False) == awkward
    assert shlex.split(fill("a:={namespace} b", {"namespace": ""})) == ["a:=", "b"]


@pytest.mark.parametrize("text", ["{", "}", "{}", "{ map }", "{{map}", "{map}}"])
def test_lone_braces_are_refused(text):
    with pytest.raises(PlaceholderError, match="begins or ends no placeholder"):
        fill(text, {"map": "m"})


def test_a_run_has_every_placeholder_that_is_offered():
    settings = read_settings(STACK | {"namespace": "/robot1"})
    values = run_values(
        start=Pose2(1.0, -0.25, 1e-17),
        robot="robile",
        namespace=settings.namespace,
        seed=7,
        files=settings.files,
    )
    # These two come with the folder and the domain of a process.
    assert {*values, "map", "domain"} == set(placeholder_names(settings))
    assert (values["start.y"], values["namespace"]) == ("-0.25", "robot1")
    assert placeholders_in(LAUNCH) == ("map", "params")


def test_only_the_command_is_quoted():
    settings = read_settings(
        STACK
        | {
            "environment": {"PARAMS": "{params}"},
            "container": {"image": "nav2:{robot.name}", "options": ["-v", "{params}:/p"]},
        }
    )
    values = {"params": "a b", "map": "/m", "robot.name": "r"}
    filled = fill_settings(settings, values)
    assert filled.launch.endswith("map:=/m params_file:='a b'")
    assert filled.environment.variables == {"PARAMS": "a b"}
    assert filled.container.image == "nav2:r"
    assert filled.container.options == ("-v", "a b:/p")


def test_commands_from_elsewhere_are_refused_unless_the_worker_takes_them(monkeypatch):
    monkeypatch.setenv("SCENARIO_COMMANDS", "")
    parameters = {"launch": "true", "repeatable": False}
    decide_on_commands(None, elsewhere=True)
    with pytest.raises(SutMissing, match="--commands"):
        make_sut("ros2", parameters)
    # What the daemon decided holds for its own workers, to whom it is local.
    decide_on_commands(None, elsewhere=False)
    with pytest.raises(SutMissing):
        make_sut("ros2", parameters)
    decide_on_commands(True, elsewhere=True)
    assert make_sut("ros2", parameters).period == 0.05
