"""From the namespace of a costmap, in the flat or in the layered form, to its parameters."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, Final

from daemon.navigation.ros.costmap._parameters import (
    SOURCE_WITHOUT_EFFECT,
    WITHOUT_EFFECT,
    CostmapParameters,
    ObservationSource,
)
from daemon.navigation.ros.parameters import Finding, Path, Report, read_section

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
_OURS: Final = {"obstacle_layer", "obstacle_layer_name", "inflation_layer", "sources"}


def read_costmap(given: Mapping[str, Any], path: Path, report: Report) -> CostmapParameters:
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
    found = Report()
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


def _layers(given: Mapping[str, Any], path: Path, report: Report) -> dict[str, str | None]:
    """Return the name of each kind of layer, ``None`` where the list of plugins has none."""
    if "plugins" not in given:
        return dict(_DEFAULT_NAMES)
    layers: dict[str, str | None] = dict.fromkeys(_DEFAULT_NAMES)
    plugins = given["plugins"]
    for index, plugin in enumerate(plugins if isinstance(plugins, list | tuple) else [plugins]):
        place = (*path, "plugins", index)
        if not isinstance(plugin, Mapping) or not {"name", "type"} <= set(plugin):
            report.fatal.append(Finding(place, "must be a layer {name: ..., type: ...}"))
            continue
        kind = str(plugin["type"]).removeprefix("costmap_2d::")
        if kind not in layers:
            known = ", ".join(f"costmap_2d::{name}" for name in layers)
            message = f'no layer of type "{plugin["type"]}" is supported'
            report.fatal.append(Finding(place, message, f"supported: {known}"))
        else:
            layers[kind] = str(plugin["name"])
    return layers


def _merge(
    given: Mapping[str, Any], path: Path, names: Mapping[str, str], *, layered: bool, report: Report
) -> tuple[dict[str, Any], dict[str, Path]]:
    """Return all parameters in one flat namespace, and where each of them stands."""
    spaces = {name: given[name] for name in names.values() if name in given}
    skipped = {*spaces, "plugins"}
    merged: dict[str, Any] = {}
    places: dict[str, Path] = {}
    kinds = {name: kind for kind, name in names.items()}
    for name, value in given.items():
        owners = [kind for kind, own in _IN_LAYER.items() if name in own]
        if layered and owners and name not in _INHERITED:
            layer = names[owners[0]]
            message = f"does not reach the layer {layer} when there are plugins"
            report.problems.append(Finding((*path, name), message, f"write it under {layer}"))
        elif name in _OURS and name not in skipped:
            report.problems.append(Finding((*path, name), "must be names with values"))
        elif layered and name not in skipped and isinstance(value, Mapping):
            # Costmaps often share a file that describes the layers of both.
            reason = "no layer of this costmap is called that"
            report.without_effect.append(Finding((*path, name), reason))
        elif name not in skipped:
            merged[name], places[name] = value, (*path, name)
    for space, values in spaces.items():
        if not isinstance(values, Mapping):
            report.fatal.append(Finding((*path, space), "must be names with values"))
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
    merged: dict[str, Any], given: Mapping[str, Any], layer: str, path: Path, report: Report
) -> tuple[dict[str, Any], tuple[ObservationSource, ...]]:
    """Read the sources that ``observation_sources`` names and take them out of ``merged``."""
    listed = merged.pop("observation_sources", "")
    if not isinstance(listed, str):
        place = (*path, "observation_sources")
        report.fatal.append(Finding(place, "must be text: names with spaces between them"))
        return merged, ()
    sources = []
    for name in listed.split():
        nested = given.get(layer)
        inside = isinstance(nested, Mapping) and name in nested
        place = (*path, layer, name) if inside else (*path, name)
        values = merged.pop(name, {})
        if "plugins" in given and not inside:
            message = f'does not reach the layer {layer}, whose source "{name}" then has defaults'
            report.problems.append(Finding(place, message, f"write it under {layer}"))
            values = {}
        if not isinstance(values, Mapping):
            report.fatal.append(Finding(place, "must be names with values"))
            continue
        source = read_section(
            ObservationSource, values, place, report, without_effect=SOURCE_WITHOUT_EFFECT
        )
        sources.append(replace(source, name=name, topic=source.topic or name))
    # A file may describe more sources than it lists; those are not connected to anything.
    for name in [name for name, value in merged.items() if _looks_like_source(value)]:
        del merged[name]
        report.without_effect.append(Finding((*path, name), "observation_sources does not name it"))
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
