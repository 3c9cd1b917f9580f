"""The relay in a genuine ROS 2: lock step, goals, lifecycle, graph, and how it ends."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from daemon.model import ros_messages
from daemon.model.sut import LaserScan
from daemon.stacks.ros2 import relay, sensors
from daemon.stacks.ros2.isolation import lock_domain
from daemon.stacks.ros2.keys import Ros2Frames
from daemon.stacks.ros2.link import (
    COMMAND_KINDS,
    Cycle,
    GoalUpdate,
    LinkLost,
    LinkSetup,
    RelayLink,
    TopicSetup,
    relay_path,
)
from grammars.model.robot import Laser, Mount

STACK = Path(__file__).with_name("small_stack.py")
PERIOD = 50_000_000
DEADLINE = 60.0
STAMPED, UNSTAMPED = COMMAND_KINDS
FLOOD = TopicSetup("/flood", "std_msgs/msg/String")
STATIC = TopicSetup("/tf_static", "tf2_msgs/msg/TFMessage", "latched", 1)
TRANSFORMS = TopicSetup("/tf", "tf2_msgs/msg/TFMessage", "reliable", 100)
SCAN = TopicSetup("/scan", "sensor_msgs/msg/LaserScan", "best effort", 5)
HEARD = (
    TopicSetup("/tf", "tf2_msgs/msg/TFMessage", "reliable", 100, "all"),
    TopicSetup("/rosout", "rcl_interfaces/msg/Log", "reliable", 1000, "all"),
    TopicSetup("/words", "std_msgs/msg/String", "latched", 1),
)


def string(text):
    """Return a std_msgs/String."""
    return ros_messages.serialize(
        ros_messages.make("std_msgs/msg/String", data=text), "std_msgs/msg/String"
    )


def transforms(child, time):
    """Return a tf2_msgs/TFMessage with one transform from odom."""
    one = ros_messages.transform(ros_messages.time(time), "odom", child, x=time / 1e9, y=0.0)
    message = ros_messages.make("tf2_msgs/msg/TFMessage", transforms=[one])
    return ros_messages.serialize(message, "tf2_msgs/msg/TFMessage")


LASER = Laser(Mount(0.2), 0.3, -2.0, 2.0, 400, 0.1, 10.0, 20.0, 0.0, 0.0)


def scan(time):
    """Return a sensor_msgs/LaserScan of 400 rays."""
    sweep = LaserScan(time / 1e9, np.full(400, 2.0, np.float32))
    return sensors.scan(sweep, LASER, time, Ros2Frames())


class Bench:
    """A domain of its own, a relay in it, and as many small stacks as a test wants."""

    def __init__(self, python, folder, domain):
        self.python = python
        self.now = 1_000_000_000
        self.children = []
        self._folder = folder
        self._link = RelayLink.listen(folder / "socket", "nonce")
        self.environment = {
            name: value
            for name, value in os.environ.items()
            if name not in ("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "LD_LIBRARY_PATH", "ROS_DISTRO")
        } | {
            "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_LOG_DIR": str(folder),
            "SCENARIO_SOCKET": str(folder / "socket"),
            "SCENARIO_NONCE": "nonce",
        }

    def start(self, program, *words, **variables):
        """Start a program of the ROS 2 that the bench is of."""
        with (self._folder / f"{program.stem}-{len(self.children)}.txt").open("wb") as log:
            child = subprocess.Popen(
                [self.python, program, *words],
                env=self.environment | variables,
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=subprocess.STDOUT,
            )
        self.children.append(child)
        return child

    def stack(self, *words):
        return self.start(STACK, *words)

    def connect(self, **variables):
        """Start a relay; return the link to it."""
        self.start(relay_path(), **variables)
        return self.accept()

    def accept(self):
        """Return the link as soon as a relay has come."""
        assert self._link.accept(DEADLINE), self.logs()
        return self._link

    def listen(self):
        """Let go and listen anew."""
        self._link.close()
        self._link = RelayLink.listen(self._folder / "socket", "nonce")

    def cycle(self, until="nothing", wait=0.02, **more):
        answer = self._link.cycle(Cycle(self.now, until=until, wait=wait, **more))
        self.now += PERIOD
        return answer

    def cycle_until(self, found, **more):
        """Let the clock run until something is found in an answer; return what."""
        end = time.monotonic() + DEADLINE
        while time.monotonic() < end:
            if result := found(self.cycle(**more)):
                return result
        raise AssertionError(self.logs())

    def goal_updates(self, goal, last):
        """Let the clock run until a goal has come to one of these ends; return its updates."""
        updates = []

        def follow(answer):
            updates.extend(one for one in answer.goals if one.goal == goal)
            return bool(updates) and updates[-1].state in last

        self.cycle_until(follow)
        return updates

    def logs(self):
        return "\n".join(
            f"{file.name}:\n{file.read_text('utf-8', 'replace')[-3000:]}"
            for file in sorted(self._folder.glob("*.txt"))
        )

    def close(self):
        self._link.close()
        for child in self.children:
            child.kill()
            child.communicate()


@contextmanager
def make_bench(python):
    # A socket's path is short: pytest's own folders may be too long.
    domain, held = lock_domain(None)
    with tempfile.TemporaryDirectory(prefix="relay-") as folder, held:
        made = Bench(python, Path(folder), domain)
        try:
            yield made
        finally:
            made.close()


@pytest.fixture
def bench(ros2_python):
    with make_bench(ros2_python) as made:
        yield made


def setup(**changes):
    wanted = {
        "publish": (SCAN, TRANSFORMS),
        "subscribe": (),
        "command": "/cmd_vel",
        "action": "/navigate_to_pose",
        "action_kind": "navigate_to_pose",
        "nodes": (),
    }
    return LinkSetup(**{**wanted, **changes})


def drive(bench, kind, cycles):
    """Run a stack in lock step with sensor data; return its commands, one for each cycle."""
    link = bench.connect()
    link.set_up(setup())
    bench.stack("stamped" if kind == STAMPED else "unstamped")
    bench.cycle_until(lambda answer: answer.commands)
    bench.cycle(wait=0.2)
    bench.now = 100 * 1_000_000_000
    commands = []
    for _ in range(cycles):
        messages = (("/tf", transforms("base", bench.now)), ("/scan", scan(bench.now)))
        answer = bench.cycle("command", DEADLINE, messages=messages)
        assert answer.latency is not None
        assert answer.heard
        assert [message.kind for message in answer.messages] == [kind]
        commands.append(answer.messages[0].data)
    return commands


SEND_GOAL = "RIHS01_a4fcb3bee1bf32e21a0e541a943b221aa0826996e2c98f079b47022b256f48b5"


@pytest.mark.one_distribution
def test_definitions_of_the_tests_have_the_hash_of_nav2(ros2_python):
    """Of NavigateToPose_SendGoal in Nav2 of Kilted."""
    file = ros2_python.parents[1] / "share/nav2_msgs/action/NavigateToPose.json"
    entries = json.loads(file.read_text("utf-8"))["type_hashes"]
    hashes = {entry["type_name"]: entry["hash_string"] for entry in entries}
    assert hashes["nav2_msgs/action/NavigateToPose_SendGoal"] == SEND_GOAL


@pytest.mark.short
@pytest.mark.parametrize("kind", COMMAND_KINDS)
def test_each_of_1200_cycles_is_answered_and_again_with_the_same_bytes(bench, kind):
    commands = drive(bench, kind, 1200)
    assert len(set(commands)) == 1200
    if kind == STAMPED:
        stamps = [relay.read_stamp(data) for data in commands]
        assert stamps == [100_000_000_000 + index * PERIOD for index in range(1200)]
    with make_bench(bench.python) as other:
        assert drive(other, kind, 300) == commands[:300]


def test_an_answer_to_an_earlier_cycle_is_none_to_this_one(bench):
    link = bench.connect()
    link.set_up(setup())
    bench.stack("stamped", "stale")
    bench.cycle_until(lambda answer: answer.commands)
    bench.cycle(wait=1.0)
    bench.now = 100 * 1_000_000_000
    for index in range(1, 21):
        time = bench.now
        answer = bench.cycle("command", 0.5 if index % 5 == 0 else DEADLINE)
        if index % 5 == 0:
            # Held back by the stack until the next clock.
            assert (answer.latency, answer.commands, answer.heard) == (None, 0, False)
            continue
        assert answer.latency is not None
        assert answer.commands >= (2 if index % 5 == 1 and index > 1 else 1)
        assert relay.read_stamp(answer.messages[-1].data) == time
    # With that much tolerance the command that was held back is an answer.
    for _ in range(4):
        bench.cycle("command", DEADLINE)
    bench.cycle("command", 0.5)
    time = bench.now
    answer = bench.cycle("command", DEADLINE, tolerance=PERIOD)
    assert answer.latency is not None
    assert relay.read_stamp(answer.messages[-1].data) == time - PERIOD


def test_both_kinds_of_command_are_heard_whenever_they_come(bench):
    """Also from a publisher that is not reliable and joins one that is."""
    bench.connect().set_up(setup())

    def heard(kind):
        return lambda answer: [one for one in answer.messages if one.kind == kind]

    first = bench.stack("unstamped")
    bench.cycle_until(heard(UNSTAMPED))
    second = bench.stack("unstamped", "best-effort")
    bench.cycle_until(lambda answer: answer.commands > 1)
    first.kill()
    bench.cycle_until(lambda answer: answer.commands == 1)
    bench.stack("stamped")
    bench.cycle_until(heard(STAMPED))
    second.kill()
    for _ in range(3):
        bench.cycle_until(heard(STAMPED), until="command", wait=DEADLINE)


GOALS = {
    "navigate_to_pose": {"number_of_recoveries": 3},
    "navigate_through_poses": {"number_of_recoveries": 3, "number_of_poses_remaining": 2},
    "follow_waypoints": {"current_waypoint": 1},
}


@pytest.mark.parametrize("action", GOALS)
def test_goals_of_all_kinds_go_out_and_their_ends_come_back(bench, action):
    link = bench.connect()
    link.set_up(setup(action=f"/{action}", action_kind=action))
    bench.stack("actions")
    bench.cycle_until(lambda answer: answer.server)
    missed = (1, 3) if action == "follow_waypoints" else ()

    def send(goal, x):
        poses = ((x, 1.0, 0.0), (x, 2.0, 0.5))[1 if action == "navigate_to_pose" else 0 :]
        link.send_goal(goal, poses, "map", 3_500_000_000)

    send(1, 1.0)
    updates = bench.goal_updates(1, {"succeeded"})
    accepted, succeeded = [one for one in updates if one.state != "feedback"]
    assert accepted == GoalUpdate(1, "accepted")
    assert (succeeded.error_code, succeeded.error_text) == (0, "")
    # Where a result lists the states of its poses, all of these were reached.
    assert succeeded.missed_waypoints == missed
    send(2, 60.0)
    aborted = bench.goal_updates(2, {"aborted"})[-1]
    assert (aborted.error_code, aborted.error_text) == (104, "beyond the map")
    send(3, 200.0)
    assert bench.goal_updates(3, {"rejected"}) == [GoalUpdate(3, "rejected")]
    send(4, -1.0)
    accepted, feedback = bench.goal_updates(4, {"feedback"})
    assert accepted == GoalUpdate(4, "accepted")
    assert feedback == GoalUpdate(4, "feedback", **GOALS[action])
    send(5, 1.0)
    # Nothing is owed any more when a goal ends: the wait does, long before its time.
    answer = bench.cycle("command", 250.0)
    assert (answer.goals[-1].goal, answer.goals[-1].state) == (5, "succeeded")
    assert answer.latency is None


def test_a_goal_that_nobody_answers_is_said_to_be_unanswered(bench):
    link = bench.connect()
    link.set_up(setup())
    stack = bench.stack("actions")
    bench.cycle_until(lambda answer: answer.server)
    stack.send_signal(signal.SIGSTOP)
    link.send_goal(1, ((-1.0, 0.0, 0.0),), "map", 0)
    assert bench.goal_updates(1, {"unanswered"}) == [GoalUpdate(1, "unanswered")]
    stack.send_signal(signal.SIGCONT)
    # That it is accepted after all is not told any more.
    link.send_goal(2, ((-1.0, 0.0, 0.0),), "map", 0)
    updates = []
    bench.cycle_until(lambda answer: updates.extend(answer.goals) or len(updates) > 1)
    assert [(one.goal, one.state) for one in updates] == [(2, "accepted"), (2, "feedback")]


def test_lifecycle_parameters_and_graph(bench):
    link = bench.connect()
    subscribe = (*HEARD, TopicSetup("/scan", "sensor_msgs/msg/LaserScan"))
    link.set_up(setup(subscribe=subscribe, nodes=("/navigator", "/nobody")))
    ready = link.readiness()
    assert ready.nodes == {"/navigator": "", "/nobody": ""}
    assert not ready.server
    assert ready.listeners == {"/scan": 0, "/tf": 0}
    graph = link.graph()
    assert (graph.endpoints, graph.nodes, graph.services) == ((), (), ())

    bench.stack("actions", "words", "stamped")
    bench.cycle_until(lambda _: link.readiness().nodes["/navigator"] == "active")
    bench.cycle_until(lambda _: link.readiness().server)
    assert link.readiness().nodes["/nobody"] == ""

    assert link.parameters("/navigator", ("max_speed", "plugin", "stateful", "none")) == {
        "max_speed": 0.5,
        "plugin": "a",
        "stateful": True,
    }
    assert link.parameters("/nobody", ("max_speed",)) == {}

    bench.cycle_until(lambda answer: answer.commands)
    graph = link.graph()
    assert graph.nodes == ("/controller_stamped", "/navigator", "/talker")
    assert "/navigator/get_state" in graph.services
    assert "/nobody/get_state" not in graph.services
    by_topic = {(one.topic, one.role): one for one in graph.endpoints}
    command = by_topic["/cmd_vel", "publisher"]
    assert (command.kind, command.node) == (STAMPED, "/controller_stamped")
    assert (command.reliable, command.transient_local) == (True, False)
    assert by_topic["/words", "publisher"].transient_local
    assert ("/scan", "publisher") not in by_topic
    assert {one.node for one in graph.endpoints} == set(graph.nodes)


def test_a_node_that_is_no_longer_active_is_told(bench):
    link = bench.connect()
    link.set_up(setup(nodes=("/navigator", "/nobody")))
    stack = bench.stack("actions")
    bench.cycle_until(lambda _: link.readiness().nodes["/navigator"] == "active")
    assert bench.cycle().inactive == {}
    link.send_goal(1, ((60.0, 0.0, 0.0),), "map", 0)
    assert bench.cycle_until(lambda answer: answer.inactive) == {"/navigator": "inactive"}
    link.send_goal(2, ((60.0, 0.0, 0.0),), "map", 0)
    bench.cycle_until(lambda answer: not answer.inactive)
    stack.send_signal(signal.SIGSTOP)
    assert bench.cycle_until(lambda answer: answer.inactive) == {"/navigator": "not answering"}
    stack.send_signal(signal.SIGCONT)
    bench.cycle_until(lambda answer: not answer.inactive)
    stack.send_signal(signal.SIGINT)
    bench.cycle_until(lambda answer: answer.inactive == {"/navigator": ""})


def test_latched_topics_reach_late_listeners_and_floods_are_bounded(bench):
    link = bench.connect()
    link.set_up(setup(publish=(STATIC, TRANSFORMS, FLOOD), subscribe=HEARD))
    bench.cycle(messages=(("/tf_static", transforms("laser", 0)),))
    bench.stack("words")
    assert bench.cycle_until(word) == "laser"
    bench.cycle_until(lambda _: link.readiness().listeners["/flood"])
    messages = (("/tf", transforms("base", bench.now)), ("/flood", string("line")))
    answers = [bench.cycle(wait=1.0, messages=messages)]
    while answers[-1].heard or "done" not in [word(one) for one in answers]:
        answers.append(bench.cycle(wait=0.5))
    lines = [sum(one.topic == "/rosout" for one in answer.messages) for answer in answers]
    assert 0 < max(lines) <= 200
    assert sum(lines) <= 500
    assert max(lines) < 200 or any("/rosout" in answer.dropped for answer in answers)
    # What the relay itself publishes on a topic that it listens to does not come back; what comes
    # is best effort, and would not be given to a reliable subscription.
    assert [one.topic for answer in answers for one in answer.messages].count("/tf") == 1


def word(answer):
    """Return what the stack has said on /words."""
    said = [one for one in answer.messages if one.topic == "/words"]
    return ros_messages.deserialize(said[-1].data, said[-1].kind).data if said else ""


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"publish": (TopicSetup("/a", "nonsense_msgs/msg/Text"),)},
         "has no package nonsense_msgs: install it, or name the setup file"),
        ({"publish": (TopicSetup("/a", "std_msgs/msg/Nonsense"),)},
         "package std_msgs has no msg Nonsense"),
        ({"publish": (TopicSetup("/a b", "std_msgs/msg/String"),)}, "rclpy: Invalid"),
    ],
)  # fmt: skip
def test_what_cannot_be_made_is_said_in_a_sentence(bench, change, text):
    link = bench.connect()
    with pytest.raises(LinkLost, match=text):
        link.set_up(setup(**change))


def test_a_relay_ends_with_the_connection_and_with_its_starter(bench):
    bench.connect().close()
    assert bench.children[0].wait(DEADLINE) == 0
    bench.listen()
    link = bench.connect()
    link.set_up(setup())
    bench.children[1].stdin.close()
    assert bench.children[1].wait(DEADLINE) == 0


def test_a_relay_whose_parent_is_killed_ends(bench):
    """Also where its stdin says nothing."""
    program = (
        "import subprocess\n"
        f"child = subprocess.Popen([{str(bench.python)!r}, {str(relay_path())!r}],"
        " stdin=subprocess.DEVNULL)\n"
        "child.wait()\n"
    )
    with subprocess.Popen([sys.executable, "-c", program], env=bench.environment) as parent:
        bench.accept().set_up(setup())
        parent.kill()
        with pytest.raises(LinkLost, match="gone"):
            bench.cycle_until(lambda _: None)
