"""Global planner of the stack with the interface of GlobalPlanner."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from daemon.model.kernels import kernel
from daemon.stacks.kernels import Singles
from daemon.stacks.ros1.cost_grid import NO_INFORMATION, CostGrid
from daemon.stacks.ros1.global_planner._parameters import FORWARD, GlobalPlannerParameters
from daemon.stacks.ros1.navfn.descent import path_to_poses
from daemon.stacks.ros1.navfn.field import (
    MARGINS,
    WORTHWHILE,
    Cell,
    FieldRules,
    Point,
    PotentialField,
    free_cell,
)
from daemon.stacks.ros1.navfn.propagation import PENDING, CellCosts, cell_costs
from daemon.stacks.ros1.quirks import Quirks
from grammars.model.geometry import Floats, Pose2

_NEUTRAL_COSTS: Final = range(30, 101)
"""Neutral costs for which the margins of navfn, made for 50, are wide enough and useful."""


def planner_costs(parameters: GlobalPlannerParameters) -> CellCosts:
    """Return the costs of cells; the state of a cell is its costmap value (``getCost``)."""
    p, values = parameters, np.arange(PENDING)
    blocked = values >= p.lethal_cost - 1
    if p.allow_unknown:
        blocked[NO_INFORMATION] = False
    costs = values.astype(np.float32) * np.float32(p.cost_factor) + np.float32(p.neutral_cost)
    costs[costs >= p.lethal_cost] = p.lethal_cost - 1
    return cell_costs(values.astype(np.uint16), costs, blocked)


def potential_field(
    grid: CostGrid,
    parameters: GlobalPlannerParameters,
    quirks: Quirks,
    *,
    margins: tuple[float, ...] = MARGINS,
    worthwhile: int = WORTHWHILE,
) -> PotentialField:
    """Return a field over a costmap for GlobalPlanner.

    The ``margins`` restrict waves if they are wide enough.
    """
    p, goal_costs = parameters, None
    if not p.old_navfn_behavior:
        costs = np.arange(PENDING) + p.neutral_cost
        # A cost is one byte: in the original 256 is 0.
        wraps = quirks.global_planner_costs_wrap
        goal_costs = (costs & 255 if wraps else np.minimum(costs, 255)).astype(np.float32)
    rules = FieldRules(
        planner_costs(p),
        np.float32(p.lethal_cost),
        outline=p.outline_map,
        as_navfn=False,
        neutral=p.neutral_cost,
        goal_costs=goal_costs,
    )
    is_guided = p.outline_map and p.neutral_cost in _NEUTRAL_COSTS
    return PotentialField(grid, rules, margins=margins if is_guided else (), worthwhile=worthwhile)


class GlobalPlanner:
    """GlobalPlanner on a global costmap; ``quirks`` selects its oddities.

    The original also draws its outline into the costmap. Here only the planner has it: the costmap
    would merely inflate it when an update comes near the border.
    """

    def __init__(self, parameters: GlobalPlannerParameters, quirks: Quirks) -> None:
        self._parameters, self._quirks = parameters, quirks
        self._field: PotentialField | None = None

    def plan(self, grid: CostGrid, start: Pose2, goal: Pose2) -> Floats | None:
        """Return x, y, yaw from ``start`` to ``goal`` in the grid's frame, (n, 3), or ``None``.

        The last point is the goal; yaws are those of ``orientation_mode``. There is no plan from
        or to a point off the grid, nor if the expansion or the descent fails.
        """
        here, there = grid.cell(start.x, start.y), grid.cell(goal.x, goal.y)
        if here is None or there is None:
            return None
        freed = None if self._quirks.planner_frees_start_cell else here
        if freed is None:
            free_cell(grid, here)
        begin, end = self._point(grid, here, start), self._point(grid, there, goal)
        path = self._field_of(grid).path(begin, end, there, freed)
        if len(path) == 0:
            return None
        return self._poses(grid, path, goal)

    def _point(self, grid: CostGrid, cell: Cell, pose: Pose2) -> Point:
        if self._parameters.old_navfn_behavior:
            return float(cell[0]), float(cell[1])
        return (pose.x - grid.x) / grid.resolution - 0.5, (pose.y - grid.y) / grid.resolution - 0.5

    def _field_of(self, grid: CostGrid) -> PotentialField:
        field = self._field
        if field is None or not field.sees(grid):
            field = self._field = potential_field(grid, self._parameters, self._quirks)
        return field

    def _poses(self, grid: CostGrid, path: Singles, goal: Pose2) -> Floats:
        """Reverse a path from the goal, in cells, transform it into the grid's frame, add yaws."""
        parameters, quirks = self._parameters, self._quirks
        old = parameters.old_navfn_behavior
        count = len(path)
        poses = np.empty((count + (2 if old and quirks.global_planner_repeats_goal else 1), 3))
        path_to_poses(path, 0.0 if old else 0.5, grid.resolution, grid.x, grid.y, poses)
        poses[count:] = goal.x, goal.y, goal.yaw
        if parameters.orientation_mode == FORWARD:
            look_forward(poses, parameters.orientation_window_size)
        return poses


@kernel
def _through_quaternion(yaw: float) -> float:
    """Return a yaw after conversion to a quaternion and back (tf2 ``setRPY``, ``getYaw``)."""
    z, w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    return math.atan2(2.0 * (w * z), w * w - z * z)


@kernel
def look_forward(poses: Floats, window: int) -> None:
    """Set the yaws of ``poses`` (n, 3) along the path, except for the last one, the goal.

    A yaw is the direction from ``window`` points before to as many behind (``OrientationFilter``).
    It goes through a quaternion as in the original, because the last bit decides about the sign of
    a half turn.
    """
    last = poses.shape[0] - 1
    for i in range(last):
        a, b = max(0, i - window), min(last, i + window)
        dx, dy = poses[b, 0] - poses[a, 0], poses[b, 1] - poses[a, 1]
        poses[i, 2] = _through_quaternion(math.atan2(dy, dx))
