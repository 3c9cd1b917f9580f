"""Parameters of a costmap, its layers and their sources.

Each class is a namespace with the names and defaults of Noetic. Sources: ``costmap_2d_ros.cpp``,
``plugins/*.cpp`` and the dynamic reconfigure descriptions of costmap_2d.
:mod:`daemon.stacks.ros1.costmap.reading` adds the values that costmap_2d takes from other
namespaces.

Fields with ``SkipJsonSchema``, such as ``name``, do not come from a file. Defaults that depend on
other namespaces are factories, so that editors do not show them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, ClassVar, Final, Literal, TypeAlias

import numpy as np
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass
from pydantic.json_schema import SkipJsonSchema

from daemon.stacks.ros1.parameters import Finite, NotNegative, Positive, Section
from grammars.model.geometry import Floats, Point2

_CONFIG = ConfigDict(extra="forbid")
_Height: TypeAlias = Annotated[float, Field(ge=0.0, le=50.0, allow_inf_nan=False)]
_Voxels: TypeAlias = Annotated[int, Field(ge=0, le=16)]
_CORNERS: Final = 16
"""Corners of the polygon in the place of ``robot_radius``."""

_DISPLAY: Final = "only for display"
_NO_OTHER_MAP: Final = "the map never changes"
_NEVER_LATE: Final = "transforms are never late here"
_BUTTON: Final = {"restore_defaults": "only a button of rqt_reconfigure"}
_OBSTACLES: Final = {"transform_tolerance": _NEVER_LATE, **_BUTTON}


@dataclass(frozen=True, slots=True, config=_CONFIG)
class ObservationSource(Section):
    """Namespace of one of the ``observation_sources``."""

    without_effect: ClassVar[Mapping[str, str]] = {
        "sensor_frame": "the scan says where the laser is"
    }
    name: SkipJsonSchema[str] = ""
    topic: str = ""
    """Default: the name of the source."""
    data_type: str = "PointCloud"
    """LaserScan, PointCloud or PointCloud2."""
    marking: bool = True
    """Returns make their cells lethal."""
    clearing: bool = False
    """Rays clear the cells before their returns."""
    obstacle_range: NotNegative = Field(default_factory=lambda: 2.5)
    """[m] Default: that of the nearest namespace above, then 2.5."""
    raytrace_range: NotNegative = Field(default_factory=lambda: 3.0)
    """[m] Default: that of the nearest namespace above, then 3.0."""
    min_obstacle_height: Finite = 0.0
    """[m] Lasers below this height are ignored."""
    max_obstacle_height: Finite = 2.0
    """[m] Lasers above this height are ignored."""
    inf_is_valid: bool = False
    """Rays without return clear up to the greatest range."""
    observation_persistence: NotNegative = 0.0
    """[s] Scans count for this time; 0: only the latest."""
    expected_update_rate: NotNegative = 0.0
    """[s] The robot stops if the source is silent this long; 0: never."""


@dataclass(frozen=True, slots=True, config=_CONFIG)
class StaticLayer(Section):
    """Namespace of a ``costmap_2d::StaticLayer``."""

    without_effect: ClassVar[Mapping[str, str]] = {
        "first_map_only": _NO_OTHER_MAP,
        "subscribe_to_updates": _NO_OTHER_MAP,
        **_BUTTON,
    }
    name: SkipJsonSchema[str] = "static_layer"
    enabled: bool = True
    """The layer exists."""
    map_topic: str = "map"
    """Topic of the map of the run."""
    track_unknown_space: bool = True
    """Unknown cells of the map stay unknown instead of free."""
    use_maximum: bool = False
    """Keep the maximum with the layers below instead of overwriting them."""
    lethal_cost_threshold: int = 100
    """Least occupancy of a lethal cell of the map, at most 100."""
    unknown_cost_value: int = -1
    """Occupancy, as an unsigned byte, of a cell that counts as unknown."""
    trinary_costmap: bool = True
    """Cells of the map below the threshold are free; otherwise they cost in proportion."""


@dataclass(frozen=True, slots=True, config=_CONFIG)
class ObstacleLayer(Section):
    """Namespace of a ``costmap_2d::ObstacleLayer``; ``sources`` are its lasers."""

    without_effect: ClassVar[Mapping[str, str]] = _OBSTACLES
    name: SkipJsonSchema[str] = "obstacle_layer"
    sources: SkipJsonSchema[tuple[ObservationSource, ...]] = ()
    enabled: bool = True
    """The layer exists."""
    observation_sources: str = ""
    """Names of sources, separated by spaces; each is a section of its own."""
    max_obstacle_height: _Height = 2.0
    """[m] A laser above this height marks nothing."""
    footprint_clearing_enabled: bool = True
    """The layer is free under the footprint."""
    combination_method: int = 1
    """0: overwrite the layers below; 1: keep the maximum; others: merge nothing."""
    track_unknown_space: bool = Field(default_factory=bool)
    """Unseen cells are unknown. Default: that of the costmap."""
    obstacle_range: NotNegative | None = None
    """[m] Default for sources."""
    raytrace_range: NotNegative | None = None
    """[m] Default for sources."""


@dataclass(frozen=True, slots=True, config=_CONFIG)
class VoxelLayer(ObstacleLayer):
    """Namespace of a ``costmap_2d::VoxelLayer``."""

    without_effect: ClassVar[Mapping[str, str]] = {**_OBSTACLES, "publish_voxel_map": _DISPLAY}
    origin_z: _Height = 0.0
    """[m] Height of the lowest voxel's lower face."""
    z_resolution: Annotated[float, Field(gt=0.0, le=50.0, allow_inf_nan=False)] = 0.2
    """[m] Height of a voxel."""
    z_voxels: Annotated[int, Field(ge=1, le=16)] = 10
    """Voxels in a column."""
    unknown_threshold: _Voxels = 15
    """A column with more unknown voxels than this is unknown."""
    mark_threshold: _Voxels = 0
    """A column with more marked voxels than this is lethal."""

    @property
    def top(self) -> float:
        """Height of the highest voxel's upper face [m]."""
        return self.origin_z + self.z_voxels * self.z_resolution


@dataclass(frozen=True, slots=True, config=_CONFIG)
class InflationLayer(Section):
    """Namespace of a ``costmap_2d::InflationLayer``."""

    without_effect: ClassVar[Mapping[str, str]] = _BUTTON
    name: SkipJsonSchema[str] = "inflation_layer"
    enabled: bool = True
    """The layer exists."""
    inflation_radius: Annotated[float, Field(ge=0.0, le=50.0, allow_inf_nan=False)] = 0.55
    """[m]"""
    cost_scaling_factor: Annotated[float, Field(ge=0.0, le=100.0, allow_inf_nan=False)] = 10.0
    """[1/m] Decay rate of costs with the distance."""
    inflate_unknown: bool = False
    """Overwrite unknown cells with costs, too."""


Layer: TypeAlias = StaticLayer | ObstacleLayer | InflationLayer


@dataclass(frozen=True, slots=True, config=_CONFIG)
class LayeredCostmap(Section):
    """Parameters of a costmap."""

    without_effect: ClassVar[Mapping[str, str]] = {
        "always_send_full_costmap": _DISPLAY,
        "transform_tolerance": _NEVER_LATE,
        "robot_base_frame": "there is one robot, with one base frame",
        "footprint_topic": "the footprint never changes during a run",
        "published_footprint_topic": _DISPLAY,
        **_BUTTON,
        "save_debug_pgm": "Noetic does not read it any more",
    }
    # Without the layers that are off.
    layers: SkipJsonSchema[tuple[Layer, ...]] = ()
    frame: SkipJsonSchema[Literal["map", "odom"]] = "map"
    global_frame: str = "map"
    """Frame of the grid, by its name in amcl."""
    update_frequency: Positive = 5.0
    """[Hz]"""
    publish_frequency: NotNegative = 0.0
    """[Hz] Rate of the local costmap in the trace, at most once a second."""
    rolling_window: bool = False
    """The grid follows the robot."""
    width: Positive = 10.0
    """[m] Whole metres; the map's size, if there is a map."""
    height: Positive = 10.0
    """[m] Whole metres; the map's size, if there is a map."""
    resolution: Positive = 0.05
    """[m]"""
    origin_x: Finite = 0.0
    """[m]"""
    origin_y: Finite = 0.0
    """[m]"""
    track_unknown_space: bool = False
    """Cells that no layer writes are unknown."""
    footprint_padding: Finite = 0.01
    """[m] Outward shift of every coordinate of the footprint."""
    footprint: Annotated[tuple[Point2, ...], Field(min_length=3)] | None = None
    """[m] Corners in the base frame."""
    robot_radius: Positive = 0.46
    """[m] Used without a footprint."""

    def padded_footprint(self) -> Floats:
        """Return the padded corners (k, 2) [m].

        A coordinate of exactly zero stays (costmap_2d ``padFootprint``). Without a footprint
        the corners lie on a circle (``footprint.cpp``).
        """
        angles = [2.0 * math.pi * k / _CORNERS for k in range(_CORNERS)]
        radius = self.robot_radius
        circle = [(radius * math.cos(angle), radius * math.sin(angle)) for angle in angles]
        corners = np.array(self.footprint or circle, dtype=np.float64)
        return np.asarray(corners + np.sign(corners) * self.footprint_padding, dtype=np.float64)

    def laser_sources(self) -> Iterator[tuple[ObstacleLayer, ObservationSource]]:
        """Yield the sources of all layers, each with its layer, the lowest layer first."""
        for layer in self.layers:
            if isinstance(layer, ObstacleLayer):
                for source in layer.sources:
                    yield layer, source


SEARCHED_UPWARDS: Final = ("footprint", "robot_radius")
"""Names that a costmap also looks up in the namespace of move_base (``footprint.cpp``)."""


def inscribed_radius(points: Floats) -> float:
    """Return the distance [m] from the origin to the nearest edge of a polygon (k, 2).

    The origin may lie outside (costmap_2d ``calculateMinAndMaxDistances``).
    """
    corners: list[Point2] = points.tolist()
    following = corners[1:] + corners[:1]
    edges = [_to_segment(a, b) for a, b in zip(corners, following, strict=True)]
    return min(*edges, *(math.hypot(x, y) for x, y in corners))


def _to_segment(a: Point2, b: Point2) -> float:
    """Return the distance from the origin to the segment from ``a`` to ``b``."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    length2 = dx * dx + dy * dy
    along = -(a[0] * dx + a[1] * dy) / length2 if length2 > 0.0 else 0.0
    along = min(1.0, max(0.0, along))
    return math.hypot(a[0] + along * dx, a[1] + along * dy)
