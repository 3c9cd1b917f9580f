"""The stack as a system under test, and the order of events within one instant.

The original runs as threads and processes whose order at one instant is up to the machine. Here
time stands still while anybody works, and everything due at an instant happens in this order:

1. **Odometry** enters the transform buffer.
2. **Scans** whose odometry is known go to AMCL, which broadcasts its correction (with a stamp
   ``transform_tolerance`` ahead). A scan waits for the first odometry sample that is not older, at
   51 ms an instant or two, as in the message filter of the original.
3. **Observation buffers**: the costmaps' latest scan becomes one whose transforms are known up to
   50 ms beyond its stamp, a tolerance of costmap_2d, so it is one or two instants older still.
4. **Global costmap**, 5. **local costmap**: one update cycle each when due, first at time 0.
6. **Planner thread** when due or woken.
7. **Control loop** or the recovery that blocks it.
8. **Dispatcher**: takes the result of the goal at the instant it is known and sends the next one,
   for which the control loop runs its first cycle at once.

A plan is there for the control loop at the instant it is made (6 before 7). In the original
planning took 5 to 20 ms of the 100 ms between two control cycles and the two threads have no fixed
phase: a plan reaches the controller at the next cycle after that. Making it wait for the cycle
after the next would add ten times the delay there was. A plan that the control loop asks for is
made at the next instant, as the thread has had its turn by then, and used by the next control
cycle: as in the original.

An instant is a step of the stack: a multiple of 10 ms that divides the period of the control loop
and of the turn on the spot, 50 ms with the parameters of the paper. With frequencies that fit no
multiple of 10 ms a step is 10 ms, and what is due happens at the first step not before.

If AMCL gets no scans, odom stays where it was in the map at the start (the original would wait for
that transform for ever and drive nowhere).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from daemon.navigation.ros.configuration import RosParameters
from daemon.sut import Briefing, Decision, Observation

if TYPE_CHECKING:
    from daemon.navigation.ros._navigation import Navigation

_TICKS: Final = 100
"""Steps the simulator takes per second."""


class RosStack:
    """The ROS navigation stack; fulfils ``daemon.sut.SystemUnderTest``."""

    def __init__(self, parameters: RosParameters) -> None:
        self.parameters = parameters
        self._period = step_of(
            parameters.move_base.controller_frequency, parameters.rotate_recovery.frequency
        )
        self._navigation: Navigation | None = None

    @property
    def period(self) -> float:
        """Seconds of simulated time between two updates."""
        return self._period

    @property
    def needs_ground_truth(self) -> bool:
        """It localises itself."""
        return False

    def start(self, briefing: Briefing) -> None:
        """Bring the nodes up; raises ``ValueError`` for parameters that do not fit the map."""
        # Compiled kernels are only needed to drive, not to check a campaign's parameters.
        from daemon.navigation.ros._navigation import Navigation

        self._navigation = Navigation(briefing, self.parameters)

    def update(self, observation: Observation) -> Decision:
        """Decide; raises ``RuntimeError`` before ``start``."""
        if self._navigation is None:
            raise RuntimeError("the ROS stack was not started")
        return self._navigation.update(observation)


def step_of(*frequencies: float) -> float:
    """Return the longest step [s], a multiple of 10 ms, that fits all ``frequencies`` [Hz].

    10 ms when there is none.
    """
    ticks = [_TICKS / frequency for frequency in frequencies]
    if any(abs(tick - round(tick)) > 1e-6 for tick in ticks):
        return 1.0 / _TICKS
    return math.gcd(*(round(tick) for tick in ticks)) / _TICKS
