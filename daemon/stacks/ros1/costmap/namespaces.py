"""Namespaces of a costmap's layers after costmap_2d has moved and copied parameters.

costmap_2d moves and copies parameters before it makes a layer (``costmap_2d_ros.cpp``). Without a
list of ``plugins`` it writes one itself and moves the flat parameters of pre-Hydro files into the
namespaces of its layers (``loadOldParameters``). In either case some of the costmap's own
parameters replace those of the layers (``copyParentParameters``).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from daemon.stacks.findings import FindingCollector, ParameterLocation
from daemon.stacks.ros1.parameters import Entry, ParameterNamespace

STATIC, OBSTACLE = "costmap_2d::StaticLayer", "costmap_2d::ObstacleLayer"
VOXEL, INFLATION = "costmap_2d::VoxelLayer", "costmap_2d::InflationLayer"

COPIED: Final[Mapping[str, tuple[str, ...]]] = {
    STATIC: ("map_topic", "unknown_cost_value", "lethal_cost_threshold", "track_unknown_space"),
    VOXEL: (
        *("origin_z", "z_resolution", "z_voxels", "mark_threshold", "unknown_threshold"),
        "publish_voxel_map",
    ),
    OBSTACLE: ("max_obstacle_height", "raytrace_range", "obstacle_range", "track_unknown_space"),
    INFLATION: ("cost_scaling_factor", "inflation_radius"),
}
"""Names that costmap_2d copies into layers, by their type (``copyParentParameters``)."""
COPIED_NAMES: Final = frozenset(
    name for names in COPIED.values() for name in names if name != "track_unknown_space"
)
"""The copied names that the costmap itself does not read."""


@dataclass(frozen=True, slots=True)
class PlannedLayer:
    """A layer to be made: its pluginlib type, its place in the list, its namespace."""

    name: str
    type: str
    place: ParameterLocation
    namespace: ParameterNamespace


def plan_layers(
    costmap: ParameterNamespace, report: FindingCollector
) -> tuple[list[PlannedLayer], ParameterNamespace]:
    """Return the layers of a costmap, lowest first, and the remaining namespace of the costmap.

    Warns of each value of a layer that a value of the costmap replaces.
    """
    if "plugins" in costmap.entries:
        planned, own = _listed(costmap, report), costmap
    else:
        planned, own = _load_old_parameters(costmap, report)
    for layer in planned:
        _copy(own.entries, COPIED.get(layer.type, ()), layer.namespace, report)
    return planned, own


def _listed(costmap: ParameterNamespace, report: FindingCollector) -> list[PlannedLayer]:
    plugins = costmap.entries["plugins"]
    if not isinstance(plugins.value, list | tuple):
        report.refuse(plugins.place, "must be a list of layers {name: ..., type: ...}")
        return []
    planned = []
    for index, plugin in enumerate(plugins.value):
        place = (*plugins.place, index)
        entry = plugin if isinstance(plugin, Mapping) else {}
        name, kind = entry.get("name"), entry.get("type")
        if isinstance(name, str) and name and isinstance(kind, str):
            planned.append(PlannedLayer(name, kind, place, costmap.below(name)))
        else:
            report.refuse(place, "must be a layer {name: ..., type: ...}")
    return planned


def _load_old_parameters(
    costmap: ParameterNamespace, report: FindingCollector
) -> tuple[list[PlannedLayer], ParameterNamespace]:
    """Return the layers of a costmap without ``plugins``, and its remaining namespace."""
    own = ParameterNamespace(costmap.path, dict(costmap.entries))
    static, obstacles, inflation = (
        costmap.below(name) for name in ("static_layer", "obstacle_layer", "inflation_layer")
    )

    def move(names: Iterable[str], layer: ParameterNamespace) -> None:
        for name in _copy(own.entries, names, layer, report):
            del own.entries[name]

    planned = []
    if own.value("static_map") is True:
        place = own.entries["static_map"].place
        planned.append(PlannedLayer("static_layer", STATIC, place, static))
        _copy(own.entries, ("track_unknown_space",), static, report)
        move((name for name in COPIED[STATIC] if name != "track_unknown_space"), static)
    kind = VOXEL if own.value("map_type") == "voxel" else OBSTACLE
    if kind == VOXEL:
        move(COPIED[VOXEL], obstacles)
    move(COPIED[OBSTACLE], obstacles)
    move((*own.words("observation_sources"), "observation_sources"), obstacles)
    move(COPIED[INFLATION], inflation)
    planned.append(PlannedLayer("obstacle_layer", kind, costmap.path, obstacles))
    planned.append(PlannedLayer("inflation_layer", INFLATION, costmap.path, inflation))
    return planned, own


def _copy(
    entries: Mapping[str, Entry],
    names: Iterable[str],
    layer: ParameterNamespace,
    report: FindingCollector,
) -> list[str]:
    """Copy the ``names`` from ``entries`` into a layer's namespace, replacing its own.

    Returns the ``names`` that exist, each once.
    """
    existing = list(dict.fromkeys(name for name in names if name in entries))
    for name in existing:
        entry, previous = entries[name], layer.entries.get(name)
        if previous is not None and previous.place != entry.place and previous.value != entry.value:
            message = f"costmap_2d writes the costmap's own {name} over it"
            if not isinstance(entry.value, Mapping):
                message += f", which is {entry.value}"
            report.warn(previous.place, message, "write it in one of the two places")
        layer.entries[name] = entry
    return existing
