"""Parameters of navfn and of global_planner with the names and defaults of Noetic."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Final, Literal, TypeAlias

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

from daemon.stacks.ros1.parameters import Finite, NotNegative, Section, refuse

_Byte: TypeAlias = Annotated[int, Field(ge=1, le=255)]

FORWARD: Final = 1
"""Orientation mode in which points look along the path."""


@dataclass(frozen=True, slots=True, config=ConfigDict(extra="forbid", strict=True))
class NavfnParameters(Section):
    """Parameters under ``NavfnROS``."""

    allow_unknown: bool = True
    """A path may lead through cells that are unknown in the global costmap."""
    default_tolerance: NotNegative = 0.0
    """[m] A path may end this far from the goal in x and in y; 0 requires the goal's own cell."""
    visualize_potential: bool = False
    """Publish the potential as a point cloud."""
    planner_window_x: float = 0.0
    """[m] Size of a window around the robot to plan in; the original reads and ignores it."""
    planner_window_y: float = 0.0
    """[m] The same in y."""

    without_effect: ClassVar[Mapping[str, str]] = {
        "visualize_potential": "nothing is published while a run lasts",
        "planner_window_x": "NavfnROS reads it and never uses it",
        "planner_window_y": "NavfnROS reads it and never uses it",
    }


@dataclass(frozen=True, slots=True, config=ConfigDict(extra="forbid", strict=True))
class GlobalPlannerParameters(Section):
    """Parameters under ``GlobalPlanner``.

    Source: ``planner_core.cpp`` and ``GlobalPlanner.cfg`` of global_planner, Noetic.
    """

    old_navfn_behavior: bool = False
    """Start and goal are the corners of their cells, as in navfn; otherwise they are exact."""
    use_quadratic: Annotated[
        Literal[True], refuse((False,), "plain potentials are not built in: write true")
    ] = True
    """Interpolate potentials between two neighbours."""
    use_dijkstra: Annotated[Literal[True], refuse((False,), "A* is not built in: write true")] = (
        True
    )
    """Expand in all directions until the goal is reached."""
    use_grid_path: Annotated[
        Literal[False], refuse((True,), "paths from cell to cell are not built in: write false")
    ] = False
    """Trace the path back along the gradient, half a cell a step."""
    allow_unknown: bool = True
    """A path may lead through cells that are unknown in the global costmap."""
    outline_map: bool = True
    """Plan as if the outermost cells of the costmap were obstacles."""
    lethal_cost: Annotated[int, Field(ge=2, le=255)] = 253
    """Costs of at least this minus one block a cell; 1 would block all cells."""
    neutral_cost: _Byte = 50
    """Cost of crossing a free cell."""
    cost_factor: Annotated[float, Field(ge=0.01, le=5.0, allow_inf_nan=False)] = 3.0
    """Factor on the costs of the costmap."""
    orientation_mode: Annotated[
        Literal[0, 1],
        refuse((2, 3, 4, 5, 6), "only 0 (no yaws) and 1 (points look forward) are built in"),
    ] = FORWARD
    """Yaw of the plan's points: 0 none, 1 forward."""
    orientation_window_size: _Byte = 1
    """Number of points before and after a point that give the direction of the path there."""
    default_tolerance: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] = 0.0
    """[m] Tolerance of the goal; the original reads and ignores it."""
    publish_potential: bool = True
    """Publish the potential as a map."""
    publish_scale: int = 100
    """Scale of the published potential."""
    planner_window_x: Finite = 0.0
    """[m] Size of a window around the robot to plan in; the original reads and ignores it."""
    planner_window_y: Finite = 0.0
    """[m] The same in y."""

    without_effect: ClassVar[Mapping[str, str]] = {
        "default_tolerance": (
            "GlobalPlanner reads it and never uses it: the cell of the goal itself must be "
            "reachable"
        ),
        "planner_costmap_publish_frequency": "GlobalPlanner of Noetic does not read it any more",
        "planner_window_x": "GlobalPlanner reads it and never uses it",
        "planner_window_y": "GlobalPlanner reads it and never uses it",
        "publish_potential": "nothing is published while a run lasts",
        "publish_scale": "nothing is published while a run lasts",
        "visualize_potential": "GlobalPlanner does not know it; navfn does",
    }
