"""Parameters of navfn with the names and defaults of Noetic."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from pydantic import ConfigDict
from pydantic.dataclasses import dataclass

from daemon.stacks.ros1.parameters import NotNegative, Section


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
