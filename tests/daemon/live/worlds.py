"""A live world whose clock is turned by hand, and somebody who keeps what it says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from daemon.campaign import expand, load_campaign
from daemon.live.simulation import LiveSimulation, LiveStatus
from daemon.model.spec import RunSpec, SutReference
from daemon.model.status import Submission
from grammars.model.scene import Scene

DEADLINE = 60.0


class HandClock:
    """A clock that stands still until it is moved."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


class Kept:
    """An outlet that keeps all messages."""

    def __init__(self) -> None:
        self.messages: list[tuple[str, int, bytes]] = []
        self.begun = 0
        self.last: LiveStatus | None = None

    def send(self, topic: str, now: int, payload: bytes) -> None:
        self.messages.append((topic, now, payload))

    def wanted(self, topic: str) -> bool:
        return True

    def begin(self) -> None:
        self.begun += 1

    def status(self, status: LiveStatus) -> None:
        self.last = status

    def of(self, topic: str) -> list[tuple[int, bytes]]:
        return [(now, payload) for name, now, payload in self.messages if name == topic]


def demo_submission(campaigns: Path) -> Submission:
    return expand(load_campaign(campaigns / "demo" / "campaign.yaml"))


def demo_spec(demo: Submission, scenario: str = "busy-house") -> tuple[RunSpec, Scene]:
    spec = next(s for s in demo.runs if s.scenario == scenario)
    scene = next(s for s in demo.scenes if s.digest == spec.scene)
    return replace(spec, sut=SutReference("idle", "idle", {})), scene


def go(simulation: LiveSimulation, clock: HandClock, seconds: float, step: float = 0.05) -> None:
    """Let ``seconds`` of wall clock pass, in steps."""
    for _ in range(round(seconds / step)):
        clock.now += step
        simulation.step()
