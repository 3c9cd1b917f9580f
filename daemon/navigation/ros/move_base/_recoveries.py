"""What move_base tries before it gives a goal up.

Resets clear obstacle layers of the costmaps outside a square around the robot, at once; with the
parameters people have they clear nothing (:attr:`Quirks.resets_clear_nothing`). The turn on the
spot takes its time: it commands at its own rate until the robot has turned once, and blocks the
control loop meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, Protocol

from daemon.navigation.ros.grids import CostGrid
from daemon.navigation.ros.move_base._parameters import (
    CLEAR,
    ROTATE,
    ClearCostmapParameters,
    MoveBaseParameters,
    RecoveryBehavior,
    RotateRecoveryParameters,
)
from daemon.navigation.ros.quirks import Quirks
from grammars.values import Floats, Pose2, Twist2

_CIRCUMSCRIBED: Final = 0.46
"""What the aggressive reset takes for the radius of the robot [m], a quarter of its square."""


@dataclass(frozen=True, slots=True)
class Around:
    """Where the robot is when a recovery looks: the base in odom and in map (delayed)."""

    odom: Pose2
    map: Pose2


@dataclass(frozen=True, slots=True)
class Advance:
    """How a recovery goes on: a command to publish, whether it has ended, what to say."""

    command: Twist2 | None
    ended: bool
    say: str = ""


class Recovery(Protocol):
    """A behaviour: ``start`` and then ``step`` until it has ended; ``period`` [s] between."""

    @property
    def name(self) -> str:
        """Its name in the log."""

    @property
    def period(self) -> float:
        """Seconds between two steps."""

    def start(self, around: Around) -> None:
        """Begin."""

    def step(self, around: Around) -> Advance:
        """Go on."""


@dataclass(frozen=True, slots=True)
class ClearTarget:
    """How one costmap is cleared of obstacles outside a square.

    ``layer`` is the name of its obstacle layer; ``clear`` takes the pose of the base in the
    costmap's frame and the side of the square [m].
    """

    layer: str
    clear: Callable[[Pose2, float], None]


@dataclass(frozen=True, slots=True)
class ClearTargets:
    """The two costmaps a reset may clear."""

    global_: ClearTarget
    local: ClearTarget


class Reset:
    """Clears obstacles outside a square of ``distance`` [m] around the robot, or nothing.

    With :attr:`Quirks.resets_clear_nothing` it works only where a layer is called as its
    ``layer_names`` say.
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
        self._distance, self._maps = distance, parameters.affected_maps
        named = frozenset(parameters.layer_names)
        works = not quirks.resets_clear_nothing
        self._global = targets.global_ if works or targets.global_.layer in named else None
        self._local = targets.local if works or targets.local.layer in named else None

    def start(self, around: Around) -> None:
        """Nothing to prepare."""

    def step(self, around: Around) -> Advance:
        """Clear, and be done."""
        cleared = []
        if self._global is not None and self._maps in ("both", "global"):
            self._global.clear(around.map, self._distance)
            cleared.append("global")
        if self._local is not None and self._maps in ("both", "local"):
            self._local.clear(around.odom, self._distance)
            cleared.append("local")
        if not cleared:
            return Advance(None, True, f"{self.name} finds no layer to clear")
        maps = " and ".join(cleared)
        what = f"the {maps} costmap outside a square of {self._distance:.2f} m"
        return Advance(None, True, f"{self.name} cleared {what}")


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
    # Compiled kernels are only needed to drive, not to check parameters.
    from daemon.navigation.ros.move_base._rotation import Rotate

    if not parameters.recovery_behavior_enabled:
        return ()
    distances = {
        "conservative_reset": parameters.conservative_reset_dist,
        "aggressive_reset": 4.0 * _CIRCUMSCRIBED,
    }
    chosen = parameters.recovery_behaviors
    if chosen is None:
        chosen = _defaults(turning=parameters.clearing_rotation_allowed)
    else:
        distances = {}
    made: list[Recovery] = []
    for behavior in chosen:
        if behavior.type == ROTATE:
            made.append(Rotate(behavior.name, rotate, quirks, footprint, local))
            continue
        own = resets.get(behavior.name, ClearCostmapParameters())
        distance = distances.get(behavior.name, own.reset_distance)
        made.append(Reset(behavior.name, own, distance, quirks, targets))
    return tuple(made)


def _defaults(*, turning: bool) -> tuple[RecoveryBehavior, ...]:
    turn = (RecoveryBehavior("rotate_recovery", ROTATE),) if turning else ()
    first = RecoveryBehavior("conservative_reset", CLEAR)
    last = RecoveryBehavior("aggressive_reset", CLEAR)
    return (first, *turn, last, *turn)
