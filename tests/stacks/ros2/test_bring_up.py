"""From the command to a stack that is ready: its clock, its pose."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from daemon.campaign import expand, load_campaign
from daemon.model import ros_messages as ros
from daemon.model.sut import Briefing, LaserScan, Observation, Odometry, SutFailure
from daemon.stacks.ros2 import bring_up, sensors
from daemon.stacks.ros2 import stack as ros2_stack
from daemon.stacks.ros2.bring_up import BringUp
from daemon.stacks.ros2.link import (
    CycleAnswer,
    GoalUpdate,
    Graph,
    GraphEndpoint,
    LinkLost,
    LinkRefused,
    Readiness,
    ReceivedMessage,
)
from daemon.stacks.ros2.settings import read_settings
from daemon.stacks.ros2.stack import Ros2Stack
from daemon.stacks.ros2.telemetry import LOG
from grammars.model.geometry import Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from tests.stacks.ros2.pretended_link import PretendedLink, PretendedProcess

NODES = ("/amcl", "/bt_navigator")
SECOND = 1_000_000_000
START = Pose2()
SETTINGS = {
    "launch": "true",
    "ready": [node.strip("/") for node in NODES],
    "start-up": "60 s",
}


class Stack(PretendedLink):
    """A stack as its link shows it: ready at once, unless told otherwise.

    ``believes``: where it says to be once it was told its pose, with ``once`` only in the answer
    to that.
    """

    def __init__(self, believes=START, *, once=False):
        super().__init__()
        self.once = once
        self.states = dict.fromkeys(NODES, "active")
        self.believes = believes
        self.told = []
        self.endpoints = ()
        self.closed = False

    def accept(self, timeout=0.1):
        return True

    def cycle(self, cycle):
        super().cycle(cycle)
        told = [data for topic, data in cycle.messages if topic == "/initialpose"]
        self.told += told
        if not self.told or self.believes is None or (self.once and not told):
            return self.answer
        pose = self.believes
        qz, qw = ros.yaw_quaternion(pose.yaw)
        correction = ros.transform(ros.time(0), "map", "odom", x=pose.x, y=pose.y, qz=qz, qw=qw)
        message = ros.make(sensors.TRANSFORMS, transforms=[correction])
        data = ros.serialize(message, sensors.TRANSFORMS)
        heard = (ReceivedMessage("/tf", sensors.TRANSFORMS, data),)
        return CycleAnswer(None, 0, heard=True, server=True, messages=heard)

    def readiness(self):
        return Readiness(dict(self.states), True, {"/initialpose": 1, "/scan": 1})

    def graph(self):
        return Graph(self.endpoints, (), ())

    def close(self):
        self.closed = True


class Machine:
    """What is found, or started, when a run asks for its stack: one after the other."""

    def __init__(self, folder):
        self._folder = folder
        self.stacks = []
        self._next = 0

    def will_have(self, stack):
        place = self._folder / str(len(self.stacks))
        place.mkdir()
        self.stacks.append((stack, PretendedProcess(place)))
        return self.stacks[-1]

    def process(self, *_, **__):
        return self.stacks[self._next][1]

    def listen(self, *_):
        self._next += 1
        return self.stacks[self._next - 1][0]


@pytest.fixture
def machine(tmp_path, monkeypatch):
    machine = Machine(tmp_path)
    monkeypatch.setattr(bring_up, "StackProcess", machine.process)
    monkeypatch.setattr(bring_up.RelayLink, "listen", machine.listen)
    return machine


@pytest.fixture
def briefing(campaigns):
    spec = expand(load_campaign(campaigns / "demo" / "campaign.yaml")).specs[0]
    grid = OccupancyGrid(0.05, 0.0, 0.0, np.zeros((4, 4), np.int8))
    seed = np.random.SeedSequence(1)
    return Briefing(spec.robot, grid, spec.mission, spec.mission.start, seed)


def coming_up(briefing, **keys):
    attempt = BringUp(read_settings(SETTINGS | keys), briefing, first_of(briefing))
    return attempt, attempt.run()


def first_of(briefing):
    scan = LaserScan(0.0, np.ones(briefing.robot.laser.rays, np.float32))
    return Observation(0.0, (Odometry(0.0, Pose2(), Twist2()),), (scan,))


def test_the_clock_begins_at_a_second_never_goes_back_and_the_run_at_a_round_time(
    machine, briefing
):
    stack, _ = machine.will_have(Stack())
    attempt, waiting = coming_up(briefing)
    assert list(waiting)
    times = [cycle.time for cycle in stack.cycles]
    assert times[0] == SECOND
    assert times == sorted(set(times))
    zero = attempt.ready_session().zero
    assert zero == 5 * SECOND
    assert times[-1] < zero
    # What is published once comes with the first clock, measurements with every one.
    topics = [topic for topic, _ in stack.cycles[0].messages]
    assert topics == ["/tf_static", "/tf", "/odom", "/scan"]
    assert "ready after" in attempt.events[-1].text


def test_the_start_is_told_to_who_listens(machine, briefing):
    stack, _ = machine.will_have(Stack())
    list(coming_up(briefing)[1])
    assert len(stack.told) == 1
    told = sensors.read_message(stack.told[0], sensors.INITIAL_POSE)
    assert (told.pose.pose.position.x, told.header.frame_id) == (briefing.start.x, "map")


def test_an_answer_that_comes_with_the_initial_pose_is_heard(machine, briefing):
    machine.will_have(Stack(once=True))
    attempt, waiting = coming_up(briefing)
    list(waiting)
    assert attempt.ready_session().telemetry.pose() == START
    assert not any("no transform" in event.text for event in attempt.events)


def log_line(text):
    message = ros.make(
        LOG, stamp=ros.time(0), level=40, name="planner", msg=text, file="", function="", line=0
    )
    return ReceivedMessage("/rosout", LOG, ros.serialize(message, LOG))


def driving(machine, briefing):
    stack, process = machine.will_have(Stack())
    system = Ros2Stack(read_settings(SETTINGS))
    system.start(briefing)
    list(system.bring_up(first_of(briefing)))
    stack.believes = None
    stack.answer = CycleAnswer(
        None, 0, heard=True, server=True, messages=(log_line("out of memory"),)
    )
    return system, stack, process


@pytest.mark.parametrize("how", ["process", "goal", "link"])
def test_what_a_stack_says_last_comes_with_its_failure(machine, briefing, how):
    system, stack, process = driving(machine, briefing)
    if how == "process":
        process.end = "the launch command ended with exit code 9"
    if how == "goal":
        stack.answer = replace(stack.answer, goals=(GoalUpdate(0, "rejected"),))
    if how == "link":
        stack.cycle = lost
    with pytest.raises(SutFailure) as failed:
        system.update(Observation(0.0, (Odometry(0.0, Pose2(), Twist2()),), ()))
    said = [event.text for event in failed.value.events]
    assert "ready after" in said[0]
    assert said[1:] == ([] if how == "link" else ["out of memory"])
    assert failed.value.printed == ("its last line",)


def lost(cycle):
    raise LinkLost("the relay is silent")


def test_what_was_said_while_a_stack_came_up_comes_with_its_failure(machine, briefing):
    stack, _ = machine.will_have(Stack())
    stack.states["/amcl"] = "inactive"
    stack.believes = None
    stack.answer = replace(stack.answer, messages=(log_line("no map"),))
    system = Ros2Stack(read_settings(SETTINGS | {"start-up": "0.2 s"}))
    system.start(briefing)
    with pytest.raises(SutFailure, match=r"within 0\.2 s") as failed:
        list(system.bring_up(first_of(briefing)))
    assert {event.text for event in failed.value.events} == {"no map"}


def test_a_socket_that_cannot_be_made_is_said_and_leaves_nothing(machine, briefing, monkeypatch):
    _, process = machine.will_have(Stack())

    def refuse(*_):
        raise LinkLost("nothing can listen there: no space left on device")

    monkeypatch.setattr(bring_up.RelayLink, "listen", refuse)
    with pytest.raises(SutFailure, match="no space left"):
        list(coming_up(briefing)[1])
    assert process.released == 1


def test_a_refusal_of_the_relay_is_the_reason_and_not_its_end(machine, briefing):
    stack, process = machine.will_have(Stack())

    def refuse(_):
        process.end = "the relay ended with exit code 0"
        raise LinkRefused("the stack's package nav2_msgs has no msg BehaviorTreeLog")

    stack.set_up = refuse
    with pytest.raises(SutFailure, match="nav2_msgs has no msg BehaviorTreeLog"):
        list(coming_up(briefing)[1])


def test_a_stack_that_does_not_come_up_says_what_it_lacks(machine, briefing):
    stack, _ = machine.will_have(Stack())
    stack.states["/amcl"] = "inactive"
    _, waiting = coming_up(briefing, **{"start-up": "0.2 s"})
    with pytest.raises(SutFailure, match=r"within 0.2 s .*1 of 2 nodes active, amcl is inactive"):
        list(waiting)


def test_a_second_clock_in_the_domain_is_refused(machine, briefing):
    stack, _ = machine.will_have(Stack())
    stack.endpoints = (
        GraphEndpoint("/clock", "rosgraph_msgs/msg/Clock", "/bag", "publisher", True, False),
    )
    with pytest.raises(SutFailure, match="/bag publishes /clock too, in ROS domain 7"):
        list(coming_up(briefing)[1])


DEATH = "[ERROR] [{}-2]: process has died [pid 7, exit code {}, cmd '/opt/{} --ros-args']."
ABORT = (
    "[lifecycle_manager-7] [ERROR] [1.0] [lifecycle_manager]: Failed to bring up all requested "
    "nodes. Aborting bringup."
)


def died(process, code=-11):
    return DEATH.format(process, code, process)


def coming_up_in_vain(machine, briefing, *printed, **keys):
    """Make a stack whose amcl never becomes active; it has printed these lines."""
    stack, process = machine.will_have(Stack())
    stack.states["/amcl"] = "inactive"
    process.printed = list(printed)
    return process, coming_up(briefing, **keys)


@pytest.mark.parametrize(
    ("printed", "reason"),
    [
        ([died("amcl")], "amcl died with exit code -11 (SIGSEGV)"),
        ([ABORT], "Nav2 gave up bringing its nodes up"),
        (
            ["[amcl-2] [ERROR] [1.0] [amcl]: no map", ABORT],
            "Nav2 gave up bringing its nodes up: amcl: no map",
        ),
        (
            ["[bt_navigator-3] [ERROR] [1.0] [bt_navigator]: Could not load library: x.so", ABORT],
            "bt_navigator cannot load the library x.so",
        ),
    ],
)
def test_a_start_ends_at_once_with_its_cause(machine, briefing, printed, reason):
    _, (_, waiting) = coming_up_in_vain(machine, briefing, *printed)
    with pytest.raises(SutFailure) as failed:
        list(waiting)
    assert failed.value.reason == f"the stack did not come up: {reason}"
    assert failed.value.printed == tuple(printed)


def test_a_start_that_takes_too_long_names_a_cause_that_is_known(machine, briefing):
    line = "[amcl-2] [ERROR] [1.0] [amcl]: Could not load library: x.so"
    _, (_, waiting) = coming_up_in_vain(machine, briefing, line, **{"start-up": "0.2 s"})
    with pytest.raises(SutFailure, match=r"amcl is inactive; amcl cannot load the library x\.so\n"):
        list(waiting)


def test_a_start_that_failed_is_told_and_followed_by_another(machine, briefing):
    first, (attempt, waiting) = coming_up_in_vain(machine, briefing, died("amcl"), attempts=2)
    first.outputs = lambda: {"stack.txt": b"first"}
    second, _ = machine.will_have(Stack())
    list(waiting)
    assert attempt.ready_session().link is second
    assert first.released == 1
    assert attempt.events[0].text == (
        "the first start failed: amcl died with exit code -11 (SIGSEGV); started again"
    )
    assert attempt.outputs == {"first-stack.txt": b"first"}
    # What is latched is published to each.
    assert second.cycles[0].messages[0][0] == "/tf_static"


def test_the_last_start_fails_as_the_only_one_does(machine, briefing):
    coming_up_in_vain(machine, briefing, died("amcl", 1))
    _, (attempt, waiting) = coming_up_in_vain(machine, briefing, died("amcl", 2), attempts=2)
    with pytest.raises(SutFailure, match="exit code 2"):
        list(waiting)
    assert [event.text[:22] for event in attempt.events] == ["the first start failed"]


def test_no_start_begins_after_start_up(machine, briefing):
    _, (_, waiting) = coming_up_in_vain(machine, briefing, "x", attempts=2, **{"start-up": "0.1 s"})
    with pytest.raises(SutFailure, match=r"not ready within 0\.1 s"):
        list(waiting)


@pytest.mark.parametrize(
    ("printed", "reason"),
    [
        (died("amcl"), "amcl died with exit code -11 (SIGSEGV) at 12.4 s"),
        (
            "CRITICAL FAILURE: SERVER amcl IS DOWN after not receiving a heartbeat for 4000 ms.",
            "amcl is down: the lifecycle manager has missed its heartbeat at 12.4 s",
        ),
    ],
)
def test_a_node_that_dies_during_a_run_is_named(machine, briefing, printed, reason):
    system, _, process = driving(machine, briefing)
    process.printed = [printed]
    # The launch file may end everything because of it.
    process.end = "the launch command ended with exit code 1"
    with pytest.raises(SutFailure) as failed:
        update(system)
    assert failed.value.reason == reason


@pytest.mark.parametrize(
    ("printed", "reason"),
    [([], "amcl died at 12.4 s"), ([died("amcl")], "amcl died with exit code -11 (SIGSEGV)")],
)
def test_the_process_of_a_node_that_ends_is_named_also_when_launch_says_nothing(
    machine, briefing, monkeypatch, printed, reason
):
    system, _, process = driving(machine, briefing)
    monkeypatch.setattr(bring_up, "_EXIT_CODE_LIMIT", 0.0 if not printed else 60.0)
    assert process.watched == NODES
    process.dead = "amcl"
    # Launch prints a little later.
    alarms = iter([[]])
    process.alarms = lambda: next(alarms, printed)
    with pytest.raises(SutFailure) as failed:
        update(system)
    assert failed.value.reason.startswith(reason)


def test_the_death_of_a_process_without_needed_nodes_is_only_told(machine, briefing):
    system, _, process = driving(machine, briefing)
    process.printed = [died("rviz2", 1)]
    said = []
    for time in (0.0, 0.05):
        decision = update(system, time)
        said += [event.text for event in decision.events if "rviz2" in event.text]
    assert said == ["rviz2 died with exit code 1; it has none of the nodes of ready"]


def update(system, time=12.4):
    return system.update(Observation(time, (Odometry(time, Pose2(), Twist2()),), ()))


@pytest.mark.parametrize(
    ("inactive", "reason"),
    [
        ({"/amcl": "inactive"}, "amcl became inactive at 12.4 s"),
        ({"/amcl": ""}, "amcl left the graph at 12.4 s"),
        ({"/amcl": "not answering"}, "amcl did not answer any more at 12.4 s"),
        ({"/amcl": "inactive", "/bt": ""}, "bt left the graph at 12.4 s"),
    ],
)
def test_a_node_that_is_no_longer_active_is_named(machine, briefing, monkeypatch, inactive, reason):
    system, stack, _ = driving(machine, briefing)
    monkeypatch.setattr(ros2_stack, "_PATIENCE", {})
    stack.answer = replace(stack.answer, inactive=inactive)
    with pytest.raises(SutFailure) as failed:
        update(system)
    assert failed.value.reason == reason


def test_a_node_may_answer_late_on_a_loaded_machine(machine, briefing, monkeypatch):
    system, stack, _ = driving(machine, briefing)
    clock = SimpleNamespace(monotonic=lambda: 0.0)
    monkeypatch.setattr(ros2_stack, "wall_clock", clock)
    stack.answer = replace(stack.answer, inactive={"/amcl": "not answering"})
    update(system)
    clock.monotonic = lambda: 7.5
    update(system)
    clock.monotonic = lambda: 8.5
    with pytest.raises(SutFailure, match="amcl did not answer any more"):
        update(system)


def out_of_sight(machine, briefing):
    system, stack, _ = driving(machine, briefing)
    for inactive in ({"/amcl": ""}, {}, {"/amcl": "not answering"}):
        stack.answer = replace(stack.answer, inactive=inactive)
        update(system)
    return system, stack


def test_a_node_may_be_out_of_sight_for_a_moment_also_when_a_run_ends(machine, briefing):
    system, _ = out_of_sight(machine, briefing)
    system.finish()


def test_a_node_that_stays_out_of_sight_when_a_run_ends_is_an_error(machine, briefing, monkeypatch):
    system, stack = out_of_sight(machine, briefing)
    monkeypatch.setattr(ros2_stack, "_PATIENCE", {})
    stack.states["/amcl"] = "not answering"
    with pytest.raises(SutFailure, match=r"amcl did not answer any more at 12\.4 s"):
        system.finish()


def test_an_abort_is_the_robots_when_every_node_lives(machine, briefing):
    system, stack, _ = driving(machine, briefing)
    stack.answer = replace(stack.answer, goals=(GoalUpdate(0, "aborted"),))
    assert update(system).progress.state == "aborted"
    system.finish()


@pytest.mark.parametrize("news", ["launch", "node"])
def test_an_abort_because_of_a_death_is_none_of_the_robot(machine, briefing, monkeypatch, news):
    system, stack, process = driving(machine, briefing)
    monkeypatch.setattr(ros2_stack, "_PATIENCE", {})

    def die(*_):
        if news == "launch":
            process.printed = [died("amcl")]
        else:
            stack.states["/amcl"] = ""
        return {}

    stack.parameters = die
    stack.answer = replace(stack.answer, goals=(GoalUpdate(0, "aborted"),))
    expected = "amcl (died with exit code -11 .*|left the graph) at 12.4 s"
    with pytest.raises(SutFailure, match=expected):
        update(system)
