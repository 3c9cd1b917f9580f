"""What a stack is said to lack, by what is seen of it: a sound one, and one with each flaw."""

from dataclasses import replace

import pytest

from daemon.model.sut import SutFailure
from daemon.stacks.ros2.checkup import examine
from daemon.stacks.ros2.inspection import Inspection
from daemon.stacks.ros2.link import Graph, GraphEndpoint, Readiness, StackIdentity
from daemon.stacks.ros2.settings import read_settings
from grammars.model.robot import Laser, Mount

SCAN, ODOMETRY = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
STAMPED, PLAIN = "geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Twist"
POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
LASERS = (Laser(Mount(0.0), 0.3, -1.0, 1.0, 3, 0.05, 5.0, 10.0, 0.01, 0.0),)
READY = ("/amcl", "/controller_server", "/bt_navigator")


def settings(**keys):
    given = {"launch": "ros2 launch nav nav.launch.py map:={map}", "ready": list(READY)}
    if keys.get("map") == "published":
        given["launch"] = "ros2 launch nav nav.launch.py"
    return read_settings({**given, **keys, "repeatable": False})


def ear(topic, kind, node, **qos):
    flags = {"reliable": False, "transient_local": False, **qos}
    return GraphEndpoint(topic, kind, node, "subscription", **flags)


def mouth(topic, kind, node):
    return GraphEndpoint(topic, kind, node, "publisher", reliable=True, transient_local=False)


ENDPOINTS = (
    *(ear("/clock", "rosgraph_msgs/msg/Clock", node) for node in READY),
    ear("/scan", SCAN, "/amcl"),
    ear("/scan", SCAN, "/local_costmap/local_costmap"),
    ear("/odom", ODOMETRY, "/bt_navigator"),
    ear("/tf", TRANSFORMS, "/amcl", reliable=True),
    ear("/tf_static", TRANSFORMS, "/amcl", reliable=True, transient_local=True),
    ear("/initialpose", POSE, "/amcl", reliable=True),
    mouth("/tf", TRANSFORMS, "/amcl"),
    mouth("/cmd_vel", STAMPED, "/controller_server"),
)
PARAMETERS = {
    "/amcl": {"use_sim_time": True},
    "/controller_server": {"use_sim_time": True, "controller_frequency": 20.0},
    "/bt_navigator": {"use_sim_time": True, "default_server_timeout": 1000},
    "/launch_ros_17": {"use_sim_time": False},
}
SOUND = Inspection(
    StackIdentity("lyrical", "rmw_fastrtps_cpp"),
    Graph(
        ENDPOINTS,
        (*READY, "/launch_ros_17"),
        (*(f"{node}/get_state" for node in READY), "/navigate_to_pose/_action/send_goal"),
    ),
    Readiness(dict.fromkeys(READY, "active"), True, {"/scan": 2}),
    PARAMETERS,
    frozenset({("map", "odom")}),
    seconds=12.25,
)


def without(*topics):
    kept = tuple(end for end in ENDPOINTS if end.topic not in topics)
    return replace(SOUND, graph=replace(SOUND.graph, endpoints=kept))


def besides(*more, seen=SOUND):
    return replace(seen, graph=replace(seen.graph, endpoints=(*seen.graph.endpoints, *more)))


def wrong(seen, **keys):
    return [
        line for line in examine(settings(**keys), seen, LASERS) if line.state not in ("ok", "note")
    ]


def only(seen, **keys):
    (line,) = wrong(seen, **keys)
    return line


def line_of(subject, seen, **keys):
    (line,) = (line for line in examine(settings(**keys), seen, LASERS) if line.subject == subject)
    return line


def test_a_sound_stack_has_a_line_for_everything_and_nothing_against_it():
    lines = examine(settings(), SOUND, LASERS)
    assert {line.state for line in lines} == {"ok"}
    assert [line.subject for line in lines] == [
        "start-up", *READY, "/clock", "/scan", "/tf", "/odom", "/tf_static", "/initialpose",
        "/cmd_vel", "/navigate_to_pose", "map -> base_link", "use_sim_time",
        "/controller_server controller_frequency", "speed",
    ]  # fmt: skip
    assert lines[0].text == "ROS 2 Lyrical, rmw_fastrtps_cpp, ready after 12.2 s of wall clock"
    scan = line_of("/scan", SOUND)
    assert (scan.kind, scan.qos, scan.publishers, scan.listeners) == (SCAN, "best effort", 0, 2)
    assert scan.text == "heard by /amcl, /local_costmap/local_costmap"


TREE, GRID = "nav2_msgs/msg/BehaviorTreeLog", "nav_msgs/msg/OccupancyGrid"


@pytest.mark.parametrize(
    ("ends", "state", "text", "hint"),
    [
        ([], "warning", "nobody publishes it: there is nothing to record", ""),
        ([mouth("/costs", GRID, "/costs"), mouth("/map", GRID, "/map_server")], "warning",
         "nobody publishes it: there is nothing to record",
         "write topics: {local-costmap: /costs}"),
        ([mouth("/local_costmap/costmap", GRID, "/costs")], "warning",
         "not recorded from /costs: its publisher is not transient local", ""),
        ([mouth("/local_costmap/costmap", TREE, "/costs")], "warning",
         f"not recorded from /costs: it publishes {TREE}", ""),
        ([replace(mouth("/local_costmap/costmap", GRID, "/costs"), transient_local=True)], "ok",
         "published by /costs; it is recorded", ""),
    ],
)  # fmt: skip
def test_a_report_that_cannot_be_recorded_is_a_warning(ends, state, text, hint):
    line = line_of("/local_costmap/costmap", besides(*ends), record=["local costmap"])
    assert (line.state, line.text, line.hint, line.qos) == (state, text, hint, "")


def test_a_stack_that_hears_no_scan_is_told_where_it_listens_instead():
    seen = besides(ear("/robile/scan_front", SCAN, "/amcl"), seen=without("/scan"))
    line = only(seen)
    assert (line.subject, line.state, line.listeners) == ("/scan", "missing", 0)
    assert line.text == "nobody listens: the stack is blind"
    assert line.hint == "write topics: {scan: /robile/scan_front}"


def test_a_reliable_listener_never_hears_what_is_published_best_effort():
    seen = besides(ear("/scan", SCAN, "/my_mapper", reliable=True))
    line = only(seen)
    assert line.state == "warning"  # others hear it
    assert line.text == "/my_mapper does not hear it: it wants a reliable publisher"
    assert line.hint == "write qos: {scan: reliable}"
    assert wrong(seen, qos={"scan": "reliable"}) == []
    alone = besides(ear("/scan", SCAN, "/my_mapper", reliable=True), seen=without("/scan"))
    assert only(alone).state == "missing"


def test_a_listener_that_wants_what_was_said_before_is_not_served_by_a_stream():
    seen = besides(ear("/odom", ODOMETRY, "/fusion", transient_local=True), seen=without("/odom"))
    line = only(seen)
    assert (line.subject, line.state) == ("/odom", "warning")
    assert "transient local" in line.text
    assert "volatile" in line.hint


def test_over_zenoh_every_quality_of_service_matches():
    seen = besides(ear("/scan", SCAN, "/my_mapper", reliable=True, transient_local=True))
    zenoh = replace(seen, identity=StackIdentity("lyrical", "rmw_zenoh_cpp"))
    assert wrong(zenoh) == []


def test_a_listener_of_another_type_is_not_taken_for_one():
    cloud = "sensor_msgs/msg/PointCloud2"
    seen = besides(ear("/scan", cloud, "/amcl"), seen=without("/scan"))
    line = only(seen)
    assert line.text == f"/amcl does not hear it: it expects {cloud}"
    assert line.state == "missing"


@pytest.mark.parametrize(
    ("topic", "kind", "state", "words"),
    [
        ("/clock", "rosgraph_msgs/msg/Clock", "missing", "time jumps"),
        ("/scan", SCAN, "warning", "in turns"),
        ("/odom", ODOMETRY, "warning", "in turns"),
    ],
)
def test_somebody_else_who_publishes_what_the_simulation_does_is_named(topic, kind, state, words):
    line = only(besides(mouth(topic, kind, "/gazebo_bridge")))
    assert (line.subject, line.state, line.publishers) == (topic, state, 1)
    assert "/gazebo_bridge too" in line.text
    assert words in line.text


def test_a_stack_without_simulated_time_is_found_by_clock_and_parameters():
    assert "use_sim_time: true" in only(without("/clock")).hint
    off = replace(SOUND, parameters={**PARAMETERS, "/amcl": {"use_sim_time": False}})
    line = only(off)
    # Not the launcher: it has to do with nothing of the run.
    assert line.text.startswith("false in /amcl:")
    assert line.state == "missing"


def test_the_robot_needs_somebody_who_drives_it():
    line = only(without("/cmd_vel"))
    assert (line.subject, line.state) == ("/cmd_vel", "missing")
    assert line.kind == "TwistStamped or Twist"
    elsewhere = besides(
        mouth("/cmd_vel_nav", PLAIN, "/controller_server"), seen=without("/cmd_vel")
    )
    assert only(elsewhere).hint == "write topics: {command: /cmd_vel_nav}"
    other = besides(mouth("/cmd_vel", "std_msgs/msg/String", "/talker"), seen=without("/cmd_vel"))
    assert [line.state for line in wrong(other)] == ["warning", "missing"]
    both = only(besides(mouth("/cmd_vel", PLAIN, "/joystick")))
    assert both.text == f"published as {PLAIN} and {STAMPED}: only one of them is listened to"


def test_commands_with_and_without_a_stamp_are_told_apart():
    assert "by their stamps" in line_of("/cmd_vel", SOUND).text
    plain = besides(mouth("/cmd_vel", PLAIN, "/controller_server"), seen=without("/cmd_vel"))
    assert "no stamp" in line_of("/cmd_vel", plain).text


def test_an_action_by_another_name_is_suggested():
    readiness = replace(SOUND.readiness, server=False)
    seen = replace(SOUND, readiness=readiness)
    line = only(seen, action="navigate_to_poze")
    assert (line.subject, line.kind) == ("/navigate_to_poze", "nav2_msgs/action/NavigateToPose")
    assert line.hint == 'did you mean "action: /navigate_to_pose"?'
    namespaced = replace(
        seen, graph=replace(SOUND.graph, services=("/robot1/navigate_to_pose/_action/send_goal",))
    )
    lines = [one for one in wrong(namespaced) if one.subject == "/navigate_to_pose"]
    assert lines[0].hint == 'did you mean "action: /robot1/navigate_to_pose"?'
    nothing = replace(seen, graph=replace(SOUND.graph, services=()))
    lines = [one for one in wrong(nothing) if one.subject == "/navigate_to_pose"]
    assert lines[0].hint == "none of the kind is there at all"


def test_nodes_that_are_not_active_or_not_there_are_told_apart():
    states = {"/amcl": "inactive", "/controller_server": "active"}
    seen = replace(
        SOUND,
        readiness=replace(SOUND.readiness, nodes=states),
        graph=replace(SOUND.graph, nodes=(*SOUND.graph.nodes, "/rviz")),
        failure=SutFailure("no answer; the stack was not ready within 60 s", printed=["last line"]),
    )
    lines = {
        line.subject: line
        for line in wrong(seen, ready=["amcl", "controler_server", "controller_server", "rviz"])
    }
    assert lines["start-up"].text.endswith(": no answer; the stack was not ready within 60 s")
    assert lines["/amcl"].text == "inactive: it must be active"
    assert lines["/controler_server"].text == "there is no such node"
    assert lines["/controler_server"].hint == 'did you mean "/controller_server"?'
    assert "no lifecycle node" in lines["/rviz"].text
    assert set(lines) == {"start-up", "/amcl", "/controler_server", "/rviz"}


def test_nodes_that_could_be_waited_for_are_named():
    line = line_of("ready", SOUND, ready=[])
    assert line.state == "note"
    assert line.hint == "write ready: [amcl, bt_navigator, controller_server]"
    above = replace(SOUND.graph, services=("/r1/amcl/get_state", "/other/node/get_state"))
    line = line_of("ready", replace(SOUND, graph=above), ready=[], namespace="r1")
    assert line.hint == "write ready: [/other/node, amcl]"


def test_who_knows_where_the_robot_is():
    lost = only(replace(SOUND, located=False))
    assert (lost.subject, lost.state) == ("map -> base_link", "warning")
    fused = frozenset({("map", "odom"), ("odom", "base_link")})
    twice = only(replace(SOUND, transforms=fused))
    assert (twice.subject, twice.state) == ("odom -> base_link", "warning")
    assert "two odometries" in twice.text
    assert wrong(replace(SOUND, transforms=fused), transforms="none") == []
    assert only(SOUND, transforms="none").hint == "write transforms: odom"


def test_a_published_map_must_be_heard_by_somebody():
    assert wrong(SOUND) == []
    line = only(SOUND, map="published")
    assert (line.subject, line.qos, line.state) == ("/map", "latched", "missing")
    grid = "nav_msgs/msg/OccupancyGrid"
    heard = besides(ear("/map", grid, "/amcl", reliable=True, transient_local=True))
    assert wrong(heard, map="published") == []


def test_a_start_nobody_takes_is_a_warning_unless_none_is_told():
    assert only(without("/initialpose")).state == "warning"
    assert wrong(without("/initialpose"), **{"initial-pose": "none"}) == []


def test_a_server_time_out_of_bringup_is_warned_of():
    low = {**PARAMETERS, "/bt_navigator": {"default_server_timeout": 20, "use_sim_time": True}}
    line = only(replace(SOUND, parameters=low))
    assert line.subject == "/bt_navigator default_server_timeout"
    assert line.text.startswith("20 ms of wall clock")
    bond = {**PARAMETERS, "/lifecycle_manager": {"bond_timeout": 4.0}}
    note = line_of("/lifecycle_manager bond_timeout", replace(SOUND, parameters=bond))
    assert (note.state, note.hint) == ("note", "set it to 0.0 where a cycle may take long")
    none = {**PARAMETERS, "/lifecycle_manager": {"bond_timeout": 0.0}}
    lines = examine(settings(), replace(SOUND, parameters=none), LASERS)
    assert all("bond" not in one.subject for one in lines)


@pytest.mark.parametrize(
    ("frequency", "distribution", "state", "words"),
    [
        (20.0, "jazzy", "ok", "as the period of the cycles says"),
        (10.0, "jazzy", "warning", "no answer to most of them"),
        (15.0, "jazzy", "warning", "some have no answer"),
        (40.0, "jazzy", "note", "up to 2 times real time"),
        (40.0, "lyrical", "note", "of several commands the last counts"),
    ],
)
def test_the_pace_of_the_controller_is_held_against_that_of_the_cycles(
    frequency, distribution, state, words
):
    values = {"use_sim_time": True, "controller_frequency": frequency}
    seen = replace(
        SOUND,
        identity=StackIdentity(distribution, "rmw_fastrtps_cpp"),
        parameters={**PARAMETERS, "/controller_server": values},
    )
    line = line_of("/controller_server controller_frequency", seen)
    assert line.state == state
    assert words in line.text
    if state == "warning":
        assert "write period: 0.1 s" in line.hint or "write period: 0.07 s" in line.hint


@pytest.mark.parametrize(
    ("distribution", "words"),
    [
        ("humble", "at most real time: the controller of Nav2 runs on the wall clock in Humble"),
        ("jazzy", "at most real time"),
        ("kilted", "at most real time"),
        ("lyrical", "as fast as the stack answers"),
        ("rolling", "as fast as the stack answers"),
        ("", "its distribution is unknown: whether"),
        ("marmalade", 'the distribution "marmalade" is not known here'),
    ],
)
def test_it_is_said_whether_runs_can_be_faster_than_real_time(distribution, words):
    identity = StackIdentity(distribution, "rmw_fastrtps_cpp")
    line = line_of("speed", replace(SOUND, identity=identity))
    assert words in line.text
    assert (line.state == "ok") == (distribution in ("lyrical", "rolling"))


@pytest.mark.parametrize("value", [True, "fast", float("nan"), None, [20.0], -1.0, 0.0])
def test_parameters_that_make_no_sense_are_left_alone(value):
    values = {"controller_frequency": value, "bond_timeout": value, "use_sim_time": True}
    seen = replace(SOUND, parameters={"/controller_server": values})
    assert wrong(seen) == []


def test_a_recorded_costmap_must_be_sent_whole():
    node = "/local_costmap/local_costmap"
    parameters = PARAMETERS | {node: {"always_send_full_costmap": False}}
    costmap = mouth("/local_costmap/costmap", "nav_msgs/msg/OccupancyGrid", node)
    seen = besides(replace(costmap, transient_local=True))
    seen = replace(seen, parameters=parameters)
    line = only(seen, record=["local costmap"])
    assert (line.subject, line.hint) == (f"{node} always_send_full_costmap", "set it to true")
    assert wrong(seen) == []
