"""Recoveries that move_base tries before it aborts a goal.

Resets clear layers of the costmaps outside a square around the robot, in no time. With common
parameters they clear nothing (:attr:`Quirks.resets_clear_nothing`). The turn on the spot takes
time: it commands at its own rate until the robot has turned once, and blocks the control loop.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from daemon.stacks.ros1.base_local_planner.footprint import footprint_cost
from daemon.stacks.ros1.cost_grid import CostGrid
from daemon.stacks.ros1.move_base._parameters import (
    CLEAR,
    ROTATE,
    ClearCostmapParameters,
    MoveBaseParameters,
    RecoveryBehavior,
    RotateRecoveryParameters,
)
from daemon.stacks.ros1.quirks import Quirks
from daemon.stacks.ros1.scan_buffer import ObservedCostmap
from grammars.model.geometry import Floats, Pose2, Twist2, wrap_angle

_CIRCUMSCRIBED: Final = 0.46
"""Radius of the robot for the aggressive reset [m], a quarter of its square."""


@dataclass(frozen=True, slots=True)
class RecoveryStep:
    """Step of a recovery: a command to publish, whether it has ended, a sentence for the log."""

    command: Twist2 | None
    ended: bool
    log: str = ""


class ClearCostmapRecovery:
    """Reset of named layers outside (or inside) a square of ``distance`` [m] around the robot.

    Without :attr:`Quirks.resets_clear_nothing` it clears all layers of lasers if none has the
    right name.
    """

    period = 0.0

    def __init__(
        self,
        name: str,
        parameters: ClearCostmapParameters,
        distance: float,
        quirks: Quirks,
        global_costmap: ObservedCostmap,
        local_costmap: ObservedCostmap,
    ) -> None:
        self.name = name
        self._parameters, self._distance = parameters, distance
        self._costmaps = {"global": global_costmap, "local": local_costmap}
        self._names = frozenset(parameters.layer_names)
        self._finds_any = not quirks.resets_clear_nothing

    def start(self) -> None:
        """Nothing to prepare."""

    def step(self) -> RecoveryStep:
        """Clear the layers and end."""
        maps = self._parameters.affected_maps
        cleared = [
            name
            for name, costmap in self._costmaps.items()
            if maps in ("both", name) and self._clear(costmap)
        ]
        if not cleared:
            return RecoveryStep(None, True, f"{self.name} finds no layer to clear")
        where = "inside" if self._parameters.invert_area_to_clear else "outside"
        what = f"the {' and '.join(cleared)} costmap {where} a square of {self._distance:.2f} m"
        return RecoveryStep(None, True, f"{self.name} cleared {what}")

    def _clear(self, observed: ObservedCostmap) -> bool:
        """Clear one costmap; tell whether it had a layer to clear."""
        costmap, base = observed.costmap, observed.frame.base
        inside = self._parameters.invert_area_to_clear
        cleared = costmap.clear_layers(base, self._distance, self._names, inside=inside)
        if not cleared and self._finds_any:
            cleared = costmap.clear_layers(base, self._distance, None, inside=inside)
        if self._parameters.force_updating:
            observed.update()
        return bool(cleared)


def turn_is_free(
    grid: CostGrid, footprint: Floats, pose: Pose2, angle: float, granularity: float
) -> bool:
    """Tell whether the outline of ``footprint`` (k, 2) stays free while it turns left by ``angle``.

    The check is every ``granularity`` [rad], so at the end only by chance. Cells inside the
    outline do not count (rotate_recovery, ``CostmapModel::footprintCost``).
    """
    # No kernel: this takes half a millisecond at 20 Hz, and only while a robot turns.
    frame = np.array((grid.x, grid.y, grid.resolution))
    no_spans = np.empty((0, 2), dtype=np.int32)
    turned = 0.0
    while turned < angle:
        yaw = pose.yaw + turned
        here = np.array((pose.x, pose.y, yaw, math.cos(yaw), math.sin(yaw)))
        if footprint_cost(grid.cells, frame, footprint, 1.0, here, no_spans) < 0:
            return False
        turned += granularity
    return True


class RotateRecovery:
    """Full turn to the left, back to the initial heading (``RotateRecovery``).

    Before each command the rest of the turn must be free of collisions in the local costmap,
    checked every ``sim_granularity``. The last command stays after the end, unless
    :attr:`Quirks.turn_ends_unstopped` is off.
    """

    def __init__(
        self,
        name: str,
        parameters: RotateRecoveryParameters,
        quirks: Quirks,
        footprint: Floats,
        local_costmap: ObservedCostmap,
    ) -> None:
        self.name = name
        self.period = 1.0 / parameters.frequency
        self._parameters, self._footprint, self._local = parameters, footprint, local_costmap
        self._at_the_end = None if quirks.turn_ends_unstopped else Twist2()
        self._initial = self._heading = 0.0
        self._halfway = False

    def start(self) -> None:
        """Remember the heading to return to."""
        self._initial = self._heading = self._local.frame.base.yaw
        self._halfway = False

    def step(self) -> RecoveryStep:
        """Command the next part of the turn; the heading of the last step decides about the end."""
        parameters = self._parameters
        if self._halfway and self._away(self._initial) <= parameters.yaw_goal_tolerance:
            return RecoveryStep(self._at_the_end, True, f"{self.name} has turned once")
        pose = self._local.frame.base
        self._heading = pose.yaw
        angle = self._remaining()
        grid, granularity = self._local.costmap.grid, parameters.sim_granularity
        if not turn_is_free(grid, self._footprint, pose, angle, granularity):
            return RecoveryStep(
                self._at_the_end, True, f"{self.name} cannot turn without a collision"
            )
        speed = math.sqrt(2.0 * parameters.acc_lim_theta * angle)
        speed = max(speed, parameters.min_in_place_vel_theta)
        return RecoveryStep(Twist2(0.0, 0.0, min(speed, parameters.max_vel_theta)), False)

    def _remaining(self) -> float:
        """Return the remaining turn [rad]."""
        if self._halfway:
            return self._away(self._initial)
        away = self._away(self._initial + math.pi)
        if away < self._parameters.yaw_goal_tolerance:
            self._halfway = True
        return math.pi + away

    def _away(self, heading: float) -> float:
        return abs(wrap_angle(heading - self._heading))


Recovery: TypeAlias = ClearCostmapRecovery | RotateRecovery
"""A behaviour: ``start``, and then ``step`` every ``period`` [s] until it has ended."""


def make_recoveries(
    parameters: MoveBaseParameters,
    rotate: RotateRecoveryParameters,
    resets: Mapping[str, ClearCostmapParameters],
    quirks: Quirks,
    footprint: Floats,
    global_costmap: ObservedCostmap,
    local_costmap: ObservedCostmap,
) -> tuple[Recovery, ...]:
    """Return the behaviours in their order, an empty tuple if they are disabled."""
    if not parameters.recovery_behavior_enabled:
        return ()
    distances = {}
    behaviors = parameters.recovery_behaviors
    if behaviors is None:
        behaviors = _default_behaviors(turning=parameters.clearing_rotation_allowed)
        distances = {
            "conservative_reset": parameters.conservative_reset_dist,
            "aggressive_reset": 4.0 * _CIRCUMSCRIBED,
        }
    recoveries: list[Recovery] = []
    for name, kind in ((behavior.name, behavior.type) for behavior in behaviors):
        if kind == ROTATE:
            recoveries.append(RotateRecovery(name, rotate, quirks, footprint, local_costmap))
            continue
        own = resets.get(name, ClearCostmapParameters())
        distance = distances.get(name, own.reset_distance)
        recoveries.append(
            ClearCostmapRecovery(name, own, distance, quirks, global_costmap, local_costmap)
        )
    return tuple(recoveries)


def _default_behaviors(*, turning: bool) -> tuple[RecoveryBehavior, ...]:
    turn = (RecoveryBehavior("rotate_recovery", ROTATE),) if turning else ()
    first = RecoveryBehavior("conservative_reset", CLEAR)
    last = RecoveryBehavior("aggressive_reset", CLEAR)
    return (first, *turn, last, *turn)
