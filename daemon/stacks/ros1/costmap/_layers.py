"""What a costmap is made of: its layers in the order of ``plugins``, and what they listen to.

Values only, complete and resolved: whatever a file leaves out, or says in the namespace above, has
been decided by whoever reads the file (:mod:`daemon.stacks.ros1.costmap._parameters`). Names and
defaults are those of costmap_2d in ROS Noetic.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from daemon.stacks.ros1.costmap._footprint import footprint_of_radius, padded_footprint
from grammars.model.geometry import Floats, Point2


@dataclass(frozen=True, slots=True)
class ObservationSource:
    """One entry of ``observation_sources``: the lasers on a topic, as they mark and clear.

    ``topic`` is resolved: absolute, remapped. Sources of another type than LaserScan are not here.
    """

    name: str
    topic: str
    marking: bool = True
    """Returns make their cells lethal."""
    clearing: bool = False
    """Rays clear the cells before their returns."""
    obstacle_range: float = 2.5
    """[m] Returns farther than this do not mark."""
    raytrace_range: float = 3.0
    """[m] Rays clear up to here."""
    min_obstacle_height: float = 0.0
    """[m] A laser mounted lower than this is not heard."""
    max_obstacle_height: float = 2.0
    """[m] Nor one mounted higher."""
    inf_is_valid: bool = False
    """Rays without return clear, as if they ended just before the greatest range."""
    observation_persistence: float = 0.0
    """[s] Scans count for so long; 0: only the latest."""


@dataclass(frozen=True, slots=True)
class VoxelColumn:
    """The heights a voxel layer tells apart (``costmap_2d::VoxelLayer``)."""

    origin_z: float = 0.0
    """[m] Height of the lowest voxel's lower face."""
    z_resolution: float = 0.2
    """[m] Height of a voxel."""
    z_voxels: int = 10
    """Voxels in a column, 16 at most."""
    unknown_threshold: int = 15
    """A column with more unknown voxels than this (as written, counted from ``z_voxels`` up to 16)
    is unknown."""
    mark_threshold: int = 0
    """A column with more marked voxels than this is lethal."""


@dataclass(frozen=True, slots=True)
class StaticLayer:
    """The map (``costmap_2d::StaticLayer``)."""

    name: str = "static_layer"
    track_unknown_space: bool = True
    """Unknown cells of the map are unknown here; otherwise free."""
    use_maximum: bool = False
    """Merge by the maximum with the layers below instead of writing over them."""


@dataclass(frozen=True, slots=True)
class ObstacleLayer:
    """What lasers see (``costmap_2d::ObstacleLayer``; with ``voxels`` a ``VoxelLayer``)."""

    name: str = "obstacle_layer"
    sources: tuple[ObservationSource, ...] = ()
    max_obstacle_height: float = 2.0
    """[m] A laser mounted higher than this marks nothing."""
    footprint_clearing_enabled: bool = True
    """The layer is free under the footprint."""
    combination_method: int = 1
    """0: writes over the layers below; 1: the maximum with them; others: merges nothing."""
    track_unknown_space: bool = False
    """Cells nobody has looked at are unknown; otherwise free."""
    voxels: VoxelColumn | None = None


@dataclass(frozen=True, slots=True)
class InflationLayer:
    """Costs around obstacles (``costmap_2d::InflationLayer``)."""

    name: str = "inflation_layer"
    inflation_radius: float = 0.55
    """[m]"""
    cost_scaling_factor: float = 10.0
    """[1/m] How fast costs fall with the distance."""
    inflate_unknown: bool = False
    """Write costs over unknown cells, too."""


Layer: TypeAlias = StaticLayer | ObstacleLayer | InflationLayer


@dataclass(frozen=True, slots=True)
class LayeredCostmap:
    """One costmap: its grid and its layers, the lowest first; layers that are off are not here."""

    layers: tuple[Layer, ...] = ()
    frame: Literal["map", "odom"] = "map"
    """What its ``global_frame`` is, whatever it is called."""
    update_frequency: float = 5.0
    """[Hz]"""
    publish_frequency: float = 0.0
    """[Hz] How often the local costmap is shown in the trace, at most once a second."""
    rolling_window: bool = False
    """The grid follows the robot."""
    width: float = 10.0
    """[m] Without a map that gives the size."""
    height: float = 10.0
    """[m]"""
    resolution: float = 0.05
    """[m]"""
    origin_x: float = 0.0
    """[m]"""
    origin_y: float = 0.0
    """[m]"""
    track_unknown_space: bool = False
    """Cells of the master grid that no layer writes are unknown; otherwise free."""
    footprint: tuple[Point2, ...] | None = None
    """[m] Corners in the base frame."""
    robot_radius: float = 0.46
    """[m] Without a footprint: a polygon of sixteen corners."""
    footprint_padding: float = 0.01
    """[m] Every coordinate of the footprint moves out from zero by this."""

    def padded_footprint(self) -> Floats:
        """Return the corners (k, 2) [m] that the stack reckons with."""
        points = self.footprint or footprint_of_radius(self.robot_radius)
        return padded_footprint(points, self.footprint_padding)
