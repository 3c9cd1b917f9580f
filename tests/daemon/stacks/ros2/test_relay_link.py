"""Our end of the relay against a pretended one: what it asks, what it believes, how it loses it."""

import json
import os
import socket
import stat
import struct
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.ros2 import relay
from daemon.stacks.ros2.link import (
    Cycle,
    GoalUpdate,
    GraphEndpoint,
    LinkLost,
    LinkSetup,
    ReceivedMessage,
    StackIdentity,
    TopicSetup,
)
from daemon.stacks.ros2.relay_link import RelayLink, relay_path

NONCE = "8f14e45f"
HELLO = {
    "hello": "scenario relay",
    "version": 1,
    "nonce": NONCE,
    "distribution": "jazzy",
    "rmw": "rmw_fastrtps_cpp",
    "python": "3.12.3",
}
SETUP = LinkSetup(
    publish=(TopicSetup("/scan", "sensor_msgs/msg/LaserScan", "best effort", 5),),
    subscribe=(
        TopicSetup("/tf", "tf2_msgs/msg/TFMessage", depth=100, keep="all"),
        TopicSetup("/plan", "nav_msgs/msg/Path"),
    ),
    command="/cmd_vel",
    action="/navigate_to_pose",
    action_kind="navigate_to_pose",
    nodes=("/amcl",),
)
QUIET = {
    "latency": None,
    "commands": 0,
    "heard": False,
    "server": True,
    "messages": [],
    "goals": [],
    "dropped": {},
}
Answer = tuple[Any, bytes] | bytes | None


def frame(head, blob=b""):
    text = json.dumps(head).encode()
    return struct.pack("<II", len(text), len(blob)) + text + blob


class PretendedRelay:
    """Says hello and gives the answers it was told to, one for each request; None: hang up."""

    def __init__(self, address, hello, answers, *, hang_up=False):
        self._hang_up = hang_up
        self.requests = []
        self._address = address
        self._hello = hello
        self._answers = answers
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def join(self):
        self._thread.join(60)
        assert not self._thread.is_alive()

    def _run(self):
        with socket.socket(socket.AF_UNIX) as connected:
            connected.connect(self._address)
            connected.sendall(self._hello)
            with connected.makefile("rb") as stream:
                try:
                    self._converse(connected, stream)
                except ConnectionError:
                    return

    def _converse(self, connected, stream):
        while header := stream.read(8):
            head, blob = struct.unpack("<II", header)
            request = json.loads(stream.read(head)), stream.read(blob)
            if request[0] == {"welcome": "scenario", "version": 1}:
                continue
            self.requests.append(request)
            answer = self._answers.pop(0) if self._answers else None
            if answer is None:
                return
            if isinstance(answer, tuple):
                answer = frame({"answer": answer[0]}, answer[1])
            connected.sendall(answer)
            if self._hang_up and not self._answers:
                return


Connect = Callable[..., tuple[RelayLink, PretendedRelay]]


@pytest.fixture
def connect(tmp_path):
    """Connect to a pretended relay that gives these answers after that to the set-up."""
    made = []

    def connect(*answers, set_up=True):
        link = RelayLink.listen(tmp_path / f"socket-{len(made)}", NONCE)
        first = [({}, b"")] if set_up else []
        peer = PretendedRelay(link.address, frame(HELLO), first + list(answers))
        made.append((link, peer))
        assert link.accept(60)
        if set_up:
            link.set_up(SETUP)
        return link, peer

    yield connect
    for link, peer in made:
        link.close()
        peer.join()


def ask_twice(link):
    """Whatever an answer leaves unread is the beginning of the next one."""
    link.cycle(Cycle(0))
    link.cycle(Cycle(0))


def said_to(tmp_path, hello):
    """What is said about a peer that begins with these bytes and then closes."""
    link = RelayLink.listen(tmp_path / "socket", NONCE)
    with socket.socket(socket.AF_UNIX) as peer:
        peer.connect(link.address)
        peer.sendall(hello)
        peer.shutdown(socket.SHUT_WR)
        with pytest.raises(LinkLost) as lost:
            link.accept(60)
    link.close()
    return str(lost.value)


def test_who_is_there_is_known_after_the_hello(connect):
    link, _ = connect(set_up=False)
    assert link.identity == StackIdentity("jazzy", "rmw_fastrtps_cpp", "3.12.3")
    assert link.accept(0)


def test_nobody_there_is_no_error(tmp_path):
    link = RelayLink.listen(tmp_path / "socket", NONCE)
    assert not link.accept(0.01)
    assert stat.S_IMODE(os.stat(link.address).st_mode) == 0o600  # noqa: PTH116
    with pytest.raises(LinkLost, match="has not connected yet"):
        _ = link.identity
    link.close()
    link.close()
    assert not (tmp_path / "socket").exists()


def test_a_hello_may_come_in_pieces(tmp_path):
    link = RelayLink.listen(tmp_path / "socket", NONCE)
    hello = frame(HELLO)
    with socket.socket(socket.AF_UNIX) as peer:
        peer.connect(link.address)
        for byte in hello[:-1]:
            peer.sendall(bytes([byte]))
            assert not link.accept(0)
        peer.sendall(hello[-1:])
        assert link.accept(60)
    link.close()


def test_tcp_is_an_address_as_well():
    link = RelayLink.listen("tcp://127.0.0.1:0", NONCE)
    host, port = link.address.removeprefix("tcp://").split(":")
    with socket.create_connection((host, int(port))) as peer:
        peer.sendall(frame(HELLO))
        assert link.accept(60)
    link.close()


def test_a_path_that_cannot_be_listened_at_is_named(tmp_path):
    with pytest.raises(LinkLost, match=r"cannot be listened for at .*nowhere"):
        RelayLink.listen(tmp_path / "nowhere" / "socket", NONCE)
    with pytest.raises(LinkLost, match="cannot be listened for"):
        RelayLink.listen("tcp://127.0.0.1:port", NONCE)


@pytest.mark.parametrize(
    ("hello", "text"),
    [
        (b"", "has ended before it said anything"),
        (frame(HELLO)[:-3], "has ended before it said anything"),
        (b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n", "is not the relay connected: a frame with"),
        (struct.pack("<II", 4, 0) + b"[1]!", "whose head is not JSON"),
        (frame([1, 2]), "not a JSON object"),
        (struct.pack("<II", 9, 0) + b'{"a":NaN}', "NaN is not JSON"),
        (struct.pack("<II", 100_000, 0) + b"[" * 100_000, "whose head is not JSON"),
        (frame(HELLO | {"nonce": "other"}), "does not belong to this run"),
        (frame(HELLO | {"version": 2}), "speaks version 2 of its protocol and this is version 1"),
        (frame(HELLO | {"version": "1"}), "hello is not what it must be: version"),
        (frame(HELLO | {"more": 1}), "hello is not what it must be: more"),
        (frame(HELLO | {"problem": "no package nav2_msgs"}), "^no package nav2_msgs$"),
        (frame(HELLO | {"rmw": "x" * 2000}), "hello is not what it must be: rmw"),
    ],
)
def test_what_is_no_relay_of_ours_is_not_spoken_to(tmp_path, hello, text):
    with pytest.raises(AssertionError, match=text):
        raise AssertionError(said_to(tmp_path, hello))


def test_a_set_up_says_everything_that_is_made(connect):
    _, peer = connect()
    head, blob = peer.requests[0]
    assert blob == b""
    assert head["do"] == "set_up"
    assert head["action_kind"] == "nav2_msgs/action/NavigateToPose"
    assert head["publish"] == [
        {
            "name": "/scan",
            "kind": "sensor_msgs/msg/LaserScan",
            "qos": "best effort",
            "depth": 5,
            "keep": "last",
        }
    ]


def test_a_cycle_carries_messages_both_ways(connect):
    reply = QUIET | {
        "latency": 0.002,
        "commands": 3,
        "heard": True,
        "messages": [
            ["/tf", "tf2_msgs/msg/TFMessage", 6],
            ["/cmd_vel", "geometry_msgs/msg/Twist", 5],
        ],
        "goals": [
            {"goal": 4, "state": "accepted"},
            {
                "goal": 4,
                "state": "aborted",
                "error_code": 101,
                "error_text": "no way",
                "content": {"missed_waypoints": [1, 2], "distance_remaining": 2.5},
            },
        ],
        "dropped": {"/tf": 7},
    }
    link, peer = connect(({}, b""), (reply, b"abcdefghijk"), (reply | {"goals": []}, b"x" * 11))
    link.send_goal(4, ((1.0, 2.0, 0.5),), "map", 1_000_000_000)
    cycle = Cycle(50_000_000, (("/scan", b"0123456789"),), "command", 1.5, 10)
    answer = link.cycle(cycle)
    assert peer.requests[1][0]["poses"] == [[1.0, 2.0, 0.5]]
    head, blob = peer.requests[2]
    assert blob == b"0123456789"
    assert head == {
        "do": "cycle",
        "time": 50_000_000,
        "messages": [["/scan", 10]],
        "until": "command",
        "wait": 1.5,
        "tolerance": 10,
    }
    assert answer.messages == (
        ReceivedMessage("/tf", "tf2_msgs/msg/TFMessage", b"abcdef"),
        ReceivedMessage("/cmd_vel", "geometry_msgs/msg/Twist", b"ghijk"),
    )
    assert (answer.latency, answer.commands, answer.heard) == (0.002, 3, True)
    content = {"missed_waypoints": [1, 2], "distance_remaining": 2.5}
    assert answer.goals[1] == GoalUpdate(4, "aborted", 101, "no way", content)
    assert answer.dropped == {"/tf": 7}
    assert link.cycle(cycle).dropped == {"/tf": 7}


@pytest.mark.parametrize(
    ("change", "blob", "text"),
    [
        ({"messages": [["/odom", "nav_msgs/msg/Odometry", 4]]}, b"1234", "not subscribed to"),
        ({"messages": [["/tf", "nav_msgs/msg/Path", 4]]}, b"1234", "not subscribed to"),
        ({"messages": [["/plan", "nav_msgs/msg/Path", 9]]}, b"1234", "cut short"),
        ({"messages": [["/plan", "nav_msgs/msg/Path", 3]]}, b"123", "cut short"),
        ({"messages": [["/plan", "nav_msgs/msg/Path", -4]]}, b"1234", "messages.0.2"),
        ({}, b"1234", "belongs to nothing"),
        ({"goals": [{"goal": 9, "state": "accepted"}]}, b"", "goal 9 that was never sent"),
        ({"goals": [{"goal": 9, "state": "lost"}]}, b"", "goals.0.state"),
        ({"goals": [{"goal": 9, "state": "feedback", "content": {"x": 1}}]}, b"", "content"),
        ({"commands": "3"}, b"", "commands"),
        ({"latency": -1.0}, b"", "latency"),
        ({"heard": 1}, b"", "heard"),
        ({"surprise": 1}, b"", "surprise"),
    ],
)
def test_an_answer_that_was_not_asked_for_ends_the_connection(connect, change, blob, text):
    link, _ = connect((QUIET | change, blob))
    with pytest.raises(LinkLost, match=text):
        link.cycle(Cycle(0))
    with pytest.raises(LinkLost, match="closed"):
        link.cycle(Cycle(0))


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        (None, "the relay is gone"),
        (b"\xff" * 64, "a frame with a head of 4294967295 bytes"),
        (struct.pack("<II", 2, 2**31) + b"{}", "bytes of data"),
        (frame({"answer": {}, "refused": "x"}), "neither an answer nor a refusal"),
        (frame({}), "neither an answer nor a refusal"),
        (frame({"refused": "the stack's ROS 2 has no package nav2_msgs"}), "no package nav2_msgs"),
        (frame({"refused": 3}), "neither an answer nor a refusal"),
    ],
)
def test_a_relay_that_goes_or_refuses_is_told(connect, answer, text):
    link, _ = connect(answer)
    with pytest.raises(LinkLost, match=text):
        link.cycle(Cycle(0, wait=1000.0))


def test_a_silent_relay_is_waited_for_as_long_as_the_cycle_and_no_longer(connect, monkeypatch):
    monkeypatch.setattr("daemon.stacks.ros2.relay_link._SILENCE", 0.05)
    link, _ = connect(b"")
    with pytest.raises(LinkLost, match=r"did not answer within 0 s: it hangs"):
        link.cycle(Cycle(0, wait=0.01))


def test_readiness_and_graph_are_read(connect):
    ready = {
        "nodes": {"/amcl": "active"},
        "server": True,
        "command": "geometry_msgs/msg/Twist",
        "listeners": {"/scan": 2},
    }
    graph = {
        "endpoints": [
            ["/scan", "sensor_msgs/msg/LaserScan", "subscription", "/amcl", False, False, 5]
        ],
        "nodes": ["/amcl"],
        "services": ["/amcl/get_state"],
    }
    link, peer = connect((ready, b""), (graph, b""), ({"max": 0.5, "names": ["a"]}, b""), ({}, b""))
    assert link.readiness().nodes == {"/amcl": "active"}
    seen = link.graph()
    assert seen.endpoints == (
        GraphEndpoint(
            "/scan", "sensor_msgs/msg/LaserScan", "/amcl", "subscription", False, False, 5
        ),
    )
    assert link.parameters("/amcl", ("max", "names")) == {"max": 0.5, "names": ["a"]}
    link.request_state("/amcl", "activate")
    assert peer.requests[-1][0] == {"do": "state", "node": "/amcl", "transition": "activate"}


READY = {"nodes": {"/amcl": ""}, "server": True, "command": "", "listeners": {"/scan": 0}}
EMPTY = {"endpoints": [], "nodes": [], "services": []}


@pytest.mark.parametrize(
    ("call", "answer", "text"),
    [
        ("readiness", READY | {"nodes": {}}, "not asked about"),
        ("readiness", READY | {"listeners": {}}, "not asked about"),
        ("readiness", READY | {"command": "std_msgs/msg/String"}, "not asked about"),
        ("readiness", READY | {"nodes": {"/amcl": 3}}, "nodes./amcl"),
        ("graph", EMPTY | {"endpoints": [["/a", "b", "c", "d", True, True, 1]]}, "endpoints.0.2"),
        ("parameters", {"other": 1}, "not asked for"),
        ("parameters", {"max": {"a": 1}}, "parameters is not what it must be"),
        ("cancel_goals", {"a": 1}, "what has no answer"),
    ],
)
def test_answers_are_about_what_was_asked(connect, call, answer, text):
    link, _ = connect((answer, b""))
    arguments = ("/amcl", ("max",)) if call == "parameters" else ()
    with pytest.raises(LinkLost, match=text):
        getattr(link, call)(*arguments)


HEADS = st.dictionaries(
    st.text(max_size=8),
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False)
        | st.text(max_size=8),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner),
        max_leaves=8,
    ),
    max_size=5,
)  # fmt: skip


@given(head=HEADS, blob=st.binary(max_size=64))
def test_frames_are_what_they_were(head, blob):
    data = relay.encode_frame(head, blob)
    sizes = relay.HEADER.unpack_from(data)
    relay.check_lengths(*sizes)
    assert relay.decode_head(data[8 : 8 + sizes[0]]) == head
    assert data[8 + sizes[0] :] == blob


@given(data=st.binary(max_size=200))
def test_a_head_is_an_object_or_an_error_of_the_protocol(data):
    try:
        assert isinstance(relay.decode_head(data), dict)
    except relay.ProtocolError as error:
        assert str(error).startswith("a frame whose head is not")


@given(data=st.binary(min_size=1, max_size=300), value=HEADS)
def test_garbage_as_an_answer_is_a_lost_link(data, value, tmp_path_factory):
    for answer in (data, frame({"answer": value}, data), frame({"answer": QUIET | value}, data)):
        link = RelayLink.listen(tmp_path_factory.mktemp("link") / "socket", NONCE)
        peer = PretendedRelay(link.address, frame(HELLO), [({}, b""), answer], hang_up=True)
        assert link.accept(60)
        link.set_up(SETUP)
        with pytest.raises(LinkLost):
            ask_twice(link)
        peer.join()


def test_the_relay_is_a_file_that_says_what_it_is():
    assert relay_path().name == "relay.py"
    said = subprocess.run(
        [sys.executable, relay_path(), "--help"], capture_output=True, text=True, check=True
    )
    assert len(said.stdout.splitlines()) == 2
    assert "ROS 2" in said.stdout


def test_the_relay_says_what_it_lacks(tmp_path):
    """Run by a Python without rclpy: the sentence comes over the socket."""
    link = RelayLink.listen(tmp_path / "socket", NONCE)
    environment = {"SCENARIO_SOCKET": link.address, "SCENARIO_NONCE": NONCE}
    child = subprocess.Popen(
        [sys.executable, "-I", relay_path()],
        env=environment,
        stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    with pytest.raises(LinkLost, match=r"cannot import rclpy: .*setup file"):
        link.accept(60)
    _, error = child.communicate(timeout=60)
    assert child.returncode == 1
    assert "cannot import rclpy" in error


def test_a_relay_whose_starter_closes_its_stdin_ends(tmp_path):
    environment = {"SCENARIO_SOCKET": str(tmp_path / "nobody"), "SCENARIO_KEEP": "1"}
    child = subprocess.Popen(
        [sys.executable, "-I", relay_path()],
        env=environment,
        stdin=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    _, error = child.communicate(timeout=60)
    assert child.returncode == 0
    assert "stdin was closed" in error


def test_a_relay_without_an_address_says_so():
    said = subprocess.run(
        [sys.executable, relay_path()], env={}, capture_output=True, text=True, check=False
    )
    assert said.returncode == 2
    assert "SCENARIO_SOCKET is not set" in said.stderr
