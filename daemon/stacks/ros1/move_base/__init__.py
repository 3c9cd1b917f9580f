"""move_base: goals, plans and commands in the order and at the rates of the original.

The control loop and the planner thread share a :class:`MoveBaseStatus`; time stands still while
either works, and :mod:`daemon.stacks.ros1.stack` says who goes first within one instant.
"""

from daemon.stacks.ros1.move_base._control import (
    Controller,
    MoveBase,
    MoveBaseState,
    MoveBaseStatus,
    PlannerThread,
    RecoveryTrigger,
)
from daemon.stacks.ros1.move_base._dispatcher import WaypointDispatcher
from daemon.stacks.ros1.move_base._parameters import (
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
from daemon.stacks.ros1.move_base._recoveries import (
    ClearCostmapRecovery,
    ClearLayers,
    ClearTarget,
    ClearTargets,
    Recovery,
    RecoveryStep,
    RobotPoses,
    make_recoveries,
    turn_is_free,
    warm_up,
)
from daemon.stacks.ros1.move_base._transforms import TransformBuffer

__all__ = [
    "CLEAR",
    "CLEAR_COSTMAP_WITHOUT_EFFECT",
    "MOVE_BASE_WITHOUT_EFFECT",
    "OTHER_NAMES",
    "ROTATE",
    "ClearCostmapParameters",
    "ClearCostmapRecovery",
    "ClearLayers",
    "ClearTarget",
    "ClearTargets",
    "Controller",
    "DispatcherParameters",
    "MoveBase",
    "MoveBaseParameters",
    "MoveBaseState",
    "MoveBaseStatus",
    "PlannerThread",
    "Recovery",
    "RecoveryBehavior",
    "RecoveryStep",
    "RecoveryTrigger",
    "RobotPoses",
    "RotateRecoveryParameters",
    "TransformBuffer",
    "WaypointDispatcher",
    "make_recoveries",
    "turn_is_free",
    "warm_up",
]
