"""Namespaces of a costmap's layers as the layers find them.

costmap_2d moves and copies parameters before it makes a layer (``costmap_2d_ros.cpp``). Without a
list of ``plugins`` it writes one itself and moves the flat parameters of pre-Hydro files into the
namespaces of its layers (``loadOldParameters``). In either case it copies some of the costmap's own
parameters into them (``copyParentParameters``). They replace what stood there.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from daemon.stacks.findings import FindingCollector, ParameterLocation

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
"""Names that layers of a type get from the costmap's own namespace (``copyParentParameters``)."""
COPIED_NAMES: Final = frozenset(
    name for names in COPIED.values() for name in names if name != "track_unknown_space"
)
"""Those of them that the costmap itself does not read."""


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
        """Return the namespace ``name`` in this one, empty if it does not exist."""
        written = self.entries.get(name)
        if written is None or not isinstance(written.value, Mapping):
            return ParameterNamespace((*self.path, name))
        return ParameterNamespace.of(written.value, written.place)

    def value(self, name: str) -> Any:
        """Return the value of ``name``, ``None`` if nobody wrote one."""
        written = self.entries.get(name)
        return None if written is None else written.value

    def words(self, name: str) -> list[str]:
        """Return the words of the text ``name``; no text has none."""
        text = self.value(name)
        return text.split() if isinstance(text, str) else []


@dataclass(frozen=True, slots=True)
class PlannedLayer:
    """A layer to be made: its type as pluginlib knows it, where it is listed, what it will read."""

    name: str
    type: str
    place: ParameterLocation
    namespace: ParameterNamespace


def plan_layers(
    costmap: ParameterNamespace, report: FindingCollector
) -> tuple[list[PlannedLayer], ParameterNamespace]:
    """Return the layers of a costmap, lowest first, and the costmap's namespace without the moved.

    Warns of each value of a layer that the costmap's own replaces.
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
    """Return the layers of a costmap without ``plugins``, and what is not moved into them."""
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
    entries: Mapping[str, Written],
    names: Iterable[str],
    layer: ParameterNamespace,
    report: FindingCollector,
) -> list[str]:
    """Write ``entries`` into a layer's namespace in place of what stands there.

    Returns those of ``names`` that there are, each once.
    """
    existing = list(dict.fromkeys(name for name in names if name in entries))
    for name in existing:
        written, before = entries[name], layer.entries.get(name)
        if before is not None and before.place != written.place and before.value != written.value:
            message = f"costmap_2d writes the costmap's own {name} over it"
            if not isinstance(written.value, Mapping):
                message += f", which is {written.value}"
            report.warn(before.place, message, "write it in one of the two places")
        layer.entries[name] = written
    return existing
