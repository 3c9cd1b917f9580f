"""Starting a stack to look at it: what it is asked, and that it is ended whatever happens."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daemon.model.sut import Briefing, LaserScan, Observation, Odometry, SutFailure
from daemon.stacks.ros2 import bring_up, sensors
from daemon.stacks.ros2.inspection import PARAMETERS, Inspection, inspect_stack
from daemon.stacks.ros2.link import (
    Cycle,
    CycleAnswer,
    Graph,
    LinkLost,
    Readiness,
    ReceivedMessage,
    StackIdentity,
)
from daemon.stacks.ros2.settings import Frames, Ros2Settings, read_settings
from grammars.model.geometry import Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from grammars.model.mission import Mission, Waypoint
from tests.daemon.stacks.ros2.pretended_link import PretendedLink
from tests.daemon.trace.recordings import ROBOT

STANDING = Odometry(0.0, Pose2(), Twist2())
FIRST = Observation(0.0, (STANDING,), (LaserScan(0.0, np.full(ROBOT.laser.rays, 2.0, np.float32)),))
BRIEFING = Briefing(
    ROBOT,
    OccupancyGrid(0.5, 0.0, 0.0, np.zeros((8, 8), np.int8)),
    Mission("check", Pose2(), (Waypoint("here", 0.0, 0.0),)),
    Pose2(),
    np.random.SeedSequence(0),
)


def settings(**keys: Any) -> Ros2Settings:
    launch = {"launch": "ros2 launch nav nav.launch.py map:={map}", "ready": ["amcl"]}
    return read_settings({**launch, **keys, "repeatable": False})


class PretendedStack(PretendedLink):
    """A link to a stack whose one node becomes active when it is asked for the third time.

    It localises the robot and, what it should not, publishes odometry's transform too.
    """

    def __init__(self) -> None:
        super().__init__()
        self.identity = StackIdentity("jazzy", "rmw_pretended")
        self.asked: list[tuple[str, tuple[str, ...]]] = []
        self.looks = 0
        self.active_after = 3
        self.gone = False
        frames = Frames()
        localised = sensors.odometry_transform(STANDING, 0, Frames(odom="map", base="odom"))
        fused = sensors.odometry_transform(STANDING, 0, frames)
        self.messages = tuple(
            ReceivedMessage("/tf", sensors.TRANSFORMS, data)
            for data in (localised, fused, b"\0\1\0\0damaged")
        )

    def accept(self, timeout: float) -> bool:
        return True

    def cycle(self, cycle: Cycle) -> CycleAnswer:
        if self.gone:
            raise LinkLost("the relay is silent")
        super().cycle(cycle)
        return CycleAnswer(None, 0, heard=True, server=True, messages=self.messages)

    def readiness(self) -> Readiness:
        self.looks += 1
        state = "active" if self.looks >= self.active_after else "inactive"
        return Readiness({"/amcl": state}, True, "", {})

    def graph(self) -> Graph:
        return Graph((), ("/amcl",), ("/amcl/get_parameters", "/amcl/get_state", "/talk"))

    def parameters(self, node: str, names: tuple[str, ...]) -> Mapping[str, Any]:
        self.asked.append((node, names))
        return {"use_sim_time": True}

    def close(self) -> None:
        self.closed = True


class PretendedProcess:
    """Stands in for the processes of a stack; remembers that they were released."""

    nonce, reused = "", False

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.socket = folder / "socket"
        self.end = ""
        self.released: list[bool] = []

    def __call__(self, settings: Ros2Settings, **_: Any) -> PretendedProcess:
        self.settings = settings
        return self

    def start(self) -> None:
        """Nothing to start."""

    def ended(self) -> str:
        return self.end

    def last_lines(self, count: int = 20) -> tuple[str, ...]:
        return ("its last line",)

    def release(self, *, keep: bool) -> None:
        self.released.append(keep)

    def outputs(self) -> Mapping[str, bytes]:
        return {}


@pytest.fixture
def stack(monkeypatch: pytest.MonkeyPatch) -> PretendedStack:
    found = PretendedStack()

    class Listening:
        @staticmethod
        def listen(path: Path, nonce: str) -> PretendedStack:
            return found

    monkeypatch.setattr(bring_up, "RelayLink", Listening)
    return found


@pytest.fixture
def process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> PretendedProcess:
    found = PretendedProcess(tmp_path)
    monkeypatch.setattr(bring_up, "StackProcess", found)
    return found


def inspected(on_progress: Callable[[str], None] = lambda _: None, **keys: Any) -> Inspection:
    return inspect_stack(settings(**keys), BRIEFING, FIRST, on_progress)


def test_a_stack_that_is_up_is_asked_for_everything_and_ended(
    stack: PretendedStack, process: PretendedProcess
) -> None:
    waited: list[str] = []
    seen = inspected(waited.append, reuse=True)
    assert (seen.identity, seen.failure) == (stack.identity, "")
    assert seen.readiness.nodes == {"/amcl": "active"}
    assert seen.graph == stack.graph()
    assert seen.parameters == {"/amcl": {"use_sim_time": True}}
    assert stack.asked == [("/amcl", PARAMETERS)]
    assert seen.transforms == {("map", "odom"), ("odom", "base_link")}
    assert seen.located
    assert "0 of 1 nodes active, amcl is inactive" in " ".join(waited)
    assert waited[-1] == "looking at its graph"
    # Started anew, and not left to a run, whatever its settings say.
    assert not process.settings.reuse
    assert process.released == [False]
    assert stack.goals == []
    times = [cycle.time for cycle in stack.cycles]
    assert len(times) > 20
    assert times == sorted(times)
    assert stack.closed


def test_only_what_comes_while_nothing_is_published_is_of_others(
    stack: PretendedStack, process: PretendedProcess
) -> None:
    inspected()
    listening = stack.cycles[-20:]
    assert [cycle.messages for cycle in listening] == [()] * 20


def test_a_stack_that_does_not_get_ready_is_looked_at_all_the_same(
    stack: PretendedStack, process: PretendedProcess
) -> None:
    stack.active_after = 10**9
    seen = inspected(**{"start-up": "0.3 s"})
    first, *last = seen.failure.splitlines()
    assert first.startswith("the stack was not ready within 0.3 s of wall clock (start-up)")
    assert last == ["  its last line"]
    assert seen.graph.nodes == ("/amcl",)
    assert process.released == [False]


@pytest.mark.parametrize("link_ends_first", [False, True])
def test_a_stack_that_ends_cannot_be_looked_at(
    stack: PretendedStack, process: PretendedProcess, link_ends_first: bool
) -> None:
    process.end = "the launch command ended with exit code 3"
    stack.active_after = 10**9
    stack.gone = link_ends_first
    with pytest.raises(SutFailure, match="the stack did not come up: the launch command ended"):
        inspected()
    assert process.released == [False]


def test_a_link_that_is_lost_says_why(stack: PretendedStack, process: PretendedProcess) -> None:
    def lose(waiting: str) -> None:
        stack.gone = stack.gone or waiting == "looking at its graph"

    with pytest.raises(SutFailure, match="the relay is silent"):
        inspected(lose)
    assert process.released == [False]


def test_whoever_interrupts_it_leaves_nothing_running(
    stack: PretendedStack, process: PretendedProcess
) -> None:
    def interrupt(_: str) -> None:
        if stack.cycles:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        inspected(interrupt)
    assert process.released == [False]


def test_a_command_that_is_not_there_is_said_in_words_with_real_processes() -> None:
    with pytest.raises(SutFailure) as failed:
        inspected(launch="a-command-nobody-has {map}")
    assert "the stack did not come up" in str(failed.value)
