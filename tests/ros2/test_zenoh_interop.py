"""The rmw_zenoh link against two implementations of the same wire that are not ours.

Neither is rmw_zenoh_cpp: what both and ours agree on is what is tested. They run in an environment
of their own (`python -m tests.ros2.zenoh_environment`); without it these tests are skipped.
"""

import json
import os
import struct
import subprocess
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from daemon.stacks.ros2.link import Cycle, LinkSetup, TopicSetup
from daemon.stacks.ros2.rmw_zenoh.interfaces import Interfaces
from daemon.stacks.ros2.rmw_zenoh.link import ZenohLink
from daemon.stacks.ros2.rmw_zenoh.router import ZenohRouter
from daemon.stacks.ros2.rmw_zenoh.wire import gid, read_token, token_key, topic_key
from tests.daemon.stacks.ros2.test_zenoh_types import ROSIDL, TO_POSE, WHOLE
from tests.ros2.test_zenoh_link import SCAN, map_message

from .zenoh_environment import environment_python

PATIENCE = 60.0
DOMAIN = 5

DEFINITIONS = {
    "builtin_interfaces/msg/Time": "int32 sec\nuint32 nanosec\n",
    "builtin_interfaces/msg/Duration": "int32 sec\nuint32 nanosec\n",
    "std_msgs/msg/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "std_msgs/msg/UInt32": "uint32 data\n",
    "geometry_msgs/msg/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/msg/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/msg/Quaternion": "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
    "geometry_msgs/msg/Pose": "Point position\nQuaternion orientation\n",
    "geometry_msgs/msg/PoseStamped": "std_msgs/Header header\nPose pose\n",
    "geometry_msgs/msg/Twist": "Vector3 linear\nVector3 angular\n",
    "geometry_msgs/msg/TwistStamped": "std_msgs/Header header\nTwist twist\n",
    "rosgraph_msgs/msg/Clock": "builtin_interfaces/Time clock\n",
    "sensor_msgs/msg/LaserScan": (
        "std_msgs/Header header\nfloat32 angle_min\nfloat32 angle_max\nfloat32 angle_increment\n"
        "float32 time_increment\nfloat32 scan_time\nfloat32 range_min\nfloat32 range_max\n"
        "float32[] ranges\nfloat32[] intensities\n"
    ),
    "nav_msgs/msg/MapMetaData": (
        "builtin_interfaces/Time map_load_time\nfloat32 resolution\nuint32 width\nuint32 height\n"
        "geometry_msgs/Pose origin\n"
    ),
    "nav_msgs/msg/OccupancyGrid": "std_msgs/Header header\nMapMetaData info\nint8[] data\n",
    "rcl_interfaces/msg/ParameterValue": (
        "uint8 type\nbool bool_value\nint64 integer_value\nfloat64 double_value\n"
        "string string_value\nbyte[] byte_array_value\nbool[] bool_array_value\n"
        "int64[] integer_array_value\nfloat64[] double_array_value\nstring[] string_array_value\n"
    ),
    "rcl_interfaces/srv/GetParameters": (
        "string[] names\n---\nrcl_interfaces/ParameterValue[] values\n"
    ),
    "lifecycle_msgs/msg/Transition": "uint8 id\nstring label\n",
    "lifecycle_msgs/srv/ChangeState": "lifecycle_msgs/Transition transition\n---\nbool success\n",
}
"""Published definitions, in the form of files: what zenoh-ros2-sdk would fetch from GitHub."""

ACTION_PIECES = (
    f"{TO_POSE}_SendGoal",
    f"{TO_POSE}_GetResult",
    f"{TO_POSE}_FeedbackMessage",
    "action_msgs/srv/CancelGoal",
)

SETUP = LinkSetup(
    publish=(
        TopicSetup("/scan", "sensor_msgs/msg/LaserScan", "best effort", 5),
        TopicSetup("/map", "nav_msgs/msg/OccupancyGrid", "latched", 1),
    ),
    subscribe=(TopicSetup("/map_seen", "std_msgs/msg/UInt32"),),
    command="/cmd_vel",
    action="/navigate_to_pose",
    action_kind="navigate_to_pose",
    nodes=(),
)


@pytest.fixture
def python():
    """The interpreter that has both."""
    found = environment_python()
    if found is None:
        pytest.skip("no zenoh-ros2-sdk and pyzeros: python -m tests.ros2.zenoh_environment")
    return found


@pytest.fixture
def router():
    return ZenohRouter.open(distribution="jazzy")


@pytest.fixture
def link(router):
    made = ZenohLink(router)
    made.join(DOMAIN)
    try:
        yield made
    finally:
        made.close()


@contextmanager
def running(python, script, asked, folder):
    # zenoh-ros2-sdk would look on GitHub for definitions that it has been given otherwise.
    offline = {"GIT_ALLOW_PROTOCOL": "none", "ZENOH_ROS2_SDK_CACHE": str(folder / "cache")}
    process = subprocess.Popen(
        [python, Path(__file__).parent / script, json.dumps(asked)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, **offline},
    )
    with process:
        try:
            yield process
        finally:
            process.kill()


class Driver:
    """Moves the clock on; keeps updates of goals and what was last heard of each topic."""

    def __init__(self, link):
        self.link = link
        self.time = 1_000_000_000
        self.goals = []
        self.last = {}

    def step(self, until="nothing", wait=0.02):
        answer = self.link.cycle(Cycle(self.time, (("/scan", SCAN),), until, wait))
        self.time += 50_000_000
        self.goals += answer.goals
        self.last |= {one.topic: one.data for one in answer.messages}
        return answer

    def step_until(self, done):
        end = time.monotonic() + PATIENCE
        while not done():
            assert time.monotonic() < end, self.link.graph()
            self.step()

    def cycles(self, count):
        """Step so often in lock step; return the latencies [s]."""
        latencies = []
        for _ in range(count):
            now = self.time
            answer = self.step("command", PATIENCE)
            assert answer.latency is not None
            latencies.append(answer.latency)
            seconds, rest = struct.unpack_from("<iI", self.last["/cmd_vel"], 4)
            assert seconds * 1_000_000_000 + rest == now
        return latencies

    def states(self):
        return [update.state for update in self.goals if update.state != "feedback"]


@pytest.fixture
def sdk(python, router, link, tmp_path):
    """A stack of zenoh-ros2-sdk that came after the map was published."""
    for name, text in DEFINITIONS.items():
        package, room, kind = name.split("/")
        file = tmp_path / package / room / f"{kind}.{room}"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, "utf-8")
    link.set_up(SETUP)
    driver = Driver(link)
    link.cycle(Cycle(driver.time, (("/map", map_message()),)))
    asked = {
        "port": router.port,
        "domain": DOMAIN,
        "definitions": str(tmp_path),
        "hashes": {kind: ROSIDL["jazzy"][kind] for kind in ACTION_PIECES},
    }
    with running(python, "zenoh_sdk_peer.py", asked, tmp_path):
        driver.step_until(lambda: link.readiness().server and link.readiness().command)
        driver.step_until(lambda: link.readiness().listeners["/scan"] and "/cmd_vel" in driver.last)
        yield driver


def test_lock_step_with_the_sdk(sdk):
    latencies = sorted(sdk.cycles(300))
    print(f"latency with zenoh-ros2-sdk: median {latencies[150] * 1e3:.2f} ms, "
          f"least {latencies[0] * 1e3:.2f} ms")  # fmt: skip
    graph = sdk.link.graph()
    assert {"/sdk/get_parameters", "/navigate_to_pose/_action/send_goal"} <= set(graph.services)
    assert sdk.link.problems == ()


def test_the_map_reaches_the_sdk_late(sdk):
    sdk.step_until(lambda: struct.unpack_from("<I", sdk.last["/map_seen"], 4) == (1,))


def test_services_of_the_sdk(sdk):
    answer = sdk.link.parameters("/sdk", ("one", "two"))
    assert answer == {"one": "one of the sdk", "two": "two of the sdk"}
    # Its server checks what is asked for.
    sdk.link.request_state("/sdk", "activate")
    sdk.cycles(3)


def test_an_action_of_the_sdk(sdk):
    sdk.link.send_goal(1, ((1.0, 2.0, 0.5),), "map", sdk.time)
    sdk.step_until(lambda: len(sdk.states()) == 2)
    assert sdk.states() == ["accepted", "succeeded"]
    assert (sdk.goals[-1].error_code, sdk.goals[-1].error_text) == (3, "from the sdk")
    feedback = [update for update in sdk.goals if update.state == "feedback"]
    assert feedback[0].content["number_of_recoveries"] == 2
    assert feedback[-1].content["distance_remaining"] >= 1.0
    sdk.goals.clear()
    sdk.link.send_goal(2, ((5.0, 0.0, 0.0),), "map", sdk.time)
    sdk.step_until(sdk.states)
    assert sdk.states() == ["rejected"]


def test_an_action_of_the_sdk_is_cancelled(sdk):
    sdk.link.send_goal(1, ((1.0, 2.0, 0.5),), "map", sdk.time)
    sdk.link.cancel_goals()
    sdk.step_until(lambda: len(sdk.states()) == 2)
    assert sdk.states() in (["accepted", "canceled"], ["accepted", "succeeded"])


@pytest.fixture
def pyzeros(python, router, link, tmp_path):
    """A stack of pyzeros in the namespace /robot1, and what it says of itself."""
    setup = replace(
        SETUP,
        publish=SETUP.publish[:1],
        subscribe=(TopicSetup("/scan_seen", "sensor_msgs/msg/LaserScan", "best effort"),),
        nodes=("/bt_navigator",),
    )
    link.set_up(setup)
    asked = {"port": router.port, "domain": DOMAIN, "hashes": list(ROSIDL["jazzy"])}
    with running(python, "pyzeros_peer.py", asked, tmp_path) as process:
        assert process.stdout is not None
        driver = Driver(link)
        said = json.loads(process.stdout.readline())
        driver.step_until(lambda: link.readiness().listeners["/scan"])
        driver.step_until(lambda: "/cmd_vel" in driver.last)
        yield driver, said


def test_lock_step_with_pyzeros(pyzeros):
    driver, _ = pyzeros
    latencies = sorted(driver.cycles(300))
    print(f"latency with pyzeros: median {latencies[150] * 1e3:.2f} ms, "
          f"least {latencies[0] * 1e3:.2f} ms")  # fmt: skip
    # What it read and wrote again is what was sent, but for what is between fields.
    driver.step_until(lambda: "/scan_seen" in driver.last)
    interfaces = Interfaces("jazzy")
    kind = "sensor_msgs/msg/LaserScan"
    interfaces.load(kind)
    seen = interfaces.deserialize(driver.last["/scan_seen"], kind)
    sent = interfaces.deserialize(SCAN, kind)
    assert (seen.header, list(seen.ranges)) == (sent.header, list(sent.ranges))


def test_lifecycle_of_pyzeros(pyzeros):
    driver, _ = pyzeros
    node = "/bt_navigator"
    driver.step_until(lambda: driver.link.readiness().nodes == {node: "active"})
    assert driver.link.graph().nodes == (node,)
    assert driver.link.readiness().command == "geometry_msgs/msg/TwistStamped"


def test_keys_tokens_and_gids_are_those_of_pyzeros(pyzeros):
    _, said = pyzeros
    kind = "geometry_msgs/msg/TwistStamped"
    assert said["key"] == topic_key(DOMAIN, "/cmd_vel", kind, ROSIDL["jazzy"][kind])
    token = read_token(said["token"])
    assert token is not None
    assert (token.name, token.node, token.kind) == ("/cmd_vel", "/bt_navigator", kind)
    assert token_key(token) == said["token"]
    assert gid(said["token"]).hex() == said["gid"]
    far = read_token(said["far"])
    assert far is not None
    assert (far.name, far.node) == ("/robot1/scan", "/robot1/amcl")
    assert (far.qos.reliable, far.qos.depth) == (False, 5)
    assert token_key(far) == said["far"]


def test_hashes_are_those_of_pyzeros(pyzeros):
    _, said = pyzeros
    interfaces = Interfaces("jazzy")
    for kind in WHOLE:
        interfaces.load(kind)
    ours = {kind: interfaces.hash(kind) for kind in said["hashes"]}
    assert ours == said["hashes"]
    assert {"lifecycle_msgs/srv/GetState", "nav_msgs/msg/OccupancyGrid"} <= set(ours)
    assert f"{TO_POSE}_SendGoal" not in ours
