"""Obstacle and voxel layers: their sources, where each value of a source is looked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any, Final, cast

from daemon.stacks.findings import FindingCollector, ParameterFinding
from daemon.stacks.ros1.costmap._layers import ObservationSource, ObstacleLayer, VoxelColumn
from daemon.stacks.ros1.costmap._namespaces import OBSTACLE, VOXEL, ParameterNamespace, PlannedLayer
from daemon.stacks.ros1.costmap._sections import (
    FETCH_WITHOUT_EFFECT,
    OBSTACLE_WITHOUT_EFFECT,
    VOXEL_WITHOUT_EFFECT,
    ObstacleSection,
    RangeSection,
    SourceSection,
    VoxelSection,
)
from daemon.stacks.ros1.parameters import read_section

FETCH: Final = "costmap_2d::FetchDepthLayer"
_LASER_SCAN: Final = "LaserScan"
_CLOUDS: Final = ("PointCloud", "PointCloud2")
_RANGES: Final = {"obstacle_range": 2.5, "raytrace_range": 3.0}
"""[m] What is taken where the search upwards finds nothing."""
_WITHOUT_EFFECT: Final = {
    OBSTACLE: OBSTACLE_WITHOUT_EFFECT,
    VOXEL: VOXEL_WITHOUT_EFFECT,
    FETCH: FETCH_WITHOUT_EFFECT,
}


@dataclass(frozen=True, slots=True)
class Hearing:
    """How topics are resolved, which may carry a scan, whether a late source stops the robot."""

    resolve: Callable[[str], str]
    may_carry_scan: Callable[[str], bool]
    stops_robot: bool


def looks_like_source(value: object) -> bool:
    """Whether a namespace holds nothing but parameters of an observation source."""
    known = {f.name for f in fields(SourceSection)}
    return isinstance(value, Mapping) and bool(value) and set(value) <= known


def read_obstacle_layer(
    planned: PlannedLayer,
    around: tuple[ParameterNamespace, ...],
    hearing: Hearing,
    report: FindingCollector,
    *,
    track_unknown_space: bool,
) -> ObstacleLayer:
    """Return an obstacle or voxel layer with its laser sources.

    ``around`` are the namespaces above the layer's, the nearest first; ``track_unknown_space`` is
    that of the costmap.
    """
    space = planned.namespace
    model = ObstacleSection if planned.type == OBSTACLE else VoxelSection
    read: ObstacleSection = read_section(
        cast("type[Any]", model),
        space.values(),
        space.path,
        report,
        without_effect=_WITHOUT_EFFECT[planned.type],
        elsewhere=_source_names(space, report),
        places=space.places(),
    )
    if planned.type == FETCH:
        message = f"the layer {planned.name} is a voxel layer here: there is no depth camera"
        report.problems.append(ParameterFinding(planned.place, message))
    if read.combination_method not in (0, 1):
        message = f"{read.combination_method}: what the layer sees never reaches the costmap"
        place = space.places()["combination_method"]
        report.problems.append(ParameterFinding(place, message, "write 1 for the maximum"))
    reader = _SourceReader(space, (space, *around), hearing, report)
    found = (reader.read(name) for name in read.observation_sources.split())
    tracked = read.track_unknown_space
    return ObstacleLayer(
        name=planned.name,
        sources=tuple(source for source in found if source is not None),
        max_obstacle_height=read.max_obstacle_height,
        footprint_clearing_enabled=read.footprint_clearing_enabled,
        combination_method=read.combination_method,
        track_unknown_space=track_unknown_space if tracked is None else tracked,
        voxels=_column(read),
    )


def _source_names(space: ParameterNamespace, report: FindingCollector) -> frozenset[str]:
    """Return the namespaces of sources in a layer's; those that are not listed are said to be."""
    written = space.entries.get("observation_sources")
    listed = written.value.split() if written and isinstance(written.value, str) else []
    spare = {
        name
        for name, entry in space.entries.items()
        if name not in listed and looks_like_source(entry.value)
    }
    for name in spare:
        reason = "observation_sources does not name it"
        report.without_effect.append(ParameterFinding(space.entries[name].place, reason))
    return frozenset({*listed, *spare})


def _column(read: ObstacleSection) -> VoxelColumn | None:
    if not isinstance(read, VoxelSection):
        return None
    return VoxelColumn(
        origin_z=read.origin_z,
        z_resolution=read.z_resolution,
        z_voxels=read.z_voxels,
        unknown_threshold=read.unknown_threshold,
        mark_threshold=read.mark_threshold,
    )


@dataclass(frozen=True, slots=True)
class _SourceReader:
    """Reads the sources of a layer; ``search`` are the namespaces above a source's, upwards."""

    layer: ParameterNamespace
    search: tuple[ParameterNamespace, ...]
    hearing: Hearing
    report: FindingCollector

    def read(self, name: str) -> ObservationSource | None:
        """Return a source; none for one of a sensor nobody has, which is said."""
        written = self.layer.entries.get(name)
        if written is not None and not isinstance(written.value, Mapping):
            message = "must be keys with values"
            self.report.fatal.append(ParameterFinding(written.place, message))
            return None
        space = self.layer.below(name)
        read = read_section(SourceSection, space.values(), space.path, self.report)
        topic = self.hearing.resolve(read.topic or name)
        laser = read.data_type == _LASER_SCAN
        self._check_rate(name, space, read, topic)
        if not laser:
            self._say_unheard(name, space, read, topic)
            return None
        if "sensor_frame" in space.entries:
            self._check_sensor_frame(space, read)
        obstacle_range, raytrace_range = (self._range(one, space, read) for one in _RANGES)
        return ObservationSource(
            name=name,
            topic=topic,
            marking=read.marking,
            clearing=read.clearing,
            obstacle_range=obstacle_range,
            raytrace_range=raytrace_range,
            min_obstacle_height=read.min_obstacle_height,
            max_obstacle_height=read.max_obstacle_height,
            inf_is_valid=read.inf_is_valid,
            observation_persistence=read.observation_persistence,
            expected_update_rate=read.expected_update_rate if self.hearing.stops_robot else 0.0,
        )

    def _range(self, name: str, space: ParameterNamespace, read: SourceSection) -> float:
        """Return a range [m] from the nearest namespace upwards that has it (``searchParam``)."""
        own: float | None = getattr(read, name)
        if own is not None or name in space.entries:
            return _RANGES[name] if own is None else own
        for above in self.search:
            if name in above.entries:
                written = above.entries[name]
                found = read_section(
                    RangeSection,
                    {name: written.value},
                    above.path,
                    self.report,
                    places={name: written.place},
                )
                given: float | None = getattr(found, name)
                return _RANGES[name] if given is None else given
        return _RANGES[name]

    def _check_rate(
        self, name: str, space: ParameterNamespace, read: SourceSection, topic: str
    ) -> None:
        """Say what becomes of a source that is expected to speak every so many seconds."""
        if "expected_update_rate" not in space.entries:
            return
        place = space.entries["expected_update_rate"].place
        rate = read.expected_update_rate
        silent = read.data_type in _CLOUDS or not self.hearing.may_carry_scan(topic)
        if rate > 0.0 and self.hearing.stops_robot and silent:
            message = (
                f"nothing is published on {topic} here, and after {rate:g} s without it move_base "
                "stops the robot for good"
            )
            hint = f"write 0, switch off the layer, or take {name} out of observation_sources"
            self.report.fatal.append(ParameterFinding(place, message, hint))
        elif rate > 0.0 and not self.hearing.stops_robot:
            reason = "a late source stops the robot only if it is one of the local costmap"
            self.report.without_effect.append(ParameterFinding(place, reason))

    def _say_unheard(
        self, name: str, space: ParameterNamespace, read: SourceSection, topic: str
    ) -> None:
        places = space.places()
        place = places.get("data_type", places.get("topic", space.path))
        if read.data_type not in _CLOUDS:
            message = f'must be LaserScan, PointCloud or PointCloud2 (given: "{read.data_type}")'
            hint = "move_base ends at once with anything else"
            self.report.fatal.append(ParameterFinding(place, message, hint))
            return
        message = f'the source "{name}" waits for a {read.data_type} on {topic}'
        if "data_type" not in space.entries:
            message += " (its data_type when none is written)"
        hint = "nobody publishes one here, there are only lasers: nothing comes from it"
        self.report.problems.append(ParameterFinding(place, message, hint))

    def _check_sensor_frame(self, space: ParameterNamespace, read: SourceSection) -> None:
        place = space.entries["sensor_frame"].place
        base = [
            above.entries["robot_base_frame"].value
            for above in self.search
            if "robot_base_frame" in above.entries
        ]
        if base and read.sensor_frame.strip("/") == str(base[0]).strip("/"):
            message = (
                "rays would begin at the middle of the robot, here they begin where the laser is"
            )
            self.report.problems.append(
                ParameterFinding(place, message, "leave it out, or name the frame of the laser")
            )
        else:
            reason = "the scan says where the laser is"
            self.report.without_effect.append(ParameterFinding(place, reason))
