"""The parameters of global_planner as ROS names them, with the defaults of Noetic."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Final, TypeAlias

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

from daemon.stacks.ros1.parameters import Finite

_Byte: TypeAlias = Annotated[int, Field(ge=1, le=255)]


@dataclass(frozen=True, slots=True, config=ConfigDict(extra="forbid", strict=True))
class GlobalPlannerParameters:
    """What can be set under ``GlobalPlanner``.

    Source: ``planner_core.cpp`` and ``GlobalPlanner.cfg`` of global_planner, Noetic.
    """

    old_navfn_behavior: bool = False
    """Start and goal are the corners of their cells, as in navfn; otherwise they are exact."""
    use_quadratic: bool = True
    """Interpolate potentials between two neighbours; otherwise a cell adds its cost to the
    lowest of four."""
    use_dijkstra: bool = True
    """Expand in all directions until the goal is reached; otherwise A* towards it."""
    use_grid_path: bool = False
    """Trace the path back from cell to cell; otherwise along the gradient, half a cell a step."""
    allow_unknown: bool = True
    """Whether a path may lead through cells that are unknown in the global costmap."""
    outline_map: bool = True
    """Plan as if the outermost cells of the costmap were obstacles."""
    lethal_cost: _Byte = 253
    """A* does not enter cells of this cost or more, Dijkstra of this cost less one or more."""
    neutral_cost: _Byte = 50
    """Cost of crossing a free cell."""
    cost_factor: Annotated[float, Field(ge=0.01, le=5.0, allow_inf_nan=False)] = 3.0
    """By which Dijkstra multiplies the costs of the costmap; A* does not know it."""
    orientation_mode: Annotated[int, Field(ge=0, le=6)] = 1
    """Yaw of the plan's points: 0 none, 1 forward, 2 interpolated between start and goal, 3
    forward and on the last straight interpolated, 4 backward, 5 leftward, 6 rightward."""
    orientation_window_size: _Byte = 1
    """Points before and after, whose line is the direction of the path at a point."""
    default_tolerance: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] = 0.0
    """[m] Distance from the goal that would do; the original reads and ignores it."""
    publish_potential: bool = True
    """Publish the potential as a map."""
    publish_scale: int = 100
    """Scale of the published potential."""
    planner_window_x: Finite = 0.0
    """[m] Size of a window around the robot to plan in; the original reads and ignores it."""
    planner_window_y: Finite = 0.0
    """[m] The same in y."""


WITHOUT_EFFECT: Final[Mapping[str, str]] = {
    "default_tolerance": (
        "GlobalPlanner reads it and never uses it: the cell of the goal itself must be reachable"
    ),
    "planner_costmap_publish_frequency": "GlobalPlanner of Noetic does not read it any more",
    "planner_window_x": "GlobalPlanner reads it and never uses it",
    "planner_window_y": "GlobalPlanner reads it and never uses it",
    "publish_potential": "nothing is published while a run lasts",
    "publish_scale": "nothing is published while a run lasts",
    "visualize_potential": "GlobalPlanner does not know it; navfn does",
}
"""Names that change nothing here, with the reason."""
