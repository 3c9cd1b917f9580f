"""A link over rmw_zenoh against a pretended stack in another process."""

import struct
import time
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from daemon.model import ros_messages
from daemon.stacks.ros2.link import (
    ACTION_KINDS,
    Cycle,
    LinkLost,
    LinkSetup,
    TopicSetup,
)
from daemon.stacks.ros2.rmw_zenoh import action as zenoh_action
from daemon.stacks.ros2.rmw_zenoh.link import ZenohLink
from daemon.stacks.ros2.rmw_zenoh.router import ZenohRouter
from tests.daemon.stacks.ros2.pretended_zenoh_stack import ACTION, LIFECYCLE_NODE, Options, running
from tests.daemon.stacks.ros2.test_zenoh_types import ROSIDL

PERIOD = 50_000_000
PATIENCE = 60.0
"""Seconds: none of what is waited for takes as long as that, on any machine."""

SETUP = LinkSetup(
    publish=(
        TopicSetup("/scan", "sensor_msgs/msg/LaserScan", "best effort", 5),
        TopicSetup("/tf", "tf2_msgs/msg/TFMessage", depth=100),
        TopicSetup("/map", "nav_msgs/msg/OccupancyGrid", "latched", 1),
    ),
    subscribe=(
        TopicSetup("/plan", "nav_msgs/msg/Path"),
        TopicSetup("/rosout", "rcl_interfaces/msg/Log", depth=1000, keep="all"),
        TopicSetup("/tf", "tf2_msgs/msg/TFMessage", depth=100),
    ),
    command="/cmd_vel",
    action=ACTION,
    action_kind="navigate_to_pose",
    nodes=(LIFECYCLE_NODE,),
)


def scan_message():
    kind = "sensor_msgs/msg/LaserScan"
    scan = ros_messages.make(
        kind,
        header=ros_messages.header(ros_messages.time(0), "laser"),
        angle_min=-2.0,
        angle_max=2.0,
        angle_increment=0.01,
        time_increment=0.0,
        scan_time=0.05,
        range_min=0.1,
        range_max=10.0,
        ranges=np.full(400, 3.0, np.float32),
        intensities=np.zeros(0, np.float32),
    )
    return ros_messages.serialize(scan, kind)


def map_message():
    kind = "nav_msgs/msg/OccupancyGrid"
    info = ros_messages.make(
        "nav_msgs/msg/MapMetaData",
        map_load_time=ros_messages.time(0),
        resolution=0.05,
        width=400,
        height=300,
        origin=ros_messages.pose(0.0, 0.0, 0.0, 1.0),
    )
    header = ros_messages.header(ros_messages.time(0), "map")
    grid = ros_messages.make(kind, header=header, info=info, data=np.zeros(120000, np.int8))
    return ros_messages.serialize(grid, kind)


SCAN = scan_message()


class Driver:
    """Moves a link's clock on and keeps what came."""

    def __init__(self, link):
        self.link = link
        self.time = 1_000_000_000
        self.goals = []
        self.answers = []

    def step(self, *, wait=0.02, command=False):
        until = "command" if command else "nothing"
        cycle = Cycle(self.time, (("/scan", SCAN),), until, wait)
        answer = self.link.cycle(cycle)
        self.time += PERIOD
        self.goals += answer.goals
        self.answers.append(answer)
        return answer

    def step_until(self, done):
        end = time.monotonic() + PATIENCE
        while not done():
            assert time.monotonic() < end, self.answers[-1:]
            self.step()

    def bring_up(self):
        found = []

        def ready():
            found.append(self.link.readiness())
            one = found[-1]
            if one.nodes[LIFECYCLE_NODE] == "unconfigured":
                self.link.request_state(LIFECYCLE_NODE, "activate")
            active = one.nodes[LIFECYCLE_NODE] == "active"
            return bool(one.server and active and one.command and one.listeners["/scan"])

        self.step_until(ready)
        return found[-1]

    def states(self):
        return [update.state for update in self.goals if update.state != "feedback"]


@contextmanager
def linked(distribution="jazzy", *, domain=0, definitions=(), port=0):
    router = ZenohRouter.open(port, distribution=distribution, definitions=definitions)
    link = ZenohLink(router)
    link.join(domain)
    try:
        yield link
    finally:
        link.close()


def environment(link, domain=0):
    """What a stack is started with: the domain is given by whoever starts it."""
    return {**link.router.environment, "ROS_DOMAIN_ID": str(domain)}


@pytest.fixture
def link():
    with linked() as made:
        yield made


def test_it_is_a_link(link):
    face = link
    assert face.identity.rmw == "rmw_zenoh_cpp"
    assert face.identity.distribution == "jazzy"


def test_a_stack_comes_up_and_is_seen(link):
    link.set_up(SETUP)
    with running(environment(link)):
        ready = Driver(link).bring_up()
        assert ready.nodes == {LIFECYCLE_NODE: "active"}
        assert ready.command == "geometry_msgs/msg/TwistStamped"
        assert ready.listeners == {"/scan": 1, "/tf": 0, "/map": 1}
        graph = link.graph()
        assert graph.nodes == (LIFECYCLE_NODE,)
        assert f"{ACTION}/_action/send_goal" in graph.services
        scan = next(one for one in graph.endpoints if one.topic == "/scan")
        assert (scan.kind, scan.node, scan.role) == (
            "sensor_msgs/msg/LaserScan",
            LIFECYCLE_NODE,
            "subscription",
        )
        assert (scan.reliable, scan.transient_local, scan.depth) == (False, False, 10)
        mapped = next(one for one in graph.endpoints if one.topic == "/map")
        assert (mapped.reliable, mapped.transient_local, mapped.depth) == (True, True, 1)
        assert link.problems == ()


@pytest.mark.short
def test_every_cycle_is_answered_with_its_stamp(link):
    link.set_up(SETUP)
    with running(environment(link)):
        driver = Driver(link)
        driver.bring_up()
        before = link.parameters(LIFECYCLE_NODE, ("scans",))["scans"]
        driver.step(wait=PATIENCE, command=True)
        for _ in range(300):
            now = driver.time
            answer = driver.step(wait=PATIENCE, command=True)
            assert answer.latency is not None
            assert answer.heard
            assert answer.server
            assert answer.commands == 1
            command = next(one for one in answer.messages if one.topic == "/cmd_vel")
            seconds, rest = struct.unpack_from("<iI", command.data, 4)
            assert seconds * 1_000_000_000 + rest == now
            # What was said before the command is there when the command is.
            topics = [one.topic for one in answer.messages]
            assert topics == ["/rosout", "/plan", "/cmd_vel"]
        # Not one was lost, the first included.
        assert link.parameters(LIFECYCLE_NODE, ("scans",))["scans"] - before == 301


def test_all_of_a_topic_or_the_last(link):
    link.set_up(SETUP)
    with running(environment(link)):
        driver = Driver(link)
        driver.bring_up()
        for _ in range(3):
            driver.step(wait=0.0)
        driver.answers.clear()
        driver.step_until(
            lambda: sum(one.topic == "/rosout" for a in driver.answers for one in a.messages) >= 3
        )
        for answer in driver.answers:
            topics = [one.topic for one in answer.messages]
            assert topics.count("/plan") <= 1
        # What this side publishes itself is nothing the stack has said.
        assert all(one.topic != "/tf" for a in driver.answers for one in a.messages)


def test_a_command_without_stamp_answers_when_it_comes_after_the_clock(link):
    link.set_up(SETUP)
    with running(environment(link), Options(command="geometry_msgs/msg/Twist")):
        driver = Driver(link)
        assert driver.bring_up().command == "geometry_msgs/msg/Twist"
        for _ in range(20):
            answer = driver.step(wait=PATIENCE, command=True)
            assert answer.latency is not None
            kinds = {one.kind for one in answer.messages if one.topic == "/cmd_vel"}
            assert kinds == {"geometry_msgs/msg/Twist"}


def test_a_stack_that_does_not_answer(link):
    link.set_up(SETUP)
    with running(environment(link), Options(answers=False)):
        driver = Driver(link)
        driver.bring_up()
        answer = driver.step(wait=0.05, command=True)
        assert answer.latency is None
        assert answer.commands == 0
        driver.step_until(lambda: driver.answers[-1].heard)


ACTIONS = [
    ("humble", "navigate_to_pose"),
    ("humble", "follow_waypoints"),
    ("jazzy", "navigate_to_pose"),
    ("jazzy", "navigate_through_poses"),
    ("jazzy", "follow_waypoints"),
    ("kilted", "navigate_through_poses"),
    ("kilted", "follow_waypoints"),
    ("lyrical", "navigate_to_pose"),
]


@pytest.mark.short
@pytest.mark.parametrize(("spoken", "action"), ACTIONS)
def test_goals_of_every_distribution(spoken, action):
    with linked(spoken, domain=3) as link:
        link.set_up(replace(SETUP, action_kind=action))
        options = Options(distribution=spoken, action=ACTION_KINDS[action])
        with running(environment(link, 3), options):
            driver = Driver(link)
            driver.bring_up()
            link.send_goal(7, ((1.0, 2.0, 0.5), (3.0, 2.0, 0.0)), "map", driver.time)
            driver.step_until(lambda: len(driver.states()) == 2)
            assert driver.states() == ["accepted", "succeeded"]
            assert {update.goal for update in driver.goals} == {7}
            feedback = [one.content for one in driver.goals if one.state == "feedback"]
            assert feedback
            expected = {
                "navigate_to_pose": "distance_remaining",
                "navigate_through_poses": "number_of_poses_remaining",
                "follow_waypoints": "current_waypoint",
            }[action]
            assert feedback[-1][expected] == 0
            if action == "follow_waypoints":
                assert driver.goals[-1].content["missed_waypoints"] == [1, 3]
            driver.goals.clear()
            link.send_goal(8, ((60.0, 0.0, 0.0),), "map", driver.time)
            driver.step_until(lambda: len(driver.states()) == 2)
            assert driver.states() == ["accepted", "aborted"]
            if spoken != "humble":
                assert driver.goals[-1].error_code == 9001
                assert driver.goals[-1].error_text == "no way"
            driver.goals.clear()
            link.send_goal(9, ((200.0, 0.0, 0.0),), "map", driver.time)
            driver.step_until(driver.states)
            assert driver.states() == ["rejected"]


def test_goals_are_cancelled_also_before_they_are_accepted(link):
    link.set_up(SETUP)
    with running(environment(link), Options(ticks=1_000_000)):
        driver = Driver(link)
        driver.bring_up()
        link.send_goal(1, ((1.0, 0.0, 0.0),), "map", driver.time)
        driver.step_until(driver.states)
        link.send_goal(2, ((1.0, 0.0, 0.0),), "map", driver.time)
        link.cancel_goals()
        driver.step_until(lambda: len(driver.states()) == 4)
        assert sorted(driver.states()) == ["accepted", "accepted", "canceled", "canceled"]


def test_a_goal_waits_for_its_server(link):
    link.set_up(SETUP)
    driver = Driver(link)
    link.send_goal(1, ((1.0, 0.0, 0.0),), "map", driver.time)
    assert driver.step().goals == ()
    with running(environment(link)):
        driver.step_until(driver.states)
        # Ten seconds may be over on a machine that takes as long to start a process.
        assert driver.states()[0] in ("accepted", "unanswered")


def test_a_goal_nobody_answers(link, monkeypatch):
    monkeypatch.setattr(zenoh_action, "ANSWER_TIME", 0.5)
    link.set_up(SETUP)
    driver = Driver(link)
    link.send_goal(1, ((1.0, 0.0, 0.0),), "map", driver.time)
    driver.step_until(driver.states)
    assert driver.states() == ["unanswered"]


def test_a_map_reaches_a_stack_that_comes_later(link):
    link.set_up(SETUP)
    driver = Driver(link)
    link.cycle(Cycle(driver.time, (("/map", map_message()),)))
    with running(environment(link)):
        driver.bring_up()
        driver.step_until(lambda: link.parameters(LIFECYCLE_NODE, ("maps",)).get("maps", 0) == 1)


def test_parameters_that_are_there(link):
    link.set_up(SETUP)
    with running(environment(link)):
        Driver(link).bring_up()
        names = ("controller_frequency", "plugins", "not_there")
        assert link.parameters(LIFECYCLE_NODE, names) == {
            "controller_frequency": 20.0,
            "plugins": ["a", "b"],
        }
        assert link.parameters("/nobody", ("x",)) == {}


def test_a_stack_that_dies_is_not_heard_any_more(link):
    link.set_up(SETUP)
    driver = Driver(link)
    with running(environment(link)) as stack:
        driver.bring_up()
        stack.kill()
        driver.step_until(lambda: not driver.answers[-1].server and not driver.answers[-1].heard)
        ready = link.readiness()
        assert ready.nodes == {LIFECYCLE_NODE: ""}
        assert (ready.server, ready.command, ready.listeners["/scan"]) == (False, "", 0)
        assert link.graph().nodes == ()
    # Another may take its place.
    with running(environment(link)):
        driver.bring_up()
        assert driver.step(wait=PATIENCE, command=True).latency is not None


def expect_problem(link, setup, options):
    """Return all that is wrong with a stack once it is up."""
    link.set_up(setup)
    with running(environment(link), options):
        driver = Driver(link)
        with pytest.raises(LinkLost) as lost:
            driver.step_until(lambda: False)
        assert str(lost.value).splitlines()[0] in link.problems
        with pytest.raises(LinkLost):
            link.readiness()
        # The graph can still be looked at.
        end = time.monotonic() + PATIENCE
        while not any(one.topic == "/clock" for one in link.graph().endpoints):
            assert time.monotonic() < end
            time.sleep(0.01)
        return link.problems


def test_other_definitions_are_said_with_the_remedy(link):
    setup = replace(SETUP, action_kind="navigate_through_poses")
    action = ACTION_KINDS["navigate_through_poses"]
    said = expect_problem(link, setup, Options(distribution="kilted", action=action))
    assert [one.split(":")[0] for one in said] == [
        f"{ACTION}/_action/feedback",
        f"{ACTION}/_action/get_result",
        f"{ACTION}/_action/send_goal",
    ]
    theirs = ROSIDL["kilted"][f"{action}_SendGoal"][:19]
    ours = ROSIDL["jazzy"][f"{action}_SendGoal"][:19]
    assert said[-1] == (
        f"{ACTION}/_action/send_goal: {LIFECYCLE_NODE} has a server of type {action}_SendGoal with "
        f"the type hash {theirs}…, here it is {ours}… (jazzy): the definitions differ, nothing "
        "would arrive. It is that of kilted and lyrical: write distribution: kilted or "
        "distribution: lyrical"
    )


def test_a_stack_without_hashes_is_humble(link):
    said = expect_problem(link, SETUP, Options(distribution="humble"))
    assert all("with the type hash TypeHashNotSupported, here it is RIHS01_" in one for one in said)
    assert all(one.endswith("It is that of humble: write distribution: humble") for one in said)


def test_another_type_is_said(link):
    said = expect_problem(link, SETUP, Options(scan="sensor_msgs/msg/Range"))
    assert said == (
        "/scan: /bt_navigator has a subscription of type sensor_msgs/msg/Range, here it is "
        "sensor_msgs/msg/LaserScan: nothing would arrive. Name another topic in the SUT file, or "
        "make the stack use this type",
    )


def test_another_domain_is_said(link):
    link.set_up(SETUP)
    with running(environment(link, 7)):
        driver = Driver(link)
        with pytest.raises(LinkLost, match="in the domain 7, the run in 0"):
            driver.step_until(lambda: False)


def test_the_next_run_finds_the_stack_of_the_run_before(link):
    link.set_up(SETUP)
    with running(environment(link)):
        Driver(link).bring_up()
        link.close()
        with linked(port=link.router.port) as after:
            after.set_up(SETUP)
            driver = Driver(after)
            # Asked for at once, while it is still looking for its router.
            after.request_state(LIFECYCLE_NODE, "deactivate")
            states = after.readiness
            driver.step_until(lambda: states().nodes[LIFECYCLE_NODE] == "inactive")
            after.request_state(LIFECYCLE_NODE, "activate")
            driver.bring_up()
            for _ in range(20):
                assert driver.step(wait=PATIENCE, command=True).latency is not None


def test_a_port_that_is_taken_is_said(link):
    with pytest.raises(LinkLost, match=f"port {link.router.port} of 127.0.0.1"):
        ZenohRouter.open(link.router.port, distribution="jazzy")


@pytest.mark.short
def test_two_runs_do_not_hear_each_other(link):
    with linked() as other:
        assert other.router.port != link.router.port
        for one in (link, other):
            one.set_up(SETUP)
        driver, quiet = Driver(link), Driver(other)
        with running(environment(link)):
            driver.bring_up()
            for _ in range(20):
                assert driver.step(wait=PATIENCE, command=True).latency is not None
                answer = quiet.step(wait=0.0)
                assert not answer.heard
                assert not answer.server
            assert other.graph().nodes == ()
            with running(environment(other)):
                quiet.bring_up()
                assert len(link.graph().nodes) == len(other.graph().nodes) == 1
                assert quiet.step(wait=PATIENCE, command=True).commands == 1


def test_definitions_that_are_not_there_are_said(link, tmp_path):
    with pytest.raises(LinkLost, match="no distribution"):
        ZenohRouter.open(distribution="foxy")
    with pytest.raises(LinkLost, match="no folder of interface definitions"):
        ZenohRouter.open(distribution="jazzy", definitions=[tmp_path / "nothing"])
    with pytest.raises(LinkLost, match="my_msgs/msg/Own"):
        link.set_up(replace(SETUP, publish=(TopicSetup("/own", "my_msgs/msg/Own"),)))


def test_an_answer_that_cannot_be_read_is_said(tmp_path):
    # Humble has no hashes: other definitions meet, and the bytes tell.
    action = tmp_path / "nav2_msgs" / "action" / "NavigateToPose.action"
    action.parent.mkdir(parents=True)
    text = "geometry_msgs/PoseStamped pose\nstring behavior_tree\n---\nfloat64[9] much\n---\n"
    action.write_text(text, "utf-8")
    with linked("humble", definitions=[tmp_path]) as link:
        link.set_up(SETUP)
        with running(environment(link), Options(distribution="humble")):
            driver = Driver(link)
            driver.bring_up()
            link.send_goal(1, ((1.0, 0.0, 0.0),), "map", driver.time)
            with pytest.raises(LinkLost, match=r"cannot be read.*definitions:"):
                driver.step_until(lambda: False)


def test_a_closed_link_says_so(link):
    link.set_up(SETUP)
    link.close()
    link.close()
    with pytest.raises(LinkLost, match="closed"):
        link.cycle(Cycle(1))
    with pytest.raises(LinkLost, match="closed"):
        link.graph()


def test_a_link_has_to_be_in_a_domain():
    link = ZenohLink(ZenohRouter.open(distribution="jazzy"))
    try:
        with pytest.raises(LinkLost, match="no ROS domain"):
            link.set_up(SETUP)
    finally:
        link.close()


def test_a_link_has_to_be_set_up(link):
    with pytest.raises(LinkLost, match="not set up"):
        link.cycle(Cycle(1))
