"""Parameters of one costmap: names, defaults and ranges of costmap_2d in ROS Noetic.

They are read from a namespace in the flat or in the layered form.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Annotated, Any, Final

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

from daemon.stacks.findings import FindingCollector, ParameterFinding, ParameterLocation
from daemon.stacks.ros1.costmap._footprint import footprint_of_radius, padded_footprint
from daemon.stacks.ros1.parameters import Finite, NotNegative, Positive, read_section
from grammars.model.geometry import Floats, Point2

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
    min_obstacle_height: Finite = 0.0
    """[m] A laser mounted lower than this is not heard."""
    max_obstacle_height: Finite = 2.0
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
    update_frequency: Positive = 5.0
    """[Hz]"""
    publish_frequency: NotNegative = 0.0
    """[Hz] How often the local costmap is shown in the trace, at most once a second; the global
    one never is."""
    rolling_window: bool = False
    """The grid follows the robot."""
    static_map: bool = False
    """Begin with the map; the grid then has its size, origin and resolution."""
    width: Positive = 10.0
    """[m] Without the map."""
    height: Positive = 10.0
    """[m] Without the map."""
    resolution: Positive = 0.05
    """[m] Without the map."""
    origin_x: Finite = 0.0
    """[m] Without the map."""
    origin_y: Finite = 0.0
    """[m] Without the map."""
    track_unknown_space: bool | None = None
    """Cells nobody has looked at stay unknown; unset is false for all but the static layer."""
    footprint: Annotated[tuple[Point2, ...], Field(min_length=3)] | None = None
    """[m] Corners in the base frame."""
    robot_radius: Positive = 0.46
    """[m] Without a footprint: a polygon of sixteen corners."""
    footprint_padding: Finite = 0.01
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
    obstacle_range: NotNegative = 2.5
    """[m] Of sources that have none of their own."""
    raytrace_range: NotNegative = 3.0
    """[m] Of sources that have none of their own."""
    max_obstacle_height: Finite = 2.0
    """[m] A laser mounted higher than this marks nothing."""
    footprint_clearing_enabled: bool = True
    """The obstacle layer is free under the footprint."""
    combination_method: int = 1
    """Only 1, the maximum with the layers below, is supported."""
    inflation_radius: NotNegative = 0.55
    """[m]"""
    cost_scaling_factor: NotNegative = 10.0
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


_STATIC, _OBSTACLE, _INFLATION = "StaticLayer", "ObstacleLayer", "InflationLayer"
_DEFAULT_NAMES: Final = {
    _STATIC: "static_layer",
    _OBSTACLE: "obstacle_layer",
    _INFLATION: "inflation_layer",
}
_IN_LAYER: Final = {
    _STATIC: {"track_unknown_space"},
    _OBSTACLE: {
        *("obstacle_range", "raytrace_range", "max_obstacle_height", "track_unknown_space"),
        *("footprint_clearing_enabled", "combination_method", "observation_sources"),
    },
    _INFLATION: {"inflation_radius", "cost_scaling_factor", "inflate_unknown"},
}
_INHERITED: Final = {"obstacle_range", "raytrace_range", "track_unknown_space"}
"""What layers look up in the costmap's own namespace when theirs has none."""
_NOT_WRITTEN: Final = {"obstacle_layer", "obstacle_layer_name", "inflation_layer", "sources"}


def read_costmap(
    given: Mapping[str, Any], path: ParameterLocation, report: FindingCollector
) -> CostmapParameters:
    """Return the parameters in the namespace ``given`` at ``path``; findings go to ``report``.

    Reads the flat form of pre-Hydro files and the one with ``plugins``, where the parameters of a
    layer stand in a namespace with its name. Layers other than the static, obstacle and inflation
    layers are refused by name. As in costmap_2d, flat parameters win when there are no plugins,
    and do not reach the layers when there are.
    """
    layers = _layers(given, path, report)
    names = _DEFAULT_NAMES | {kind: name for kind, name in layers.items() if name is not None}
    merged, places = _merge(given, path, names, layered="plugins" in given, report=report)
    merged, sources = _take_sources(merged, given, names[_OBSTACLE], path, report)
    _parse_footprint(merged)
    found = FindingCollector()
    read = read_section(CostmapParameters, merged, path, found, without_effect=WITHOUT_EFFECT)
    for kind in ("fatal", "problems", "without_effect"):
        for finding in getattr(found, kind):
            place = (
                places.get(str(finding.path[len(path)])) if len(finding.path) > len(path) else ()
            )
            moved = (*place, *finding.path[len(path) + 1 :]) if place else finding.path
            getattr(report, kind).append(replace(finding, path=moved))
    return replace(
        read,
        static_map=layers[_STATIC] is not None if "plugins" in given else read.static_map,
        obstacle_layer=layers[_OBSTACLE] is not None,
        obstacle_layer_name=names[_OBSTACLE],
        inflation_layer=layers[_INFLATION] is not None,
        sources=sources,
    )


def _layers(
    given: Mapping[str, Any], path: ParameterLocation, report: FindingCollector
) -> dict[str, str | None]:
    """Return the name of each kind of layer, ``None`` where the list of plugins has none."""
    if "plugins" not in given:
        return dict(_DEFAULT_NAMES)
    layers: dict[str, str | None] = dict.fromkeys(_DEFAULT_NAMES)
    plugins = given["plugins"]
    for index, plugin in enumerate(plugins if isinstance(plugins, list | tuple) else [plugins]):
        place = (*path, "plugins", index)
        if not isinstance(plugin, Mapping) or not {"name", "type"} <= set(plugin):
            report.fatal.append(ParameterFinding(place, "must be a layer {name: ..., type: ...}"))
            continue
        kind = str(plugin["type"]).removeprefix("costmap_2d::")
        if kind not in layers:
            known = ", ".join(f"costmap_2d::{name}" for name in layers)
            message = f'no layer of type "{plugin["type"]}" is supported'
            report.fatal.append(ParameterFinding(place, message, f"supported: {known}"))
        else:
            layers[kind] = str(plugin["name"])
    return layers


def _merge(
    given: Mapping[str, Any],
    path: ParameterLocation,
    names: Mapping[str, str],
    *,
    layered: bool,
    report: FindingCollector,
) -> tuple[dict[str, Any], dict[str, ParameterLocation]]:
    """Return all parameters in one flat namespace, and where each of them stands."""
    spaces = {name: given[name] for name in names.values() if name in given}
    skipped = {*spaces, "plugins"}
    merged: dict[str, Any] = {}
    places: dict[str, ParameterLocation] = {}
    kinds = {name: kind for kind, name in names.items()}
    for name, value in given.items():
        owners = [kind for kind, own in _IN_LAYER.items() if name in own]
        if layered and owners and name not in _INHERITED:
            layer = names[owners[0]]
            message = f"does not reach the layer {layer} when there are plugins"
            report.problems.append(
                ParameterFinding((*path, name), message, f"write it under {layer}")
            )
        elif name in _NOT_WRITTEN and name not in skipped:
            report.problems.append(ParameterFinding((*path, name), "must be names with values"))
        elif layered and name not in skipped and isinstance(value, Mapping):
            # Costmaps often share a file that describes the layers of both.
            reason = "no layer of this costmap is called that"
            report.without_effect.append(ParameterFinding((*path, name), reason))
        elif name not in skipped:
            merged[name], places[name] = value, (*path, name)
    for space, values in spaces.items():
        if not isinstance(values, Mapping):
            report.fatal.append(ParameterFinding((*path, space), "must be names with values"))
            continue
        for name, value in values.items():
            if name == "enabled" and value is True:
                continue
            if kinds[space] == _STATIC and name == "track_unknown_space" and value is True:
                # Its default; what becomes of unknown cells the layer above decides.
                continue
            if layered or name not in merged:
                merged[name], places[name] = value, (*path, space, name)
    return merged, places


def _take_sources(
    merged: dict[str, Any],
    given: Mapping[str, Any],
    layer: str,
    path: ParameterLocation,
    report: FindingCollector,
) -> tuple[dict[str, Any], tuple[ObservationSource, ...]]:
    """Read the sources that ``observation_sources`` names and take them out of ``merged``."""
    listed = merged.pop("observation_sources", "")
    if not isinstance(listed, str):
        place = (*path, "observation_sources")
        report.fatal.append(ParameterFinding(place, "must be text: names with spaces between them"))
        return merged, ()
    sources = []
    for name in listed.split():
        nested = given.get(layer)
        inside = isinstance(nested, Mapping) and name in nested
        place = (*path, layer, name) if inside else (*path, name)
        values = merged.pop(name, {})
        if "plugins" in given and not inside:
            message = f'does not reach the layer {layer}, whose source "{name}" then has defaults'
            report.problems.append(ParameterFinding(place, message, f"write it under {layer}"))
            values = {}
        if not isinstance(values, Mapping):
            report.fatal.append(ParameterFinding(place, "must be names with values"))
            continue
        source = read_section(
            ObservationSource, values, place, report, without_effect=SOURCE_WITHOUT_EFFECT
        )
        sources.append(replace(source, name=name, topic=source.topic or name))
    # A file may describe more sources than it lists; those are not connected to anything.
    for name in [name for name, value in merged.items() if _looks_like_source(value)]:
        del merged[name]
        report.without_effect.append(
            ParameterFinding((*path, name), "observation_sources does not name it")
        )
    return merged, tuple(sources)


def _looks_like_source(value: object) -> bool:
    known = {field.name for field in fields(ObservationSource)} | set(SOURCE_WITHOUT_EFFECT)
    return isinstance(value, Mapping) and bool(value) and set(value) <= known


def _parse_footprint(merged: dict[str, Any]) -> None:
    """Read a footprint written as text, ``"[[0.3, 0.2], ...]"``; ``[]`` is none."""
    footprint = merged.get("footprint")
    if isinstance(footprint, str):
        try:
            merged["footprint"] = footprint = json.loads(footprint or "[]")
        except ValueError:
            return
    if footprint == []:
        del merged["footprint"]
