"""move_base: goals, plans and commands in the order and at the rates of the original.

The control loop and the planner thread share a :class:`Status`; time stands still while either
works, and :mod:`daemon.navigation.ros._stack` says who goes first within one instant.
"""

from __future__ import annotations

from daemon.navigation.ros.move_base._control import Controller, MoveBase
from daemon.navigation.ros.move_base._dispatcher import Dispatcher
from daemon.navigation.ros.move_base._parameters import (
    CLEAR,
    CLEAR_COSTMAP_WITHOUT_EFFECT,
    MOVE_BASE_WITHOUT_EFFECT,
    OTHER_NAMES,
    ROTATE,
    ClearCostmapParameters,
    DispatcherParameters,
    MoveBaseParameters,
    RecoveryBehavior,
    RotateRecoveryParameters,
)
from daemon.navigation.ros.move_base._planning import PlannerThread
from daemon.navigation.ros.move_base._recoveries import (
    Advance,
    Around,
    ClearTarget,
    ClearTargets,
    Recovery,
    Reset,
    make_recoveries,
)
from daemon.navigation.ros.move_base._status import State, Status, Trigger
from daemon.navigation.ros.move_base._transforms import TransformBuffer

__all__ = [
    "CLEAR",
    "CLEAR_COSTMAP_WITHOUT_EFFECT",
    "MOVE_BASE_WITHOUT_EFFECT",
    "OTHER_NAMES",
    "ROTATE",
    "Advance",
    "Around",
    "ClearCostmapParameters",
    "ClearTarget",
    "ClearTargets",
    "Controller",
    "Dispatcher",
    "DispatcherParameters",
    "MoveBase",
    "MoveBaseParameters",
    "PlannerThread",
    "Recovery",
    "RecoveryBehavior",
    "Reset",
    "RotateRecoveryParameters",
    "State",
    "Status",
    "TransformBuffer",
    "Trigger",
    "make_recoveries",
    "warm_up",
]


def warm_up() -> None:
    """Compile or load every kernel once, so that forked children start without compiling."""
    from daemon.navigation.ros.move_base._warmup import warm_up as run

    run()
