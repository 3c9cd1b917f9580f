"""What a ROS 2 stack hears of a live world and what it may do, over a pretended link."""

import itertools
import math
import queue
import threading

import pytest

from daemon.live.ros_bridge import RosBridge
from daemon.live.simulation import LiveSimulation
from daemon.model import ros_messages as ros
from daemon.stacks.ros2.link import (
    CycleAnswer,
    Graph,
    LinkLost,
    Readiness,
    ReceivedMessage,
    StackIdentity,
)
from daemon.stacks.ros2.settings import read_settings
from daemon.trace.messages import KINDS
from grammars.model.geometry import Twist2
from tests.batch.live.worlds import DEADLINE, Kept, demo_spec, demo_submission

STAMPED = "geometry_msgs/msg/TwistStamped"


def transform(parent, child, x):
    kind = "tf2_msgs/msg/TFMessage"
    found = ros.transform(ros.time(0), parent, child, x=x, y=0.0)
    return ros.serialize(ros.make(kind, transforms=[found]), kind)


def path(*points):
    kind, head = "nav_msgs/msg/Path", ros.header(ros.time(0), "map")
    poses = [
        ros.make("geometry_msgs/msg/PoseStamped", header=head, pose=ros.pose(x, y, 0.0, 1.0))
        for x, y in points
    ]
    return ros.serialize(ros.make(kind, header=head, poses=poses), kind)


class PretendedStack:
    """A stack that turns on the spot: the side of a link that is elsewhere in truth."""

    identity = StackIdentity("jazzy", "rmw_fastrtps_cpp")

    def __init__(self, *, dies_after=10**9, command=b""):
        self.setups = []
        self.cycles = queue.Queue()
        self.closed = threading.Event()
        self._dies_after, self._count, self._command = dies_after, 0, command

    def accept(self, timeout=0.1):
        return True

    def set_up(self, setup):
        self.setups.append(setup)

    def cycle(self, cycle):
        self._count += 1
        if self._count > self._dies_after:
            raise LinkLost("the relay has gone")
        self.cycles.put(cycle)
        head = ros.header(ros.time(cycle.time), "base_link")
        message = ros.make(STAMPED, header=head, twist=ros.twist(0.0, 0.0, 0.4))
        data = self._command or ros.serialize(message, STAMPED)
        said = (
            ReceivedMessage("/cmd_vel", STAMPED, data),
            ReceivedMessage("/tf", "tf2_msgs/msg/TFMessage", transform("map", "odom", 7.0)),
            ReceivedMessage("/plan", "nav_msgs/msg/Path", path((1.0, 2.0), (3.0, 2.0))),
        )
        return CycleAnswer(None, 1, True, False, said)

    def readiness(self):
        return Readiness({}, False, {})

    def send_goal(self, goal, poses, frame, time):
        raise AssertionError("nobody asked for a goal")

    def graph(self):
        return Graph((), (), ())

    def parameters(self, node, names):
        return {}

    def close(self):
        self.closed.set()

    def heard(self, count):
        return [self.cycles.get(timeout=DEADLINE) for _ in range(count)]


def kept_plan(kept):
    return list(ros.deserialize(kept.of("/plan")[-1][1], KINDS["/plan"]).poses)


@pytest.fixture
def simulation(campaigns):
    return LiveSimulation(*demo_spec(demo_submission(campaigns)), speed=4.0)


def bridged(simulation, *stacks, settings=None):
    waiting = iter(stacks)

    def listen():
        try:
            return next(waiting)
        except StopIteration:
            raise LinkLost("nobody listens any more") from None

    bridge = RosBridge(simulation, listen, settings)
    try:
        with simulation.running():
            yield bridge
        assert bridge.failure is None
    finally:
        bridge.close()


def test_a_stack_hears_a_robot_and_moves_it(simulation):
    stack, kept = PretendedStack(), Kept()
    simulation.add_outlet(kept)
    for bridge in bridged(simulation, stack):
        cycles = stack.heard(60)
        (setup,) = stack.setups
        published = {topic.name: topic for topic in setup.publish}
        assert published["/map"].qos == published["/tf_static"].qos == "latched"
        assert (setup.command, setup.nodes) == ("/cmd_vel", ())
        times = [cycle.time for cycle in cycles]
        assert times == sorted(set(times))
        assert times[0] >= 1_000_000_000
        assert {cycle.until for cycle in cycles} == {"nothing"}
        assert {cycle.wait for cycle in cycles} == {0.0}
        first = [topic for topic, _ in cycles[0].messages]
        assert first[:2] == ["/tf_static", "/map"]
        messages = [(c.time, topic, data) for c in cycles for topic, data in c.messages]
        for now, topic, data in messages:
            message = ros.deserialize(data, published[topic].kind)
            stamped = message.transforms[0] if hasattr(message, "transforms") else message
            stamp = stamped.header.stamp
            assert stamp.sec * 1_000_000_000 + stamp.nanosec <= now
        poses = [now for now, topic, _ in messages if topic == "/initialpose"]
        assert len(poses) == 1, "once, and again only when the stack does not know for seconds"
        order = [topic for _, topic, _ in messages if topic in ("/tf", "/odom")]
        assert order == ["/tf", "/odom"] * (len(order) // 2)
        frames = {
            (t.header.frame_id, t.child_frame_id)
            for _, topic, data in messages
            if topic == "/tf"
            for t in ros.deserialize(data, published[topic].kind).transforms
        }
        assert frames == {("odom", "base_link")}, "map -> odom is for the stack to say"
        assert any(topic == "/scan" for _, topic, _ in messages)
        turned = 0.0
        while turned < 0.1:
            for topic, data in stack.heard(1)[0].messages:
                if topic == "/odom":
                    odometry = ros.deserialize(data, published[topic].kind)
                    turned = abs(odometry.pose.pose.orientation.z)
        assert bridge.connected
        assert bridge.state == "connected jazzy rmw_fastrtps_cpp"
        assert (1.0, 2.0) in [(p.pose.position.x, p.pose.position.y) for p in kept_plan(kept)]
        estimate = ros.deserialize(kept.of("/pose")[-1][1], KINDS["/pose"])
        assert estimate.pose.pose.position.x == pytest.approx(7.0, abs=0.5)
        assert simulation.status.driver == "ROS 2"


def test_names_are_those_of_the_stack(simulation):
    settings = read_settings(
        {
            "launch": "somebody's",
            "namespace": "robot",
            "frames": {"map": "world", "odom": "o", "base": "base", "laser": "lidar"},
            "transforms": "odom",
            "initial-pose": "none",
        }
    )
    stack = PretendedStack()
    for _ in bridged(simulation, stack, settings=settings):
        cycles = stack.heard(30)
        kinds = {topic.name: topic.kind for topic in stack.setups[0].publish}
        scans = [d for c in cycles for topic, d in c.messages if topic == "/robot/scan"]
        assert ros.deserialize(scans[0], kinds["/robot/scan"]).header.frame_id == "lidar"
        # Its map comes from a file, it knows where its laser is, and it finds itself.
        assert {"/map", "/tf_static", "/initialpose"}.isdisjoint(dict(cycles[0].messages))
        assert "/map" not in kinds


def test_ros_time_goes_on_when_the_world_begins_anew(simulation):
    stack = PretendedStack()
    for _ in bridged(simulation, stack):
        times = [cycle.time for cycle in stack.heard(10)]
        simulation.reset()
        while simulation.status.worlds < 2:
            times.append(stack.heard(1)[0].time)
        times += [cycle.time for cycle in stack.heard(20)]
        assert times == sorted(times)
        assert max(b - a for a, b in itertools.pairwise(times)) >= 1_000_000_000


def test_a_stack_that_goes_may_come_again(simulation):
    first, second = PretendedStack(dies_after=5), PretendedStack()
    for bridge in bridged(simulation, first, second):
        assert first.closed.wait(DEADLINE)
        again = second.heard(3)
        assert [topic for topic, _ in again[0].messages][:2] == ["/tf_static", "/map"]
        assert bridge.connected
    assert second.closed.is_set()


def test_commands_that_are_none_are_told(simulation):
    stack = PretendedStack(command=b"\x00\x01\x00\x00nonsense")
    for bridge in bridged(simulation, stack):
        stack.heard(3)
        assert "/cmd_vel: a damaged" in bridge.state


def test_a_stack_that_comes_late_is_told_where_the_robot_is(simulation):
    moved = threading.Event()
    start = simulation.spec.mission.start

    class Driving(Kept):
        def status(self, status):
            simulation.command(Twist2(0.5, 0.0, 0.0), "a test")
            seen = simulation.view
            if seen is not None and math.hypot(seen.pose.x - start.x, seen.pose.y - start.y) > 0.5:
                moved.set()

    class Late(PretendedStack):
        def accept(self, timeout=0.1):
            return moved.wait(timeout)

    simulation.watched = True
    simulation.add_outlet(Driving())
    stack = Late()
    for _ in bridged(simulation, stack):
        told = dict(stack.heard(1)[0].messages)["/initialpose"]
        at = ros.deserialize(told, "geometry_msgs/msg/PoseWithCovarianceStamped").pose.pose.position
        assert math.hypot(at.x - start.x, at.y - start.y) > 0.4


def test_that_nobody_can_listen_is_said_at_once(simulation):
    def listen():
        raise LinkLost("the folder is not there")

    with pytest.raises(LinkLost, match="folder"):
        RosBridge(simulation, listen)
