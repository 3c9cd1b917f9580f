"""move_base: goals, plans and commands in the order and at the rates of the original.

The control loop and the planner thread share a ``MoveBaseStatus`` (:mod:`.control`). Time stands
still while either works; :mod:`daemon.stacks.ros1.stack` defines their order within one instant.
This package exports parameters only, so that checking them loads no compiler.
"""

from daemon.stacks.ros1.move_base._parameters import (
    CLEAR,
    OTHER_NAMES,
    ROTATE,
    ClearCostmapParameters,
    DispatcherParameters,
    MoveBaseParameters,
    RotateRecoveryParameters,
)

__all__ = [
    "CLEAR",
    "OTHER_NAMES",
    "ROTATE",
    "ClearCostmapParameters",
    "DispatcherParameters",
    "MoveBaseParameters",
    "RotateRecoveryParameters",
]
