"""Namespaces of a costmap as they are written, a model each, with names and defaults of Noetic.

Sources: ``costmap_2d_ros.cpp``, ``plugins/*.cpp`` and the dynamic reconfigure descriptions of
costmap_2d. What they come to together, :mod:`daemon.stacks.ros1.costmap._reading` decides.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Final, TypeAlias

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

from daemon.stacks.ros1.parameters import Finite, NotNegative, Positive
from grammars.model.geometry import Point2

_CONFIG = ConfigDict(extra="forbid")
_Height: TypeAlias = Annotated[float, Field(ge=0.0, le=50.0, allow_inf_nan=False)]
_Voxels: TypeAlias = Annotated[int, Field(ge=0, le=16)]


@dataclass(frozen=True, slots=True, config=_CONFIG)
class CostmapSection:
    """The costmap's own namespace, ``move_base/global_costmap`` or ``move_base/local_costmap``."""

    global_frame: str = "map"
    """Frame of the grid; what it is called in amcl says which one it is."""
    update_frequency: Positive = 5.0
    """[Hz]"""
    publish_frequency: NotNegative = 0.0
    """[Hz] How often the local costmap is shown in the trace, at most once a second."""
    rolling_window: bool = False
    """The grid follows the robot."""
    width: Positive = 10.0
    """[m] Whole metres; without a map that gives the size."""
    height: Positive = 10.0
    """[m] Whole metres."""
    resolution: Positive = 0.05
    """[m]"""
    origin_x: Finite = 0.0
    """[m]"""
    origin_y: Finite = 0.0
    """[m]"""
    track_unknown_space: bool = False
    """Cells of the master grid that no layer writes are unknown."""
    footprint_padding: Finite = 0.01
    """[m] Every coordinate of the footprint moves out from zero by this."""


@dataclass(frozen=True, slots=True, config=_CONFIG)
class BodySection:
    """What a costmap finds by searching upwards through the namespaces (``footprint.cpp``)."""

    footprint: Annotated[tuple[Point2, ...], Field(min_length=3)] | None = None
    """[m] Corners in the base frame."""
    robot_radius: Positive = 0.46
    """[m] Without a footprint."""


@dataclass(frozen=True, slots=True, config=_CONFIG)
class SourceSection:
    """Namespace of one of the ``observation_sources``."""

    topic: str = ""
    """The source's own name when there is none."""
    data_type: str = "PointCloud"
    """LaserScan, PointCloud or PointCloud2."""
    marking: bool = True
    clearing: bool = False
    obstacle_range: NotNegative | None = None
    """[m] Searched for upwards when it is not here; 2.5 in the end."""
    raytrace_range: NotNegative | None = None
    """[m] Searched for upwards when it is not here; 3.0 in the end."""
    min_obstacle_height: Finite = 0.0
    max_obstacle_height: Finite = 2.0
    inf_is_valid: bool = False
    observation_persistence: NotNegative = 0.0
    expected_update_rate: NotNegative = 0.0
    """[s] The robot stops when the source was silent for longer; 0: never."""
    sensor_frame: str = ""
    """Where rays begin; the frame of the scan when there is none."""


@dataclass(frozen=True, slots=True, config=_CONFIG)
class RangeSection:
    """Ranges in a namespace that sources search through."""

    obstacle_range: NotNegative | None = None
    raytrace_range: NotNegative | None = None


@dataclass(frozen=True, slots=True, config=_CONFIG)
class StaticSection:
    """Namespace of a ``costmap_2d::StaticLayer``."""

    enabled: bool = True
    map_topic: str = "map"
    track_unknown_space: bool = True
    use_maximum: bool = False
    lethal_cost_threshold: int = 100
    """Occupancy from which on a cell of the map is lethal."""
    unknown_cost_value: int = -1
    """Occupancy that means unknown, as an unsigned byte."""


@dataclass(frozen=True, slots=True, config=_CONFIG)
class ObstacleSection:
    """Namespace of a ``costmap_2d::ObstacleLayer``."""

    enabled: bool = True
    observation_sources: str = ""
    """Names with spaces between them."""
    max_obstacle_height: _Height = 2.0
    footprint_clearing_enabled: bool = True
    combination_method: int = 1
    track_unknown_space: bool | None = None
    """That of the costmap when it is not here."""
    obstacle_range: NotNegative | None = None
    raytrace_range: NotNegative | None = None


@dataclass(frozen=True, slots=True, config=_CONFIG)
class VoxelSection(ObstacleSection):
    """Namespace of a ``costmap_2d::VoxelLayer``."""

    origin_z: _Height = 0.0
    """[m] Not below zero (dynamic reconfigure)."""
    z_resolution: Annotated[float, Field(gt=0.0, le=50.0, allow_inf_nan=False)] = 0.2
    z_voxels: Annotated[int, Field(ge=1, le=16)] = 10
    unknown_threshold: _Voxels = 15
    mark_threshold: _Voxels = 0


@dataclass(frozen=True, slots=True, config=_CONFIG)
class InflationSection:
    """Namespace of a ``costmap_2d::InflationLayer``."""

    enabled: bool = True
    inflation_radius: Annotated[float, Field(ge=0.0, le=50.0, allow_inf_nan=False)] = 0.55
    cost_scaling_factor: Annotated[float, Field(ge=0.0, le=100.0, allow_inf_nan=False)] = 10.0
    inflate_unknown: bool = False


_DISPLAY: Final = "only for display"
_NO_OTHER_MAP: Final = "the map never changes"
_THREE_VALUES: Final = "the map knows free, occupied and unknown only"
_NEVER_LATE: Final = "transforms are never late here"

COSTMAP_WITHOUT_EFFECT: Final[Mapping[str, str]] = {
    "always_send_full_costmap": _DISPLAY,
    "transform_tolerance": _NEVER_LATE,
    "robot_base_frame": "there is one robot, with one base frame",
    "footprint_topic": "nobody publishes another footprint during a run",
    "published_footprint_topic": _DISPLAY,
    "restore_defaults": "it is a button of rqt_reconfigure",
    "save_debug_pgm": "Noetic does not read it any more",
}
STATIC_WITHOUT_EFFECT: Final[Mapping[str, str]] = {
    "first_map_only": _NO_OTHER_MAP,
    "subscribe_to_updates": _NO_OTHER_MAP,
    "trinary_costmap": _THREE_VALUES,
    "restore_defaults": COSTMAP_WITHOUT_EFFECT["restore_defaults"],
}
OBSTACLE_WITHOUT_EFFECT: Final[Mapping[str, str]] = {
    "transform_tolerance": _NEVER_LATE,
    "restore_defaults": COSTMAP_WITHOUT_EFFECT["restore_defaults"],
}
VOXEL_WITHOUT_EFFECT: Final[Mapping[str, str]] = {
    **OBSTACLE_WITHOUT_EFFECT,
    "publish_voxel_map": _DISPLAY,
}
INFLATION_WITHOUT_EFFECT: Final[Mapping[str, str]] = {
    "restore_defaults": COSTMAP_WITHOUT_EFFECT["restore_defaults"],
}
SOURCE_WITHOUT_EFFECT: Final[Mapping[str, str]] = {}

_NO_CAMERA: Final = "there is no depth camera here"
FETCH_WITHOUT_EFFECT: Final[Mapping[str, str]] = {
    **VOXEL_WITHOUT_EFFECT,
    **dict.fromkeys(
        (
            *("publish_observations", "observations_separation_threshold", "find_ground_plane"),
            *("ground_orientation_threshold", "clear_nans", "min_obstacle_height"),
            *("min_clearing_height", "max_clearing_height", "skip_rays_bottom", "skip_rays_top"),
            *("skip_rays_left", "skip_rays_right", "clear_with_skipped_rays", "depth_topic"),
            *("info_topic", "observation_persistence", "expected_update_rate"),
        ),
        _NO_CAMERA,
    ),
}
"""A ``costmap_2d::FetchDepthLayer``: a voxel layer with sources of its own besides."""
