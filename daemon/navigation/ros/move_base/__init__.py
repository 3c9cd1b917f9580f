"""move_base: goals, plans and commands in the order and at the rates of the original.

The control loop and the planner thread share a :class:`Status`; time stands still while either
works, and :mod:`daemon.navigation.ros._stack` says who goes first within one instant.
"""

from __future__ import annotations

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

__all__ = [
    "CLEAR",
    "CLEAR_COSTMAP_WITHOUT_EFFECT",
    "MOVE_BASE_WITHOUT_EFFECT",
    "OTHER_NAMES",
    "ROTATE",
    "ClearCostmapParameters",
    "DispatcherParameters",
    "MoveBaseParameters",
    "RecoveryBehavior",
    "RotateRecoveryParameters",
]
