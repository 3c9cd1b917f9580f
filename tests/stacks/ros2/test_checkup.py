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


def parameters(**nodes):
    """Return what is seen with other parameters of nodes, ``amcl={...}``."""
    changed = {f"/{name}": values for name, values in nodes.items()}
    return replace(SOUND, parameters=PARAMETERS | changed)


def on(distribution, rmw="rmw_fastrtps_cpp", seen=SOUND):
    return replace(seen, identity=StackIdentity(distribution, rmw))


def offering(*services):
    """Return what is seen of a stack without the action, and with these services."""
    readiness = replace(SOUND.readiness, server=False)
    return replace(SOUND, readiness=readiness, graph=replace(SOUND.graph, services=services))


def frequency(value, distribution="jazzy"):
    values = {"use_sim_time": True, "controller_frequency": value}
    return on(distribution, seen=parameters(controller_server=values))


CLOUD, TREE = "sensor_msgs/msg/PointCloud2", "nav2_msgs/msg/BehaviorTreeLog"
GRID, TEXT = "nav_msgs/msg/OccupancyGrid", "std_msgs/msg/String"
COSTMAP = "/local_costmap/costmap"
LATCHED = replace(mouth(COSTMAP, GRID, "/costs"), transient_local=True)
PARTIAL = replace(
    besides(replace(LATCHED, node="/local_costmap/local_costmap")),
    parameters=PARAMETERS | {"/local_costmap/local_costmap": {"always_send_full_costmap": False}},
)
FUSED = replace(SOUND, transforms=frozenset({("map", "odom"), ("odom", "base_link")}))
MAPPER = ear("/scan", SCAN, "/my_mapper", reliable=True)
RECORD = {"record": ["local costmap"]}
UNREADY = replace(
    SOUND,
    readiness=replace(SOUND.readiness, nodes={"/amcl": "inactive", "/controller_server": "active"}),
    graph=replace(SOUND.graph, nodes=(*SOUND.graph.nodes, "/rviz")),
    failure=SutFailure("no answer; the stack was not ready within 60 s", printed=["last line"]),
)
CASES = {
    "nobody listens to scans, or to another topic": (
        besides(ear("/robile/scan_front", SCAN, "/amcl"), seen=without("/scan")), {}),
    "a reliable listener never hears what is published best effort": (besides(MAPPER), {}),
    "it hears what is published reliably": (besides(MAPPER), {"qos": {"scan": "reliable"}}),
    "no other listener": (besides(MAPPER, seen=without("/scan")), {}),
    "a listener that wants what was said before is not served by a stream": (
        besides(ear("/odom", ODOMETRY, "/fusion", transient_local=True), seen=without("/odom")),
        {}),
    "over zenoh every quality of service matches": (
        on("lyrical", "rmw_zenoh_cpp", besides(replace(MAPPER, transient_local=True))), {}),
    "a listener of another type is none": (
        besides(ear("/scan", CLOUD, "/amcl"), seen=without("/scan")), {}),
    "a second clock": (besides(mouth("/clock", "rosgraph_msgs/msg/Clock", "/bridge")), {}),
    "a second scan": (besides(mouth("/scan", SCAN, "/bridge")), {}),
    "a second odometry": (besides(mouth("/odom", ODOMETRY, "/bridge")), {}),
    "nobody hears the clock": (without("/clock"), {}),
    # Not the launcher: it has to do with nothing of the run.
    "a node without simulated time": (parameters(amcl={"use_sim_time": False}), {}),
    "nobody drives the robot": (without("/cmd_vel"), {}),
    "somebody drives it elsewhere": (
        besides(mouth("/cmd_vel_nav", PLAIN, "/controller_server"), seen=without("/cmd_vel")), {}),
    "commands of another type": (
        besides(mouth("/cmd_vel", TEXT, "/talker"), seen=without("/cmd_vel")), {}),
    "commands with and without a stamp": (besides(mouth("/cmd_vel", PLAIN, "/joystick")), {}),
    "commands without a stamp": (
        besides(mouth("/cmd_vel", PLAIN, "/controller_server"), seen=without("/cmd_vel")), {}),
    "an action by another name": (
        offering("/navigate_to_pose/_action/send_goal"), {"action": "navigate_to_poze"}),
    "an action in a namespace": (offering("/robot1/navigate_to_pose/_action/send_goal"), {}),
    "no action": (offering(), {}),
    "nodes that are not active, not there and no lifecycle nodes": (
        UNREADY, {"ready": ["amcl", "controler_server", "controller_server", "rviz"]}),
    "a node that is not active, and whose services are not seen": (
        replace(
            SOUND,
            readiness=replace(SOUND.readiness, nodes=dict.fromkeys(READY, "inactive")),
            graph=replace(SOUND.graph, services=("/navigate_to_pose/_action/send_goal",))),
        {"ready": ["amcl"]}),
    "nodes that could be waited for": (SOUND, {"ready": []}),
    "nodes that could be waited for, in a namespace": (
        replace(SOUND, graph=replace(
            SOUND.graph, services=("/r1/amcl/get_state", "/other/node/get_state"))),
        {"ready": [], "namespace": "r1"}),
    "nobody knows where the robot is": (replace(SOUND, located=False), {}),
    "two odometries": (FUSED, {}),
    "two odometries, of which ours is off": (FUSED, {"transforms": "none"}),
    "no odometry": (SOUND, {"transforms": "none"}),
    "nobody hears the published map": (SOUND, {"map": "published"}),
    "somebody hears the published map": (
        besides(ear("/map", GRID, "/amcl", reliable=True, transient_local=True)),
        {"map": "published"}),
    "nobody takes the start": (without("/initialpose"), {}),
    "nobody need take the start": (without("/initialpose"), {"initial-pose": "none"}),
    "a short time-out of the navigator": (
        parameters(bt_navigator={"default_server_timeout": 20, "use_sim_time": True}), {}),
    "a bond": (parameters(lifecycle_manager={"bond_timeout": 4.0}), {}),
    "no bond": (parameters(lifecycle_manager={"bond_timeout": 0.0}), {}),
    "a slow controller": (frequency(10.0), {}),
    "a controller a little slow": (frequency(15.0), {}),
    "a fast controller on the wall clock": (frequency(40.0), {}),
    "a fast controller": (frequency(40.0, "lyrical"), {}),
    **{f"speed on {name!r}": (on(name), {})
       for name in ("humble", "jazzy", "kilted", "rolling", "", "marmalade")},
    "nobody publishes what is recorded": (SOUND, RECORD),
    "what is recorded is published elsewhere": (
        besides(mouth("/costs", GRID, "/costs"), mouth("/map", GRID, "/map_server")), RECORD),
    "what is recorded is not latched": (besides(mouth(COSTMAP, GRID, "/costs")), RECORD),
    "what is recorded has another type": (besides(mouth(COSTMAP, TREE, "/costs")), RECORD),
    "what is recorded": (besides(LATCHED), RECORD),
    "a recorded costmap that is not sent whole": (PARTIAL, RECORD),
    "a costmap that is not sent whole, nor recorded": (PARTIAL, {}),
}  # fmt: skip


def shown(line):
    ends = "" if line.publishers is None else f"{line.publishers} to {line.listeners}"
    kind = " ".join(filter(None, (line.kind, line.qos, ends))) or "-"
    hint = f"\n    {line.hint}" if line.hint else ""
    return f"{line.state} {line.subject} ({kind}): {line.text}{hint}"


def test_a_laser_nobody_hears_is_a_warning_and_none_a_defect():
    lasers = tuple(replace(LASERS[0], name=name) for name in ("front", "rear"))
    for topics, states in (
        (("/scan_front", "/scan_rear"), ["ok", "ok"]),
        (("/scan_front", "/back"), ["ok", "warning"]),
        ((), ["missing", "missing"]),
    ):
        ears = (ear(topic, SCAN, "/amcl") for topic in topics)
        lines = examine(settings(), besides(*ears, seen=without("/scan")), lasers)
        scans = [line for line in lines if line.kind == SCAN]
        assert [line.state for line in scans] == states
        if "/back" in topics:
            assert scans[1].text == "nobody listens: the stack does not see what this laser sees"
            assert scans[1].hint == "write topics: {scan: {rear: /back}}"


def test_each_flaw_is_told_and_nothing_else(golden):
    """``checkup.txt``: the lines about a sound stack, then those that differ, and those gone."""
    sound = [shown(line) for line in examine(settings(), SOUND, LASERS)]
    told = ["--- a sound stack", *sound]
    for name, (seen, keys) in CASES.items():
        lines = [shown(line) for line in examine(settings(**keys), seen, LASERS)]
        gone = [line.partition(":")[0] for line in sound if line not in lines]
        told += [f"--- {name}", *(line for line in lines if line not in sound)]
        changed = {line.split(" ")[1] for line in lines}
        told += [f"no more {line}" for line in gone if line.split(" ")[1] not in changed]
    golden("checkup.txt", "\n".join(told) + "\n")


@pytest.mark.parametrize("value", [True, "fast", float("nan"), None, [20.0], -1.0, 0.0])
def test_parameters_that_make_no_sense_are_left_alone(value):
    values = {"controller_frequency": value, "bond_timeout": value, "use_sim_time": True}
    seen = replace(SOUND, parameters={"/controller_server": values})
    assert {line.state for line in examine(settings(), seen, LASERS)} <= {"ok", "note"}
