"""From the command to a stack that is ready: its clock, its pose."""

from dataclasses import replace

import pytest

from daemon.model import ros_messages as ros
from daemon.model.sut import SutFailure
from daemon.stacks.ros2 import bring_up, sensors
from daemon.stacks.ros2.bring_up import BringUp
from daemon.stacks.ros2.link import (
    CycleAnswer,
    GoalUpdate,
    GraphEndpoint,
    LinkLost,
    LinkRefused,
    ReceivedMessage,
)
from daemon.stacks.ros2.settings import read_settings
from daemon.stacks.ros2.stack import Ros2Stack
from daemon.stacks.ros2.telemetry import LOG
from tests.stacks.ros2.pretended_link import (
    BRIEFING,
    FIRST,
    NODES,
    START,
    Machine,
    PretendedLink,
    observation,
)

SECOND = 1_000_000_000
SETTINGS = {"launch": "true", "ready": [node.strip("/") for node in NODES], "start-up": "60 s"}


def coming_up(**keys):
    attempt = BringUp(read_settings(SETTINGS | keys), BRIEFING, FIRST)
    return attempt, attempt.run()


def test_the_clock_begins_at_a_second_never_goes_back_and_the_run_at_a_round_time(machine):
    stack, _ = machine.will_have()
    attempt, waiting = coming_up()
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
    (told,) = stack.told
    told = sensors.read_message(told, sensors.INITIAL_POSE)
    assert (told.pose.pose.position.x, told.header.frame_id) == (START.x, "map")


def test_an_answer_that_comes_with_the_initial_pose_is_heard(machine):
    machine.will_have(PretendedLink(once=True))
    attempt, waiting = coming_up()
    list(waiting)
    assert attempt.ready_session().telemetry.pose() == START
    assert not any("no transform" in event.text for event in attempt.events)


def log_line(text):
    message = ros.make(
        LOG, stamp=ros.time(0), level=40, name="planner", msg=text, file="", function="", line=0
    )
    return ReceivedMessage("/rosout", LOG, ros.serialize(message, LOG))


def driving(machine):
    stack, process = machine.will_have()
    system = Ros2Stack(read_settings(SETTINGS))
    system.start(BRIEFING)
    list(system.bring_up(FIRST))
    stack.believes = None
    stack.answer = CycleAnswer(
        None, 0, heard=True, server=True, messages=(log_line("out of memory"),)
    )
    return system, stack, process


def test_a_socket_that_cannot_be_made_is_said_and_leaves_nothing(machine, monkeypatch):
    _, process = machine.will_have()

    def refuse(*_):
        raise LinkLost("nothing can listen there: no space left on device")

    monkeypatch.setattr(bring_up.RelayLink, "listen", refuse)
    with pytest.raises(SutFailure, match="no space left"):
        list(coming_up()[1])
    assert process.released == 1


def test_a_refusal_of_the_relay_is_the_reason_and_not_its_end(machine):
    stack, process = machine.will_have()

    def refuse(_):
        process.end = "the relay ended with exit code 0"
        raise LinkRefused("the stack's package nav2_msgs has no msg BehaviorTreeLog")

    stack.set_up = refuse
    with pytest.raises(SutFailure, match="nav2_msgs has no msg BehaviorTreeLog"):
        list(coming_up()[1])


DEATH = "[ERROR] [{}-2]: process has died [pid 7, exit code {}, cmd '/opt/{} --ros-args']."
ABORT = (
    "[lifecycle_manager-7] [ERROR] [1.0] [lifecycle_manager]: Failed to bring up all requested "
    "nodes. Aborting bringup."
)


def died(process, code=-11):
    return DEATH.format(process, code, process)


LIBRARY = "[bt_navigator-3] [ERROR] [1.0] [bt_navigator]: Could not load library: x.so"
TYPE = (
    "[controller_server-3] [ERROR] [17.2] []: Original error: parameter 'controller_frequency' has "
    "invalid type: expected [double] got [string]"
)
PARAMETERS = "controller_server:\n  ros__parameters:\n    controller_frequency: twenty\n"
NO_MAP = "[amcl-2] [ERROR] [1.0] [amcl]: no map"
SECOND_CLOCK = GraphEndpoint("/clock", "rosgraph_msgs/msg/Clock", "/bag", "publisher", True, False)
INACTIVE = {"/amcl": "inactive", "/bt_navigator": "active"}
ACTIVE = {"states": dict.fromkeys(NODES, "active"), "believes": START}
DOWN = "CRITICAL FAILURE: SERVER amcl IS DOWN after not receiving a heartbeat for 4000 ms."
LATE = {"start-up": "0.1 s"}
FINISH = "the run ends"
STARTS = {
    "a node died": ({"printed": [died("amcl")]}, {}),
    "Nav2 gave up": ({"printed": [ABORT]}, {}),
    "Nav2 gave up after an error": ({"printed": [NO_MAP, ABORT]}, {}),
    "Nav2 gave up for a reason that is known": ({"printed": [LIBRARY, ABORT]}, {}),
    "a mistake in a file of parameters": ({"printed": [TYPE, ABORT]}, {}),
    "it takes too long": ({}, LATE),
    "no other start begins then": ({}, LATE | {"attempts": 2}),
    "it takes too long for a reason that is known": ({"printed": [LIBRARY]}, LATE),
    "it has said something meanwhile": ({"messages": (log_line("no map"),)}, LATE),
    "a second clock": (ACTIVE | {"endpoints": (SECOND_CLOCK,)}, {}),
}
ABORTED, SILENT = {"goals": (GoalUpdate(0, "aborted"),)}, {"inactive": {"/amcl": "not answering"}}
RUNS = {
    "launch ended": [{"end": "the launch command ended with exit code 9"}],
    "the goal was rejected": [{"goals": (GoalUpdate(0, "rejected"),)}],
    "the link was lost": [{"gone": True}],
    # The launch file may end everything because of it.
    "a node died": [{"printed": [died("amcl")], "end": "the launch command ended"}],
    "a node missed its heartbeat": [{"printed": [DOWN]}],
    "the process of a node ended, and launch says nothing": [{"dead": "amcl"}],
    "a process without needed nodes died": [{"printed": [died("rviz2", 1)]}, 0.1],
    "a node is inactive": [{"inactive": {"/amcl": "inactive"}}],
    "a node left": [{"inactive": {"/amcl": ""}}, 0.9, 0.2],
    "a node answers late": [SILENT, 7.5, {"inactive": {}}, SILENT, 7.5],
    "a node does not answer": [SILENT, 7.5, 1.0],
    "one inactive and one that left": [
        {"inactive": {"/bt": ""}}, (1.5, {"inactive": {"/amcl": "inactive", "/bt": ""}})],
    "out of sight for a moment also when it ends": [
        {"inactive": {"/amcl": ""}}, {"inactive": {}}, SILENT, FINISH],
    "out of sight for long when it ends": [
        SILENT, {"states": {"/amcl": "not answering"}}, FINISH],
    "an abort when every node lives": [ABORTED, FINISH],
}  # fmt: skip


def spoil(stack, process, changes):
    """Change a stack, its processes, or what it answers."""
    for name, value in changes.items():
        if name in ("messages", "goals", "inactive"):
            stack.answer = replace(stack.answer, **{name: value})
        else:
            setattr(process if hasattr(process, name) else stack, name, value)


def told(name, failure):
    events = [event.text for event in failure.events if "ready after" not in event.text]
    said = [f"event {text}" for text in dict.fromkeys(events)]
    return [f"--- {name}", failure.reason, *said, *(f"printed {line}" for line in failure.printed)]


def run(name, machine, steps):
    """Return the lines about a run in which something changes, or seconds of wall clock pass."""
    system, stack, process = driving(machine)
    assert process.watched == NODES
    lines = [f"--- {name}"]
    for step in steps:
        seconds, changes = step if isinstance(step, tuple) else (0.0, step)
        machine.clock.sleep(changes if isinstance(changes, float) else seconds)
        spoil(stack, process, changes if isinstance(changes, dict) else {})
        try:
            decision = system.finish() if step == FINISH else update(system)
        except SutFailure as failure:
            return [*lines, *told(name, failure)[1:]]
        events = decision.events if decision else ()
        lines += [f"goes on: {', '.join(event.text for event in events)}".rstrip(": ")]
    return lines


def test_a_failure_has_its_cause_and_all_that_was_said(tmp_path, monkeypatch, golden):
    """``failures.txt``: of starts, then of runs and what they say after each step."""
    lines = []
    (parameters := tmp_path / "parameters.yaml").write_text(PARAMETERS)
    for number, (name, (changes, keys)) in enumerate(STARTS.items()):
        (folder := tmp_path / str(number)).mkdir()
        stack, process = Machine(folder, monkeypatch).will_have()
        stack.believes = None
        spoil(stack, process, {"states": INACTIVE} | changes)
        files = {"files": {"params": str(parameters)}}
        system = Ros2Stack(read_settings(SETTINGS | files | keys))
        system.start(BRIEFING)
        with pytest.raises(SutFailure) as failed:
            list(system.bring_up(FIRST))
        lines += told(f"start: {name}", failed.value)
    for number, (name, steps) in enumerate(RUNS.items(), len(STARTS)):
        (folder := tmp_path / str(number)).mkdir()
        lines += run(f"run: {name}", Machine(folder, monkeypatch), steps)
    golden("failures.txt", "\n".join(lines) + "\n")


def failing(machine, code):
    """Let the next stack be one whose amcl dies before it becomes active."""
    stack, process = machine.will_have()
    stack.states["/amcl"] = "inactive"
    process.printed = [died("amcl", code)]
    return process


def test_a_start_that_failed_is_told_and_followed_by_another(machine):
    first = failing(machine, -11)
    first.outputs = lambda: {"stack.txt": b"first"}
    second, _ = machine.will_have()
    attempt, waiting = coming_up(attempts=2)
    list(waiting)
    assert attempt.ready_session().link is second
    assert first.released == 1
    assert attempt.events[0].text == (
        "the first start failed: amcl died with exit code -11 (SIGSEGV); started again"
    )
    assert attempt.outputs == {"first-stack.txt": b"first"}
    # What is latched is published to each.
    assert second.cycles[0].messages[0][0] == "/tf_static"


def test_the_last_start_fails_as_the_only_one_does(machine):
    for code in (1, 2):
        failing(machine, code)
    attempt, waiting = coming_up(attempts=2)
    with pytest.raises(SutFailure, match="exit code 2"):
        list(waiting)
    assert [event.text[:22] for event in attempt.events] == ["the first start failed"]


def test_launch_may_say_a_little_later_how_a_process_ended(machine):
    system, _, process = driving(machine)
    process.dead = "amcl"
    alarms = iter([[]])
    process.alarms = lambda: next(alarms, [died("amcl")])
    with pytest.raises(SutFailure, match=r"amcl died with exit code -11 \(SIGSEGV\)"):
        update(system)


def update(system, time=12.4):
    return system.update(observation(time))


@pytest.mark.parametrize("news", ["launch", "node"])
def test_an_abort_because_of_a_death_is_none_of_the_robot(machine, news):
    system, stack, process = driving(machine)

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
