"""A system under test of the tests of runs."""

import numpy as np

from daemon.model.sut import Decision, Estimate, Progress, SutFailure
from grammars.model.geometry import Pose2, Twist2


class System:
    """A system of a test, perhaps an external one: it waits for what is said, then drives on.

    ``answer`` makes of its decision what it answers.
    """

    period = 0.1
    needs_ground_truth = False

    def __init__(self, waiting=(), failure="", events=(), answer=lambda decision: decision):
        self._waiting, self._failure, self._events = waiting, failure, events
        self._answer = answer

    def start(self, briefing):
        """Nothing to prepare."""

    def bring_up(self, first):
        yield from self._waiting
        if self._failure:
            raise SutFailure(self._failure, events=self._events)

    def update(self, observation):
        estimate = Estimate(observation.time, Pose2(), np.eye(3))
        return self._answer(
            Decision(Twist2(0.2), Progress(0, 0, "active"), estimate, latency=0.012)
        )

    def finish(self):
        """Fine."""

    def close(self):
        """Nothing to end."""

    def outputs(self):
        return {"stack.txt": b"up\xff\n"}


def later(answer, at=1.0):
    """From second ``at`` on another answer."""
    return lambda right: right if right.estimate.time < at else answer(right)
