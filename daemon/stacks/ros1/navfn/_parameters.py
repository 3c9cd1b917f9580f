"""Parameters of navfn and of global_planner with the names and defaults of Noetic.

Source of the latter: ``planner_core.cpp`` and ``GlobalPlanner.cfg`` of global_planner.
"""

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
    """Paths may lead through unknown cells."""
    default_tolerance: NotNegative = 0.0
    """[m] A path may end this far from the goal in x and y."""
    visualize_potential: bool = False
    """Publish the potential as a point cloud."""
    planner_window_x: float = 0.0
    """[m] Size of a window around the robot to plan in; the original reads and ignores it."""
    planner_window_y: float = 0.0
    """[m] The same in y."""

    without_effect: ClassVar[Mapping[str, str]] = {
        "visualize_potential": "only for display",
        "planner_window_x": "read, but never used",
        "planner_window_y": "read, but never used",
    }


@dataclass(frozen=True, slots=True, config=ConfigDict(extra="forbid", strict=True))
class GlobalPlannerParameters(Section):
    """Parameters under ``GlobalPlanner``."""

    old_navfn_behavior: bool = False
    """Start and goal are the corners of their cells, as in navfn, instead of exact."""
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
    """Follow the grid instead of the gradient."""
    allow_unknown: bool = True
    """Paths may lead through unknown cells."""
    outline_map: bool = True
    """Plan as if the outermost cells of the costmap were obstacles."""
    lethal_cost: Annotated[int, Field(ge=2, le=255)] = 253
    """Cells of at least this cost minus one are blocked."""
    neutral_cost: _Byte = 50
    """Cost of crossing a free cell."""
    cost_factor: Annotated[float, Field(ge=0.01, le=5.0, allow_inf_nan=False)] = 3.0
    """Factor on the costs of the costmap."""
    orientation_mode: Annotated[
        Literal[0, 1],
        refuse((2, 3, 4, 5, 6), "only 0 (no yaws) and 1 (points look forward) are built in"),
    ] = FORWARD
    """Yaws of the plan: 0 none, 1 forward."""
    orientation_window_size: _Byte = 1
    """Points before and after a point that give its direction."""
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
        "default_tolerance": "never used: the cell of the goal must be reachable",
        "planner_costmap_publish_frequency": "Noetic does not read it any more",
        "planner_window_x": "read, but never used",
        "planner_window_y": "read, but never used",
        "publish_potential": "only for display",
        "publish_scale": "only for display",
        "visualize_potential": "only navfn knows it",
    }
