"""What move_base tries before it gives a goal up.

Resets clear layers of the costmaps outside a square around the robot, at once; with the parameters
people have they clear nothing (:attr:`Quirks.resets_clear_nothing`). The turn on the
spot takes its time: it commands at its own rate until the robot has turned once, and blocks the
control loop meanwhile.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from daemon.model.kernels import kernel
from daemon.stacks.ros1.base_local_planner import footprint_cost
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
from grammars.model.geometry import Floats, Pose2, Twist2, wrap_angle

_CIRCUMSCRIBED: Final = 0.46
"""What the aggressive reset takes for the radius of the robot [m], a quarter of its square."""


@dataclass(frozen=True, slots=True)
class RobotPoses:
    """Where the base is, in the frames of the local and of the global costmap."""

    local: Pose2
    global_: Pose2


@dataclass(frozen=True, slots=True)
class RecoveryStep:
    """How a recovery goes on: a command to publish, whether it has ended, what to say."""

    command: Twist2 | None
    ended: bool
    log: str = ""


class Recovery(Protocol):
    """A behaviour: ``start`` and then ``step`` until it has ended; ``period`` [s] between."""

    @property
    def name(self) -> str:
        """Its name in the log."""

    @property
    def period(self) -> float:
        """Seconds between two steps."""

    def start(self, around: RobotPoses) -> None:
        """Begin."""

    def step(self, around: RobotPoses) -> RecoveryStep:
        """Go on."""


class ClearLayers(Protocol):
    """Makes layers of a costmap forget; returns the names of those that had something to forget."""

    def __call__(
        self, base: Pose2, side: float, names: Collection[str] | None, *, inside: bool
    ) -> tuple[str, ...]:
        """Clear those called as ``names`` say, or without names all that lasers fill.

        Outside (or ``inside``) a square of ``side`` [m] around ``base`` in the costmap's frame.
        """


@dataclass(frozen=True, slots=True)
class ClearTarget:
    """A costmap that a reset may clear, and may ``update`` at once."""

    clear: ClearLayers
    update: Callable[[], None]


@dataclass(frozen=True, slots=True)
class ClearTargets:
    """The two costmaps a reset may clear."""

    global_: ClearTarget
    local: ClearTarget


class ClearCostmapRecovery:
    """Clears named layers outside (or inside) a square of ``distance`` [m] around the robot.

    Without :attr:`Quirks.resets_clear_nothing` it clears all layers that lasers fill where it finds
    none of those named.
    """

    period = 0.0

    def __init__(
        self,
        name: str,
        parameters: ClearCostmapParameters,
        distance: float,
        quirks: Quirks,
        targets: ClearTargets,
    ) -> None:
        self.name = name
        self._distance, self._parameters, self._targets = distance, parameters, targets
        self._names = frozenset(parameters.layer_names)
        self._finds_any = not quirks.resets_clear_nothing

    def start(self, around: RobotPoses) -> None:
        """Nothing to prepare."""

    def step(self, around: RobotPoses) -> RecoveryStep:
        """Clear, and be done."""
        maps, cleared = self._parameters.affected_maps, []
        if maps in ("both", "global") and self._clear(self._targets.global_, around.global_):
            cleared.append("global")
        if maps in ("both", "local") and self._clear(self._targets.local, around.local):
            cleared.append("local")
        if not cleared:
            return RecoveryStep(None, True, f"{self.name} finds no layer to clear")
        where = "inside" if self._parameters.invert_area_to_clear else "outside"
        what = f"the {' and '.join(cleared)} costmap {where} a square of {self._distance:.2f} m"
        return RecoveryStep(None, True, f"{self.name} cleared {what}")

    def _clear(self, target: ClearTarget, base: Pose2) -> bool:
        """Clear one costmap; tell whether it had a layer to clear."""
        inside = self._parameters.invert_area_to_clear
        cleared = target.clear(base, self._distance, self._names, inside=inside)
        if not cleared and self._finds_any:
            cleared = target.clear(base, self._distance, None, inside=inside)
        if self._parameters.force_updating:
            target.update()
        return bool(cleared)


def make_recoveries(
    parameters: MoveBaseParameters,
    rotate: RotateRecoveryParameters,
    resets: Mapping[str, ClearCostmapParameters],
    quirks: Quirks,
    footprint: Floats,
    local: CostGrid,
    targets: ClearTargets,
) -> tuple[Recovery, ...]:
    """Return the behaviours in the order they are tried, none when they are disabled."""
    if not parameters.recovery_behavior_enabled:
        return ()
    distances = {
        "conservative_reset": parameters.conservative_reset_dist,
        "aggressive_reset": 4.0 * _CIRCUMSCRIBED,
    }
    chosen = parameters.recovery_behaviors
    if chosen is None:
        chosen = _default_behaviors(turning=parameters.clearing_rotation_allowed)
    else:
        distances = {}
    made: list[Recovery] = []
    for behavior in chosen:
        if behavior.type == ROTATE:
            made.append(RotateRecovery(behavior.name, rotate, quirks, footprint, local))
            continue
        own = resets.get(behavior.name, ClearCostmapParameters())
        distance = distances.get(behavior.name, own.reset_distance)
        made.append(ClearCostmapRecovery(behavior.name, own, distance, quirks, targets))
    return tuple(made)


def _default_behaviors(*, turning: bool) -> tuple[RecoveryBehavior, ...]:
    turn = (RecoveryBehavior("rotate_recovery", ROTATE),) if turning else ()
    first = RecoveryBehavior("conservative_reset", CLEAR)
    last = RecoveryBehavior("aggressive_reset", CLEAR)
    return (first, *turn, last, *turn)


@kernel
def turn_is_free(
    cells: npt.NDArray[np.uint8],
    frame: Floats,
    footprint: Floats,
    pose: Floats,
    angle: float,
    granularity: float,
) -> bool:
    """Tell whether the outline of ``footprint`` (k, 2) stays free while it turns left by ``angle``.

    ``frame`` is x, y of the grid's lower left corner and its resolution [m], ``pose`` x, y, yaw.
    It is looked at every ``granularity`` [rad], at the end itself only by chance; what lies inside
    the outline does not count (rotate_recovery, ``CostmapModel::footprintCost``).
    """
    nothing = np.empty((0, 2), dtype=np.int32)
    here = np.empty(5)
    here[0], here[1] = pose[0], pose[1]
    turned = 0.0
    while turned < angle:
        here[2] = pose[2] + turned
        here[3], here[4] = math.cos(here[2]), math.sin(here[2])
        if footprint_cost(cells, frame, footprint, 1.0, here, nothing, False) < 0:
            return False
        turned += granularity
    return True


class RotateRecovery:
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

    def start(self, around: RobotPoses) -> None:
        """Remember the heading to come back to."""
        self._begun = self._heading = around.local.yaw
        self._halfway = False

    def step(self, around: RobotPoses) -> RecoveryStep:
        """Command the next piece of the turn; the heading of the last step decides on the end."""
        parameters = self._parameters
        if self._halfway and self._away(self._begun) <= parameters.yaw_goal_tolerance:
            return RecoveryStep(self._at_the_end, True, f"{self.name} has turned once")
        pose = around.local
        self._heading = pose.yaw
        left = self._left()
        grid = self._local
        frame, here = (grid.x, grid.y, grid.resolution), (pose.x, pose.y, pose.yaw)
        if not turn_is_free(
            grid.cells, np.array(frame), self._footprint, np.array(here), left,
            parameters.sim_granularity,
        ):  # fmt: skip
            return RecoveryStep(
                self._at_the_end, True, f"{self.name} cannot turn without a collision"
            )
        speed = math.sqrt(2.0 * parameters.acc_lim_theta * left)
        speed = max(speed, parameters.min_in_place_vel_theta)
        return RecoveryStep(Twist2(0.0, 0.0, min(speed, parameters.max_vel_theta)), False)

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


def warm_up() -> None:
    """Turn a square on an empty costmap."""
    cells = np.zeros((20, 20), np.uint8)
    ring = np.array([(-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)])
    turn_is_free(cells, np.array((0.0, 0.0, 0.05)), ring, np.full(3, 0.5), 0.1, 0.017)
