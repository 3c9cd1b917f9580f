"""Which values the namespaces of a costmap's layers hold when the layers read them.

costmap_2d moves and copies parameters before it makes a layer (``costmap_2d_ros.cpp``). Without a
list of ``plugins`` it writes one itself and moves the flat parameters of pre-Hydro files into the
namespaces of its layers (``loadOldParameters``); in either case it copies some of the costmap's own
parameters into them (``copyParentParameters``). What it moves or copies replaces what stood there.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from daemon.stacks.findings import FindingCollector, ParameterFinding, ParameterLocation

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
"""What layers of a type get from the costmap's own namespace (``copyParentParameters``)."""
_MOVED_TO_OBSTACLES: Final = (
    *("max_obstacle_height", "raytrace_range", "obstacle_range", "track_unknown_space"),
)


@dataclass(frozen=True, slots=True)
class Written:
    """A value and where it stands."""

    value: Any
    place: ParameterLocation


@dataclass(slots=True)
class ParameterNamespace:
    """The parameters of one namespace by name; values of namespaces below it are mappings."""

    path: ParameterLocation
    entries: dict[str, Written] = field(default_factory=dict)

    @classmethod
    def of(cls, given: Mapping[str, Any], path: ParameterLocation) -> ParameterNamespace:
        """Return the namespace that stands at ``path``."""
        return cls(path, {name: Written(value, (*path, name)) for name, value in given.items()})

    def below(self, name: str) -> ParameterNamespace:
        """Return the namespace ``name`` in this one; empty when there is none."""
        written = self.entries.get(name)
        if written is None or not isinstance(written.value, Mapping):
            return ParameterNamespace((*self.path, name))
        return ParameterNamespace.of(written.value, written.place)

    def values(self, names: Iterable[str] | None = None) -> dict[str, Any]:
        """Return the values of ``names``, all when none are given, as far as they are there."""
        wanted = self.entries if names is None else [n for n in names if n in self.entries]
        return {name: self.entries[name].value for name in wanted}

    def places(self) -> dict[str, ParameterLocation]:
        """Return where each value stands."""
        return {name: written.place for name, written in self.entries.items()}


@dataclass(frozen=True, slots=True)
class PlannedLayer:
    """A layer to be made: its type as pluginlib knows it, where it is listed, what it will read."""

    name: str
    type: str
    place: ParameterLocation
    namespace: ParameterNamespace


def plan_layers(
    costmap: ParameterNamespace, report: FindingCollector
) -> tuple[tuple[PlannedLayer, ...], frozenset[str]]:
    """Return the layers of a costmap, lowest first, and the names taken out of its namespace.

    Values of a layer that are replaced by the costmap's own are said to be.
    """
    if "plugins" in costmap.entries:
        listed = _listed(costmap.entries["plugins"], report)
        moved: frozenset[str] = frozenset()
        spaces = {name: costmap.below(name) for name, _, _ in listed}
    else:
        listed, spaces, moved = _load_old_parameters(costmap, report)
    left = {name: w for name, w in costmap.entries.items() if name not in moved}
    for name, kind, _ in listed:
        _put(spaces[name], {n: left[n] for n in COPIED.get(kind, ()) if n in left}, report)
    layers = (PlannedLayer(name, kind, place, spaces[name]) for name, kind, place in listed)
    return tuple(layers), moved


def _listed(plugins: Written, report: FindingCollector) -> list[tuple[str, str, ParameterLocation]]:
    if not isinstance(plugins.value, list | tuple):
        report.fatal.append(
            ParameterFinding(plugins.place, "must be a list of layers {name: ..., type: ...}")
        )
        return []
    found = []
    for index, plugin in enumerate(plugins.value):
        place = (*plugins.place, index)
        entry = plugin if isinstance(plugin, Mapping) else {}
        name, kind = entry.get("name"), entry.get("type")
        if not (isinstance(name, str) and name and isinstance(kind, str)):
            report.fatal.append(ParameterFinding(place, "must be a layer {name: ..., type: ...}"))
            continue
        found.append((name, kind, place))
    return found


def _load_old_parameters(
    costmap: ParameterNamespace, report: FindingCollector
) -> tuple[list[tuple[str, str, ParameterLocation]], dict[str, ParameterNamespace], frozenset[str]]:
    """Return the layers of a costmap without ``plugins``, and what is moved into them."""
    entries = costmap.entries
    spaces = {n: costmap.below(n) for n in ("static_layer", "obstacle_layer", "inflation_layer")}
    listed: list[tuple[str, str, ParameterLocation]] = []
    moved: set[str] = set()

    def move(names: Iterable[str], layer: str) -> None:
        there = {name: entries[name] for name in names if name in entries and name not in moved}
        _put(spaces[layer], there, report)
        moved.update(there)

    if "static_map" in entries and entries["static_map"].value is True:
        listed.append(("static_layer", STATIC, entries["static_map"].place))
        _put(spaces["static_layer"], _of(entries, ("track_unknown_space",)), report)
        move((n for n in COPIED[STATIC] if n != "track_unknown_space"), "static_layer")
    voxels = "map_type" in entries and entries["map_type"].value == "voxel"
    listed.append(("obstacle_layer", VOXEL if voxels else OBSTACLE, costmap.path))
    if voxels:
        move(COPIED[VOXEL], "obstacle_layer")
    move(_MOVED_TO_OBSTACLES, "obstacle_layer")
    sources = entries["observation_sources"].value if "observation_sources" in entries else ""
    if isinstance(sources, str):
        move(sources.split(), "obstacle_layer")
    move(("observation_sources",), "obstacle_layer")
    listed.append(("inflation_layer", INFLATION, costmap.path))
    move(COPIED[INFLATION], "inflation_layer")
    return listed, spaces, frozenset(moved)


def _of(entries: Mapping[str, Written], names: Iterable[str]) -> dict[str, Written]:
    return {name: entries[name] for name in names if name in entries}


def _put(
    layer: ParameterNamespace, entries: Mapping[str, Written], report: FindingCollector
) -> None:
    """Write ``entries`` into a layer's namespace in place of what stands there."""
    for name, written in entries.items():
        before = layer.entries.get(name)
        if before is not None and before.place != written.place and before.value != written.value:
            message = f"costmap_2d writes the costmap's own {name} over it"
            if not isinstance(written.value, Mapping):
                message += f", which is {written.value}"
            report.problems.append(
                ParameterFinding(before.place, message, "write it in one of the two places")
            )
        layer.entries[name] = written
