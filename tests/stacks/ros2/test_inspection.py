"""Starting a stack to look at it: what it is asked, and that it is ended whatever happens."""

import pytest

from daemon.model.sut import SutFailure
from daemon.stacks.ros2 import sensors
from daemon.stacks.ros2.inspection import PARAMETERS, inspect_stack
from daemon.stacks.ros2.keys import Ros2Frames
from daemon.stacks.ros2.link import CycleAnswer, ReceivedMessage
from daemon.stacks.ros2.settings import read_settings
from tests.stacks.ros2.pretended_link import BRIEFING, FIRST, NODES

GRAPH = "looking at its graph"


@pytest.fixture
def stack(machine):
    """A stack that localises the robot and publishes odometry's transform too, as it should not."""
    link, process = machine.will_have()
    (standing,) = FIRST.odometry
    localised = sensors.odometry_transform(standing, 0, Ros2Frames(odom="map", base="odom"))
    fused = sensors.odometry_transform(standing, 0, Ros2Frames())
    messages = tuple(
        ReceivedMessage("/tf", sensors.TRANSFORMS, data)
        for data in (localised, fused, b"\0\1\0\0damaged")
    )
    link.answer = CycleAnswer(None, 0, heard=True, server=True, messages=messages)
    link.believes = None
    return link, process


def inspected(on_progress=lambda _: None, **keys):
    launch = {"launch": "ros2 launch nav nav.launch.py map:={map}", "ready": ["amcl"]}
    settings = read_settings({**launch, **keys, "repeatable": False})
    return inspect_stack(settings, BRIEFING, FIRST, on_progress, lambda _: None)


def test_a_stack_that_is_up_is_asked_for_everything_and_ended(stack):
    link, process = stack
    link.states = {"/amcl": "inactive"}
    waited = []

    def progress(waiting):
        waited.append(waiting)
        if "0 of 1 nodes active, amcl is inactive" in waiting:
            link.states = {"/amcl": "active"}

    seen = inspected(progress)
    assert (seen.identity, seen.failure) == (link.identity, None)
    assert seen.readiness.nodes == {"/amcl": "active"}
    assert seen.graph == link.graph()
    assert seen.parameters == {"/amcl": dict.fromkeys(PARAMETERS, True)}
    assert link.asked == [("/amcl", PARAMETERS)]
    assert seen.transforms == {("map", "odom"), ("odom", "base_link")}
    assert seen.located
    assert waited[-1] == GRAPH
    assert (process.released, link.goals, link.closed) == (1, [], True)
    times = [cycle.time for cycle in link.cycles]
    assert times == sorted(times)
    # Only what comes while nothing is published is of others.
    assert [cycle.messages for cycle in link.cycles[-20:]] == [()] * 20


def test_a_stack_that_does_not_get_ready_is_looked_at_all_the_same(stack):
    link, process = stack
    link.states = {"/amcl": "inactive"}
    heard, link.answer = link.answer, CycleAnswer(None, 0, heard=True, server=True)

    def localise(waiting):
        if waiting == GRAPH:
            link.answer = heard

    seen = inspected(localise, **{"start-up": "0.1 s"})
    assert seen.located
    said = seen.failure.reason
    assert said.startswith("the stack was not ready within 0.1 s of wall clock (start-up)")
    assert seen.failure.printed == ("its last line",)
    assert seen.graph.nodes == NODES
    assert process.released == 1


def test_a_stack_that_does_not_find_itself_is_not_located(stack):
    link, _ = stack
    link.answer = CycleAnswer(None, 0, heard=True, server=True)
    assert not inspected(**{"start-up": "0.1 s"}).located


@pytest.mark.parametrize(
    ("changes", "at_graph", "expected"),
    [
        ({"end": "the launch command ended"}, False, "the stack did not come up: the launch com"),
        ({"end": "the launch command ended", "gone": True}, False, "up: the launch command ended"),
        ({"gone": True}, True, "the relay is silent"),
        ({}, False, None),
    ],
    ids=["it ends", "its link ends first", "its link is lost", "interrupted"],
)
def test_a_stack_that_ends_is_told_and_nothing_left_running(stack, changes, at_graph, expected):
    link, process = stack
    link.states = {"/amcl": "active" if at_graph else "inactive"}

    def spoil(waiting):
        if not at_graph or waiting == GRAPH:
            process.end, link.gone = changes.get("end", ""), changes.get("gone", False)
        if not changes and link.cycles:
            raise KeyboardInterrupt

    with pytest.raises(SutFailure if changes else KeyboardInterrupt, match=expected):
        inspected(spoil)
    assert process.released == 1
