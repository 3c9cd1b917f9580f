"""Our end of the relay against a pretended one: requests, answers, and how the link is lost."""

import contextlib
import os
import socket
import stat
import struct
import threading
from dataclasses import asdict
from multiprocessing.connection import Client

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
    RelayLink,
    StackIdentity,
    TopicSetup,
)

NONCE = "8f14e45f"
HELLO = {"version": 2, "nonce": NONCE, "distribution": "jazzy", "rmw": "rmw_fastrtps_cpp"}
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
QUIET = {"latency": None, "commands": 0, "heard": False, "server": True, "messages": []}
QUIET |= {"goals": [], "dropped": [], "inactive": {}}


def frame(head, blob=b""):
    """Return a whole frame as it is on the wire."""
    data = relay.encode_frame(head, blob)
    return struct.pack("!i", len(data)) + data


class PretendedRelay:
    """Says hello and gives the answers it was told to, one for each request; None: hang up.

    An answer is a head with its blob, or the bytes of a frame.
    """

    def __init__(self, address, answers, *, hang_up=False):
        self._hang_up = hang_up
        self.requests = []
        self._address = address
        self._answers = answers
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def join(self):
        self._thread.join(60)
        assert not self._thread.is_alive()

    def _run(self):
        with Client(self._address) as connection, contextlib.suppress(OSError, EOFError):
            connection.send_bytes(relay.encode_frame(HELLO))
            self._converse(connection)

    def _converse(self, connection):
        while True:
            self.requests.append(relay.decode_frame(connection.recv_bytes()))
            answer = self._answers.pop(0) if self._answers else None
            if answer is None:
                return
            if isinstance(answer, tuple):
                answer = frame({"answer": answer[0]}, answer[1])
            os.write(connection.fileno(), answer)
            if self._hang_up and not self._answers:
                return


@pytest.fixture
def connect(tmp_path):
    """Connect to a pretended relay that gives these answers after that to the set-up."""
    made = []

    def connect(*answers):
        link = RelayLink.listen(tmp_path / f"socket-{len(made)}", NONCE)
        peer = PretendedRelay(link.address, [({}, b""), *answers])
        made.append((link, peer))
        assert link.accept(60)
        link.set_up(SETUP)
        return link, peer

    yield connect
    for link, peer in made:
        link.close()
        peer.join()


def test_nobody_there_is_no_error(tmp_path):
    link = RelayLink.listen(tmp_path / "socket", NONCE)
    assert not link.accept(0.01)
    assert stat.S_IMODE(os.stat(link.address).st_mode) == 0o600  # noqa: PTH116
    with pytest.raises(LinkLost, match="has not connected yet"):
        _ = link.identity
    link.close()
    link.close()
    assert not (tmp_path / "socket").exists()


def test_tcp_is_an_address_as_well():
    link = RelayLink.listen("tcp://127.0.0.1:0", NONCE)
    host, port = link.address.removeprefix("tcp://").split(":")
    with socket.create_connection((host, int(port))) as peer:
        peer.sendall(frame(HELLO))
        assert link.accept(60)
    link.close()


def test_a_path_that_cannot_be_listened_at_is_named(tmp_path):
    with pytest.raises(LinkLost, match=r"cannot listen for the relay at .*nowhere"):
        RelayLink.listen(tmp_path / "nowhere" / "socket", NONCE)
    with pytest.raises(LinkLost, match="cannot listen for the relay"):
        RelayLink.listen("tcp://127.0.0.1:port", NONCE)


@pytest.mark.parametrize(
    ("hello", "text"),
    [
        (b"", "has ended before its first message"),
        (frame(HELLO)[:-3], "other than the relay of this version connected .*end of file"),
        (b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n", "other than the relay of this version"),
        # As the relay of another version begins.
        (struct.pack("<II", 150, 0) + b'{"version":1}', "other than the relay of this version"),
        (frame([1, 2]), "other than the relay of this version"),
        (struct.pack("!i", 100_000) + b"[" * 100_000, "other than the relay of this version"),
        (frame(HELLO | {"nonce": "other"}), "does not belong to this run"),
        (frame(HELLO | {"version": 3}), "has version 3 of its protocol, not version 2"),
        (frame(HELLO | {"problem": "no package nav2_msgs"}), "^no package nav2_msgs$"),
    ],
)
def test_what_is_no_relay_of_ours_is_not_spoken_to(tmp_path, hello, text):
    """It begins with these bytes and then closes."""
    link = RelayLink.listen(tmp_path / "socket", NONCE)
    with socket.socket(socket.AF_UNIX) as peer:
        peer.connect(link.address)
        peer.sendall(hello)
        peer.shutdown(socket.SHUT_WR)
        with pytest.raises(LinkLost, match=text):
            link.accept(60)
    link.close()


def test_a_set_up_says_everything_that_is_made(connect):
    link, peer = connect()
    assert link.identity == StackIdentity("jazzy", "rmw_fastrtps_cpp")
    assert link.accept(0)
    head, blob = peer.requests[0]
    assert blob == b""
    assert head["action_kind"] == "nav2_msgs/action/NavigateToPose"
    assert [tuple(topic.values()) for topic in head["publish"]] == [
        ("/scan", "sensor_msgs/msg/LaserScan", "best effort", 5, "last")
    ]


def test_a_cycle_carries_messages_both_ways(connect):
    tf, command = ("/tf", "tf2_msgs/msg/TFMessage"), ("/cmd_vel", "geometry_msgs/msg/Twist")
    update = {"error_code": 101, "error_text": "no way", "missed_waypoints": [1, 2]}
    ended = {"goal": 4, "state": "aborted", **update, "number_of_recoveries": 2}
    reply = QUIET | {"latency": 0.002, "commands": 3, "heard": True, "dropped": ["/tf"]}
    reply |= {"messages": [[*tf, 6], [*command, 5]], "inactive": {"/amcl": "inactive"}}
    reply |= {"goals": [{"goal": 4, "state": "accepted"}, ended]}
    link, peer = connect(({}, b""), (reply, b"abcdefghijk"))
    link.send_goal(4, ((1.0, 2.0, 0.5),), "map", 1_000_000_000)
    answer = link.cycle(Cycle(50_000_000, (("/scan", b"0123456789"),), "command", 1.5, 10))
    assert peer.requests[1][0]["poses"] == [[1.0, 2.0, 0.5]]
    head, blob = peer.requests[2]
    assert blob == b"0123456789"
    assert (head["do"], head["time"], head["messages"]) == ("cycle", 50_000_000, [["/scan", 10]])
    assert (head["until"], head["wait"], head["tolerance"]) == ("command", 1.5, 10)
    assert answer.messages == (
        ReceivedMessage(*tf, b"abcdef"), ReceivedMessage(*command, b"ghijk"),
    )  # fmt: skip
    assert (answer.latency, answer.commands, answer.heard) == (0.002, 3, True)
    assert answer.goals[1] == GoalUpdate(
        4, "aborted", 101, "no way", number_of_recoveries=2, missed_waypoints=(1, 2)
    )
    assert (answer.dropped, answer.inactive) == (("/tf",), {"/amcl": "inactive"})


MANY = {"messages": [["/plan", "nav_msgs/msg/Path", 9]]}
FEW = {"messages": [["/plan", "nav_msgs/msg/Path"]]}


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        ((QUIET | MANY, b"1234"), "cannot be understood: .*4 bytes of messages"),
        ((QUIET | FEW, b""), "cannot be understood: .*not enough values to unpack"),
        ((QUIET, b"1234"), "cannot be understood: .*4 bytes of messages in place of 0"),
        ((QUIET | {"messages": 3}, b""), "cannot be understood: .*TypeError"),
        ((QUIET | {"goals": [{"goal": 9, "state": "lost"}]}, b""), "understood: .*goals.0.state"),
        ((QUIET | {"commands": "many"}, b""), "cannot be understood: .*commands"),
        ((QUIET | {"latency": "soon"}, b""), "cannot be understood: .*latency"),
        (None, "the relay is gone: it has ended"),
        (struct.pack("!i", 2**30), "the relay is gone"),
        (frame({}), "cannot be understood: KeyError"),
        (frame({"answer": []}), "cannot be understood: TypeError"),
        (frame([1]), "not a JSON object"),
        (frame({"refused": "the stack's ROS 2 has no package nav2_msgs"}), "no package nav2_msgs"),
    ],
)
def test_a_relay_that_goes_refuses_or_cannot_be_understood_is_told(connect, answer, text):
    link, _ = connect(answer)
    with pytest.raises(LinkLost, match=text):
        link.cycle(Cycle(0, wait=1000.0))
    with pytest.raises(LinkLost, match="closed|gone"):
        link.cycle(Cycle(0))


@pytest.mark.parametrize(("answer", "wait"), [(b"", 0), (frame({"answer": {}})[:-3], 1000)])
def test_a_relay_that_hangs_is_told(connect, monkeypatch, answer, wait):
    """Also in the middle of its answer, for whose beginning the link waits."""
    monkeypatch.setattr("daemon.stacks.ros2.link._SILENCE", 0.001)
    link, _ = connect(answer)
    with pytest.raises(LinkLost, match=rf"did not answer within {wait} s: it hangs"):
        link.cycle(Cycle(0, wait=wait))


def test_a_wait_ends_when_the_stack_has_died(connect):
    link, _ = connect(b"")
    link.is_interrupted = lambda: True
    with pytest.raises(LinkLost, match="the stack has died"):
        link.cycle(Cycle(0, wait=1000.0))


def test_readiness_graph_and_parameters_are_read(connect):
    ready = {"nodes": {"/amcl": "active"}, "server": True, "listeners": {"/scan": 2}}
    listener = GraphEndpoint(
        "/scan", "sensor_msgs/msg/LaserScan", "/amcl", "subscription", False, False
    )
    graph = {"endpoints": [asdict(listener)], "nodes": ["/amcl"], "services": ["/amcl/get_state"]}
    link, _ = connect((ready, b""), (graph, b""), ({"max": 0.5, "on": True}, b""))
    assert link.readiness().nodes == {"/amcl": "active"}
    assert link.graph().endpoints == (listener,)
    assert link.parameters("/amcl", ("max", "on")) == {"max": 0.5, "on": True}


NAMES = st.sampled_from(["", "heard", "messages", "goals", "ä\0\n", "\u2028𝄞"])
HEADS = st.dictionaries(
    NAMES,
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False)
        | NAMES,
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(NAMES, inner, max_size=3),
        max_leaves=8,
    ),
    max_size=5,
)  # fmt: skip


@given(head=HEADS, blob=st.binary(max_size=64))
def test_frames_are_what_they_were(head, blob):
    assert relay.decode_frame(relay.encode_frame(head, blob)) == (head, blob)


@given(data=st.binary(min_size=1, max_size=300), value=HEADS)
def test_garbage_as_an_answer_is_a_lost_link(data, value, tmp_path_factory):
    for answer in (data, frame({"answer": value}, data), frame({"answer": QUIET | value}, data)):
        link = RelayLink.listen(tmp_path_factory.mktemp("link") / "socket", NONCE)
        peer = PretendedRelay(link.address, [({}, b""), answer], hang_up=True)
        assert link.accept(60)
        link.set_up(SETUP)
        with pytest.raises(LinkLost):
            # Whatever an answer leaves unread is the beginning of the next one.
            list(map(link.cycle, (Cycle(0), Cycle(0))))
        peer.join()
