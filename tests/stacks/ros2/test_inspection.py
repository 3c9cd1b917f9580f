"""Starting a stack to look at it: what it is asked, and that it is ended whatever happens."""

import numpy as np
import pytest

from daemon.model.sut import Briefing, LaserScan, Observation, Odometry, SutFailure
from daemon.stacks.ros2 import bring_up, sensors
from daemon.stacks.ros2.inspection import PARAMETERS, inspect_stack
from daemon.stacks.ros2.keys import Ros2Frames
from daemon.stacks.ros2.link import (
    CycleAnswer,
    Graph,
    LinkLost,
    Readiness,
    ReceivedMessage,
    StackIdentity,
)
from daemon.stacks.ros2.settings import read_settings
from grammars.model.geometry import Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from grammars.model.mission import Mission, Waypoint
from tests.engine.trace.recordings import ROBOT
from tests.stacks.ros2.pretended_link import PretendedLink, PretendedProcess

STANDING = Odometry(0.0, Pose2(), Twist2())
FIRST = Observation(0.0, (STANDING,), (LaserScan(0.0, np.full(ROBOT.laser.rays, 2.0, np.float32)),))
BRIEFING = Briefing(
    ROBOT,
    OccupancyGrid(0.5, 0.0, 0.0, np.zeros((8, 8), np.int8)),
    Mission("check", Pose2(), (Waypoint("here", 0.0, 0.0),)),
    Pose2(),
    np.random.SeedSequence(0),
)


def settings(**keys):
    launch = {"launch": "ros2 launch nav nav.launch.py map:={map}", "ready": ["amcl"]}
    return read_settings({**launch, **keys, "repeatable": False})


class PretendedStack(PretendedLink):
    """A link to a stack whose one node becomes active when it is asked for the third time.

    It localises the robot and, what it should not, publishes odometry's transform too.
    """

    def __init__(self):
        super().__init__()
        self.identity = StackIdentity("jazzy", "rmw_pretended")
        self.asked = []
        self.looks = 0
        self.active_after = 3
        self.gone = False
        frames = Ros2Frames()
        localised = sensors.odometry_transform(STANDING, 0, Ros2Frames(odom="map", base="odom"))
        fused = sensors.odometry_transform(STANDING, 0, frames)
        self.messages = tuple(
            ReceivedMessage("/tf", sensors.TRANSFORMS, data)
            for data in (localised, fused, b"\0\1\0\0damaged")
        )

    def accept(self, timeout):
        return True

    def cycle(self, cycle):
        if self.gone:
            raise LinkLost("the relay is silent")
        super().cycle(cycle)
        return CycleAnswer(None, 0, heard=True, server=True, messages=self.messages)

    def readiness(self):
        self.looks += 1
        state = "active" if self.looks >= self.active_after else "inactive"
        return Readiness({"/amcl": state}, True, {})

    def graph(self):
        return Graph((), ("/amcl",), ("/amcl/get_parameters", "/amcl/get_state", "/talk"))

    def parameters(self, node, names):
        self.asked.append((node, names))
        return {"use_sim_time": True}

    def close(self):
        self.closed = True


@pytest.fixture
def stack(monkeypatch):
    found = PretendedStack()

    class Listening:
        @staticmethod
        def listen(path, nonce):
            return found

    monkeypatch.setattr(bring_up, "RelayLink", Listening)
    return found


@pytest.fixture
def process(tmp_path, monkeypatch):
    found = PretendedProcess(tmp_path)
    monkeypatch.setattr(bring_up, "StackProcess", found)
    return found


def inspected(on_progress=lambda _: None, on_end=lambda _: None, **keys):
    return inspect_stack(settings(**keys), BRIEFING, FIRST, on_progress, on_end)


def test_a_stack_that_is_up_is_asked_for_everything_and_ended(stack, process):
    waited = []
    seen = inspected(waited.append)
    assert (seen.identity, seen.failure) == (stack.identity, None)
    assert seen.readiness.nodes == {"/amcl": "active"}
    assert seen.graph == stack.graph()
    assert seen.parameters == {"/amcl": {"use_sim_time": True}}
    assert stack.asked == [("/amcl", PARAMETERS)]
    assert seen.transforms == {("map", "odom"), ("odom", "base_link")}
    assert seen.located
    assert "0 of 1 nodes active, amcl is inactive" in " ".join(waited)
    assert waited[-1] == "looking at its graph"
    assert process.released == 1
    assert stack.goals == []
    times = [cycle.time for cycle in stack.cycles]
    assert len(times) > 20
    assert times == sorted(times)
    assert stack.closed


def test_only_what_comes_while_nothing_is_published_is_of_others(stack, process):
    inspected()
    listening = stack.cycles[-20:]
    assert [cycle.messages for cycle in listening] == [()] * 20


def test_a_stack_that_does_not_get_ready_is_looked_at_all_the_same(stack, process):
    stack.active_after = 10**9
    seen = inspected(**{"start-up": "0.3 s"})
    said = seen.failure.reason
    assert said.startswith("the stack was not ready within 0.3 s of wall clock (start-up)")
    assert seen.failure.printed == ("its last line",)
    assert seen.graph.nodes == ("/amcl",)
    assert process.released == 1


def test_a_stack_that_finds_itself_late_is_located(stack, process):
    stack.active_after = 10**9
    found, stack.messages = stack.messages, ()

    def localise(waiting):
        if waiting == "looking at its graph":
            stack.messages = found

    assert not inspected(**{"start-up": "0.3 s"}).located
    assert inspected(localise, **{"start-up": "0.3 s"}).located


@pytest.mark.parametrize("link_ends_first", [False, True])
def test_a_stack_that_ends_cannot_be_looked_at(stack, process, link_ends_first):
    process.end = "the launch command ended with exit code 3"
    stack.active_after = 10**9
    stack.gone = link_ends_first
    with pytest.raises(SutFailure, match="the stack did not come up: the launch command ended"):
        inspected()
    assert process.released == 1


def test_a_link_that_is_lost_says_why(stack, process):
    def lose(waiting):
        stack.gone = stack.gone or waiting == "looking at its graph"

    with pytest.raises(SutFailure, match="the relay is silent"):
        inspected(lose)
    assert process.released == 1


def test_whoever_interrupts_it_leaves_nothing_running(stack, process):
    def interrupt(_):
        if stack.cycles:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        inspected(interrupt)
    assert process.released == 1


def test_a_command_that_is_not_there_is_said_in_words_with_real_processes():
    with pytest.raises(SutFailure) as failed:
        inspected(launch="a-command-nobody-has {map}")
    assert "the stack did not come up" in str(failed.value)
