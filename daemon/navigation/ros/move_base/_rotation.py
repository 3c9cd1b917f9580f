"""The turn on the spot that move_base tries when it is stuck (``rotate_recovery``)."""

from __future__ import annotations

import math

import numpy as np

from daemon.navigation.ros.grids import CostGrid
from daemon.navigation.ros.move_base._footprint import turn_is_free
from daemon.navigation.ros.move_base._parameters import RotateRecoveryParameters
from daemon.navigation.ros.move_base._recoveries import Advance, Around
from daemon.navigation.ros.quirks import Quirks
from grammars.values import Floats, Twist2, wrap_angle


class Rotate:
    """Turns left through half a turn and on to where it began (``RotateRecovery``).

    Before each command the rest of the turn must be free of collisions in the local costmap,
    looked at every ``sim_granularity``. Its last command stays when it ends, unless
    :attr:`Quirks.turn_ends_unstopped` is off.
    """

    def __init__(
        self,
        name: str,
        parameters: RotateRecoveryParameters,
        quirks: Quirks,
        footprint: Floats,
        local: CostGrid,
    ) -> None:
        self.name = name
        self.period = 1.0 / parameters.frequency
        self._parameters, self._footprint, self._local = parameters, footprint, local
        self._at_the_end = None if quirks.turn_ends_unstopped else Twist2()
        self._begun = self._heading = 0.0
        self._halfway = False

    def start(self, around: Around) -> None:
        """Remember the heading to come back to."""
        self._begun = self._heading = around.odom.yaw
        self._halfway = False

    def step(self, around: Around) -> Advance:
        """Command the next piece of the turn; the heading of the last step decides on the end."""
        parameters = self._parameters
        if self._halfway and self._away(self._begun) <= parameters.yaw_goal_tolerance:
            return Advance(self._at_the_end, True, f"{self.name} has turned once")
        pose = around.odom
        self._heading = pose.yaw
        left = self._left()
        grid = self._local
        frame, here = (grid.x, grid.y, grid.resolution), (pose.x, pose.y, pose.yaw)
        if not turn_is_free(
            grid.cells, np.array(frame), self._footprint, np.array(here), left,
            parameters.sim_granularity,
        ):  # fmt: skip
            return Advance(self._at_the_end, True, f"{self.name} cannot turn without a collision")
        speed = math.sqrt(2.0 * parameters.acc_lim_theta * left)
        speed = max(speed, parameters.min_in_place_vel_theta)
        return Advance(Twist2(0.0, 0.0, min(speed, parameters.max_vel_theta)), False)

    def _left(self) -> float:
        """Return how far there is to turn [rad]."""
        if self._halfway:
            return self._away(self._begun)
        away = self._away(self._begun + math.pi)
        if away < self._parameters.yaw_goal_tolerance:
            self._halfway = True
        return math.pi + away

    def _away(self, heading: float) -> float:
        return abs(wrap_angle(heading - self._heading))
