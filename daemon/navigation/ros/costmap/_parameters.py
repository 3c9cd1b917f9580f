"""Parameters of one costmap: the names, defaults and ranges of costmap_2d in ROS Noetic."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Final, TypeAlias

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

from daemon.navigation.ros.costmap._footprint import footprint_of_radius, padded_footprint
from grammars.values import Floats, Point2

_Positive: TypeAlias = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
_NotNegative: TypeAlias = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
_Number: TypeAlias = Annotated[float, Field(allow_inf_nan=False)]
_CONFIG = ConfigDict(extra="forbid")

_DISPLAY: Final = "only for display"
_THREE_VALUES: Final = "the map knows free, occupied and unknown only"
WITHOUT_EFFECT: Final[Mapping[str, str]] = {
    "always_send_full_costmap": _DISPLAY,
    "publish_voxel_map": _DISPLAY,
    "transform_tolerance": "transforms are never late here",
    "robot_base_frame": "there is one robot, with one base frame",
    "map_topic": "there is one map",
    "first_map_only": "the map never changes",
    "subscribe_to_updates": "the map never changes",
    "lethal_cost_threshold": _THREE_VALUES,
    "unknown_cost_value": _THREE_VALUES,
    "trinary_costmap": _THREE_VALUES,
    "use_maximum": "the static layer comes first, over an empty grid",
    "origin_z": "only voxel grids have a height",
    "z_resolution": "only voxel grids have a height",
    "z_voxels": "only voxel grids have a height",
    "mark_threshold": "only for voxel grids",
    "unknown_threshold": "only for voxel grids",
}
"""Parameters of costmap_2d that change nothing here, with the reason."""
SOURCE_WITHOUT_EFFECT: Final[Mapping[str, str]] = {
    "sensor_frame": "the scan says where the laser is",
    "expected_update_rate": "a source that is late does not stop the robot here",
}


@dataclass(frozen=True, slots=True, config=_CONFIG)
class ObservationSource:
    """One entry of ``observation_sources``: a laser that marks and clears."""

    name: str = "scan"
    topic: str = ""
    """As written; the source's name when there is none."""
    data_type: str = "PointCloud"
    """Only a LaserScan brings anything here."""
    marking: bool = True
    """Returns make their cells lethal."""
    clearing: bool = False
    """Rays clear the cells before their returns."""
    obstacle_range: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] | None = None
    """[m] Returns farther than this do not mark; the costmap's own when not given."""
    raytrace_range: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] | None = None
    """[m] Rays clear up to here; the costmap's own when not given."""
    min_obstacle_height: _Number = 0.0
    """[m] A laser mounted lower than this is not heard."""
    max_obstacle_height: _Number = 2.0
    """[m] Nor one mounted higher."""
    inf_is_valid: bool = False
    """Rays without return clear, as if they ended just before the greatest range."""
    observation_persistence: float = 0.0
    """[s] Only the latest scan is kept, so only 0 is taken."""

    def __post_init__(self) -> None:
        if self.observation_persistence != 0.0:
            raise ValueError(
                "observation_persistence must be 0: only the latest scan of a source is kept here"
            )


@dataclass(frozen=True, slots=True, config=_CONFIG)
class CostmapParameters:
    """One costmap with its layers, as costmap_2d reads it without ``plugins`` (pre-Hydro)."""

    global_frame: str = "map"
    """``map`` or ``odom``."""
    update_frequency: _Positive = 5.0
    """[Hz]"""
    publish_frequency: _NotNegative = 0.0
    """[Hz] How often the local costmap is shown in the trace, at most once a second; the global
    one never is."""
    rolling_window: bool = False
    """The grid follows the robot."""
    static_map: bool = False
    """Begin with the map; the grid then has its size, origin and resolution."""
    width: _Positive = 10.0
    """[m] Without the map."""
    height: _Positive = 10.0
    """[m] Without the map."""
    resolution: _Positive = 0.05
    """[m] Without the map."""
    origin_x: _Number = 0.0
    """[m] Without the map."""
    origin_y: _Number = 0.0
    """[m] Without the map."""
    track_unknown_space: bool | None = None
    """Cells nobody has looked at stay unknown; unset is false for all but the static layer."""
    footprint: Annotated[tuple[Point2, ...], Field(min_length=3)] | None = None
    """[m] Corners in the base frame."""
    robot_radius: _Positive = 0.46
    """[m] Without a footprint: a polygon of sixteen corners."""
    footprint_padding: _Number = 0.01
    """[m] Every coordinate of the footprint moves out from zero by this."""
    map_type: str = "costmap"
    """``voxel`` is not supported."""
    obstacle_layer: bool = True
    """Whether there is an obstacle layer."""
    obstacle_layer_name: str = "obstacle_layer"
    """What the reset recoveries would have to call it."""
    inflation_layer: bool = True
    """Whether there is an inflation layer."""
    sources: tuple[ObservationSource, ...] = ()
    """What ``observation_sources`` names."""
    obstacle_range: _NotNegative = 2.5
    """[m] Of sources that have none of their own."""
    raytrace_range: _NotNegative = 3.0
    """[m] Of sources that have none of their own."""
    max_obstacle_height: _Number = 2.0
    """[m] A laser mounted higher than this marks nothing."""
    footprint_clearing_enabled: bool = True
    """The obstacle layer is free under the footprint."""
    combination_method: int = 1
    """Only 1, the maximum with the layers below, is supported."""
    inflation_radius: _NotNegative = 0.55
    """[m]"""
    cost_scaling_factor: _NotNegative = 10.0
    """[1/m] How fast costs fall with the distance."""
    inflate_unknown: bool = False
    """Write costs over unknown cells, too."""

    def __post_init__(self) -> None:
        if self.map_type != "costmap":
            raise ValueError(
                f'map_type "{self.map_type}" is not supported: write costmap, which for a laser '
                "that lies level marks the same cells"
            )
        if self.static_map and self.rolling_window:
            raise ValueError(
                "static_map and rolling_window exclude each other: a rolling window without the "
                "map, or the map without rolling"
            )
        if self.combination_method != 1:
            raise ValueError("combination_method must be 1 (the maximum of the layers)")

    def padded_footprint(self) -> Floats:
        """Return the corners (k, 2) [m] that the stack reckons with."""
        points = self.footprint or footprint_of_radius(self.robot_radius)
        return padded_footprint(points, self.footprint_padding)
