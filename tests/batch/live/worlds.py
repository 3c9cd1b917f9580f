"""A live world whose clock is turned by hand, and somebody who keeps what it says."""

from dataclasses import replace

from daemon.campaign import expand, load_campaign
from daemon.model.spec import SutReference

DEADLINE = 60.0


class HandClock:
    """A clock that stands still until it is moved."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


class Kept:
    """An outlet that keeps all messages."""

    def __init__(self):
        self.messages = []
        self.begun = 0
        self.last = None

    def send(self, topic, now, payload):
        self.messages.append((topic, now, payload))

    def has_listeners(self, topic):
        return True

    def begin(self):
        self.begun += 1

    def status(self, status):
        self.last = status

    def of(self, topic):
        return [(now, payload) for name, now, payload in self.messages if name == topic]


def demo_submission(campaigns):
    return expand(load_campaign(campaigns / "demo" / "campaign.yaml"))


def demo_spec(demo, scenario="busy-house"):
    spec = next(s for s in demo.specs if s.scenario == scenario)
    scene = next(s for s in demo.scenes if s.digest == spec.scene)
    return replace(spec, sut=SutReference("idle", "idle", {})), scene


def go(simulation, clock, seconds, step=0.05):
    """Let ``seconds`` of wall clock pass, in steps."""
    for _ in range(round(seconds / step)):
        clock.now += step
        simulation.step()
