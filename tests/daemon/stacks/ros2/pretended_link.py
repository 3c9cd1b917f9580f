"""A link without anything behind it, for tests of what stands on links."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from daemon.stacks.ros2.link import (
    Cycle,
    CycleAnswer,
    Graph,
    LinkSetup,
    Readiness,
    StackIdentity,
)

Pose = tuple[float, float, float]


class PretendedLink:
    """Remembers goals; answers cycles with ``answer``."""

    def __init__(self) -> None:
        self.identity = StackIdentity("", "rmw_pretended")
        self.goals: list[tuple[int, tuple[Pose, ...], str, int]] = []
        self.cycles: list[Cycle] = []
        self.answer = CycleAnswer(None, 0, heard=False, server=True)

    def set_up(self, setup: LinkSetup) -> None:
        self.setup = setup

    def cycle(self, cycle: Cycle) -> CycleAnswer:
        self.cycles.append(cycle)
        return self.answer

    def readiness(self) -> Readiness:
        return Readiness({}, True, "", {})

    def send_goal(self, goal: int, poses: tuple[Pose, ...], frame: str, time: int) -> None:
        self.goals.append((goal, poses, frame, time))

    def cancel_goals(self) -> None:
        self.goals.clear()

    def graph(self) -> Graph:
        return Graph((), (), ())

    def parameters(self, node: str, names: tuple[str, ...]) -> Mapping[str, Any]:
        return {}

    def request_state(self, node: str, transition: str) -> None:
        raise AssertionError(f"{transition} {node} was not expected")

    def close(self) -> None:
        self.cycles.clear()
