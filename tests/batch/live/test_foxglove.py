"""What a Foxglove client hears and may do, by a WebSocket client that is nobody's SDK."""

import math
from contextlib import contextmanager

import pytest

pytest.importorskip("foxglove")
pytest.importorskip("websockets")

from daemon.live.foxglove_server import FoxgloveServer, OutletError, read_twist
from daemon.live.simulation import LiveSimulation
from daemon.model import ros_messages as ros
from daemon.trace import TOPICS
from grammars.model.geometry import Twist2
from tests.batch.live.foxglove_client import foxglove_client
from tests.batch.live.worlds import demo_spec, demo_submission

TWIST, STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"


@pytest.fixture
def simulation(campaigns):
    return LiveSimulation(*demo_spec(demo_submission(campaigns)), speed=2.0)


@contextmanager
def served(simulation):
    server = FoxgloveServer(simulation, port=0)
    try:
        with simulation.running():
            yield server
    finally:
        server.close()


@pytest.fixture
def server(simulation):
    with served(simulation) as server:
        yield server


@pytest.fixture
def client(server):
    with foxglove_client(server.port) as client:
        yield client


def test_the_topics_of_a_trace_are_there(client):
    assert set(client.channels) == {topic.name for topic in TOPICS if not topic.external}
    for topic in TOPICS:
        if not topic.external:
            channel = client.channels[topic.name]
            assert channel["schemaName"] == topic.kind
            assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
            assert channel["schema"] == ros.schema(topic.kind)
    assert set(client.info["capabilities"]) >= {"clientPublish", "time", "services"}
    assert "busy-house" in client.info["name"]


def test_what_is_heard_is_the_world(server, client):
    client.subscribe("/scan", "/odom", "/tf", "/clock", "/ground_truth")
    client.until(lambda: len(client.heard("/scan")) > 3 and len(client.heard("/clock")) > 3)
    scans = [(now, scan) for topic, now, scan in client.messages if topic == "/scan"]
    for now, scan in scans:
        stamp = scan.header.stamp
        assert stamp.sec * 1_000_000_000 + stamp.nanosec == now
        assert scan.header.frame_id == "laser"
        assert len(scan.ranges) > 100
    assert [now for now, _ in scans] == sorted(now for now, _ in scans)
    frames = {t.child_frame_id for message in client.heard("/tf") for t in message.transforms}
    assert "base_link" in frames
    client.until(lambda: client.time >= scans[-1][0])
    assert server.clients == 1


def test_who_comes_late_gets_what_is_latched(server):
    latched = [topic.name for topic in TOPICS if topic.latched]
    with foxglove_client(server.port) as early:
        early.subscribe("/clock")
        early.until(lambda: len(early.heard("/clock")) > 3)
        with foxglove_client(server.port) as late:
            late.subscribe(*latched)
            late.until(lambda: all(late.heard(topic) for topic in latched))
            assert late.heard("/map")[0].info.width > 10
            assert late.heard("/scene")[0].markers


def test_a_command_of_a_client_moves_the_robot(client):
    data = ros.serialize(ros.twist(0.0, 0.0, 0.6), TWIST)
    client.subscribe("/ground_truth", "/cmd_vel")
    first = client.until(lambda: client.heard("/ground_truth"))[0]
    client.advertise(5, "/cmd_vel", "cdr", "geometry_msgs/Twist")

    def turned():
        # As a teleoperation panel does it: the same command again and again.
        client.publish(5, data)
        orientation = client.heard("/ground_truth")[-1].pose.pose.orientation
        return abs(orientation.z - first.pose.pose.orientation.z) > 0.05

    client.until(turned)
    assert client.until(lambda: client.heard("/cmd_vel"))[0].twist.angular.z == 0.6


def test_what_is_not_taken_is_said(client):
    pose = "geometry_msgs/PoseWithCovarianceStamped"
    for number, topic, encoding, kind, said in (
        (1, "/initialpose", "json", pose, "is ignored"),
        (2, "/cmd_vel", "ros1", TWIST, "must be"),
        (3, "/cmd_vel", "json", "std_msgs/String", "must be"),
    ):
        client.said.clear()
        client.advertise(number, topic, encoding, kind)
        client.publish(number, b"{}")
        (status,) = client.until(lambda: client.of("status"))
        assert said in status["message"]
    client.said.clear()
    client.advertise(4, "/cmd_vel", "json", TWIST)
    client.publish(4, b"no json")
    assert "no JSON" in client.until(lambda: client.of("status"))[0]["message"]


def test_parameters_and_the_service_steer_the_world(client, simulation):
    client.subscribe("/clock", "/map")
    client.until(lambda: client.heard("/clock"))
    ((service,),) = (
        one["services"] for one in client.until(lambda: client.of("advertiseServices"))
    )
    assert service["name"] == "/reset_world"
    client.send(op="subscribeParameterUpdates", parameterNames=["speed", "paused"])
    client.send(op="getParameters", parameterNames=[], id="all")
    values = client.until(lambda: client.of("parameterValues"))[0]["parameters"]
    assert {one["name"]: one["value"] for one in values} == {"paused": False, "speed": 2.0}
    client.said.clear()
    client.send(op="setParameters", parameters=[{"name": "speed", "value": 5}], id="faster")
    client.until(lambda: simulation.status.speed == 5.0 or client.of("none"))
    client.send(op="setParameters", parameters=[{"name": "speed", "value": -1}], id="worse")
    assert "speed" in client.until(lambda: client.of("status"))[0]["message"]
    answer = client.until(lambda: [one for one in client.said if one.get("id") == "worse"])
    assert [one["value"] for one in answer[0]["parameters"]] == [5.0]
    client.messages.clear()
    client.said.clear()
    client.call(service["id"], 77, b"{}")
    # A new session: clients forget, time begins anew, what is latched comes again.
    client.until(lambda: client.of("serverInfo"))
    client.until(lambda: client.heard("/map"))
    client.until(lambda: simulation.status.worlds == 2)


def test_a_port_that_is_taken_is_said(server, simulation):
    with pytest.raises(OutletError, match=f"{server.port}: .*in use"):
        FoxgloveServer(simulation, port=server.port)


@pytest.mark.parametrize(
    "data",
    [b"", b"[]", b"{}", b'{"linear": 1}', b'{"linear": {"x": "1"}, "angular": {}}',
     b'{"linear": {"x": true}, "angular": {}}', b"\xff\xff", b'{"twist": {}}'],
)  # fmt: skip
def test_commands_that_are_none(data):
    with pytest.raises(ValueError, match="JSON|no linear"):
        read_twist(data, "json", TWIST)
    with pytest.raises(ValueError, match="damaged"):
        read_twist(data, "cdr", TWIST)


def test_commands_that_are_read():
    twist, head = ros.twist(1.0, 0.0, 0.6), ros.header(ros.time(0), "base_link")
    stamped = ros.make(STAMPED, header=head, twist=twist)
    plain = b'{"linear": {"x": 1}, "angular": {"z": 0.6}}'
    for data, encoding, kind in (
        (plain, "json", TWIST),
        (b'{"twist": %s}' % plain, "json", STAMPED),
        (ros.serialize(twist, TWIST), "cdr", TWIST),
        (ros.serialize(stamped, STAMPED), "cdr", STAMPED),
    ):
        assert read_twist(data, encoding, kind) == Twist2(1.0, 0.0, 0.6)
    assert read_twist(b'{"linear": {"x": 1}, "angular": {}}', "json", TWIST) == Twist2(1.0)
    assert math.isinf(read_twist(b'{"linear": {"x": 1e999}, "angular": {}}', "json", TWIST).vx)
