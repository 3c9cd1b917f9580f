"""Namespaces of a costmap as they are written, a model each, with names and defaults of Noetic.

Sources: ``costmap_2d_ros.cpp``, ``plugins/*.cpp`` and the dynamic reconfigure descriptions of
costmap_2d. What they come to together, :mod:`daemon.stacks.ros1.costmap._reading` decides.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, TypeAlias

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
    """Returns make their cells lethal."""
    clearing: bool = False
    """Rays clear the cells before their returns."""
    obstacle_range: NotNegative | None = None
    """[m] Searched for upwards when it is not here; 2.5 in the end."""
    raytrace_range: NotNegative | None = None
    """[m] Searched for upwards when it is not here; 3.0 in the end."""
    min_obstacle_height: Finite = 0.0
    """[m] A laser mounted lower than this is not heard."""
    max_obstacle_height: Finite = 2.0
    """[m] Nor one mounted higher."""
    inf_is_valid: bool = False
    """Rays without return clear, as if they ended just before the greatest range."""
    observation_persistence: NotNegative = 0.0
    """[s] Scans count for so long; 0: only the latest."""
    expected_update_rate: NotNegative = 0.0
    """[s] The robot stops when the source was silent for longer; 0: never."""
    sensor_frame: str = ""
    """Where rays begin; the frame of the scan when there is none."""


@dataclass(frozen=True, slots=True, config=_CONFIG)
class RangeSection:
    """Ranges in a namespace that sources search through."""

    obstacle_range: NotNegative | None = None
    """[m] Returns farther than this do not mark."""
    raytrace_range: NotNegative | None = None
    """[m] Rays clear up to here."""


@dataclass(frozen=True, slots=True, config=_CONFIG)
class StaticSection:
    """Namespace of a ``costmap_2d::StaticLayer``."""

    enabled: bool = True
    """Whether there is the layer."""
    map_topic: str = "map"
    """Where it listens to the map; only the map of the run is there."""
    track_unknown_space: bool = True
    """Unknown cells of the map are unknown here; otherwise free."""
    use_maximum: bool = False
    """Merge by the maximum with the layers below instead of writing over them."""
    lethal_cost_threshold: int = 100
    """Occupancy from which on a cell of the map is lethal."""
    unknown_cost_value: int = -1
    """Occupancy that means unknown, as an unsigned byte."""


@dataclass(frozen=True, slots=True, config=_CONFIG)
class ObstacleSection:
    """Namespace of a ``costmap_2d::ObstacleLayer``."""

    enabled: bool = True
    """Whether there is the layer."""
    observation_sources: str = ""
    """Names of sources with spaces between them; each is described under its name."""
    max_obstacle_height: _Height = 2.0
    """[m] A laser mounted higher than this marks nothing."""
    footprint_clearing_enabled: bool = True
    """The layer is free under the footprint."""
    combination_method: int = 1
    """0: writes over the layers below; 1: the maximum with them; others: merges nothing."""
    track_unknown_space: bool | None = None
    """Cells nobody has looked at are unknown; as in the costmap when it is not here."""
    obstacle_range: NotNegative | None = None
    """[m] Of sources that have none of their own."""
    raytrace_range: NotNegative | None = None
    """[m] Of sources that have none of their own."""


@dataclass(frozen=True, slots=True, config=_CONFIG)
class VoxelSection(ObstacleSection):
    """Namespace of a ``costmap_2d::VoxelLayer``."""

    origin_z: _Height = 0.0
    """[m] Height of the lowest voxel's lower face, not below zero (dynamic reconfigure)."""
    z_resolution: Annotated[float, Field(gt=0.0, le=50.0, allow_inf_nan=False)] = 0.2
    """[m] Height of a voxel."""
    z_voxels: Annotated[int, Field(ge=1, le=16)] = 10
    """Voxels in a column."""
    unknown_threshold: _Voxels = 15
    """A column with more unknown voxels than this is unknown."""
    mark_threshold: _Voxels = 0
    """A column with more marked voxels than this is lethal."""


@dataclass(frozen=True, slots=True, config=_CONFIG)
class InflationSection:
    """Namespace of a ``costmap_2d::InflationLayer``."""

    enabled: bool = True
    """Whether there is the layer."""
    inflation_radius: Annotated[float, Field(ge=0.0, le=50.0, allow_inf_nan=False)] = 0.55
    """[m]"""
    cost_scaling_factor: Annotated[float, Field(ge=0.0, le=100.0, allow_inf_nan=False)] = 10.0
    """[1/m] How fast costs fall with the distance."""
    inflate_unknown: bool = False
    """Write costs over unknown cells, too."""


_DISPLAY: Final = "only for display"
_NO_OTHER_MAP: Final = "the map never changes"
_THREE_VALUES: Final = "maps are read as free, occupied and unknown only"
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

WRITTEN_SECTIONS: Final[Mapping[str, tuple[type[Any], Mapping[str, str]]]] = {
    "costmap": (CostmapSection, COSTMAP_WITHOUT_EFFECT),
    "body": (BodySection, {}),
    "source": (SourceSection, {}),
    "static_layer": (StaticSection, STATIC_WITHOUT_EFFECT),
    "obstacle_layer": (VoxelSection, VOXEL_WITHOUT_EFFECT),
    "inflation_layer": (InflationSection, INFLATION_WITHOUT_EFFECT),
}
"""The models of what people write, and the names that change nothing, for editors."""
