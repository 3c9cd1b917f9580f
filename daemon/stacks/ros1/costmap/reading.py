"""Reader of the namespaces of a costmap and its layers, by the rules of costmap_2d of Noetic.

It refuses values that are not supported, and warns of probable slips and of unread names.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal, TypeAlias, TypeVar

from daemon.stacks.findings import FindingCollector
from daemon.stacks.ros1.costmap.layers import (
    SEARCHED_UPWARDS,
    InflationLayer,
    Layer,
    LayeredCostmap,
    ObservationSource,
    ObstacleLayer,
    StaticLayer,
    VoxelLayer,
    inscribed_radius,
)
from daemon.stacks.ros1.costmap.namespaces import (
    COPIED,
    COPIED_NAMES,
    INFLATION,
    OBSTACLE,
    STATIC,
    VOXEL,
    PlannedLayer,
    plan_layers,
)
from daemon.stacks.ros1.parameters import Entry, ParameterNamespace, Section, read_section
from grammars.text.diagnostics import did_you_mean

M = TypeVar("M", bound=Section)
Frame: TypeAlias = Literal["map", "odom"]
_FETCH: Final = "costmap_2d::FetchDepthLayer"
_LAYERS: Final[Mapping[str, type[Layer]]] = {
    STATIC: StaticLayer,
    OBSTACLE: ObstacleLayer,
    VOXEL: VoxelLayer,
    _FETCH: VoxelLayer,
    INFLATION: InflationLayer,
}
_RANGES: Final = ("obstacle_range", "raytrace_range")
_CLOUDS: Final = ("PointCloud", "PointCloud2")
_SIZE: Final = ("width", "height", "resolution", "origin_x", "origin_y")
_OLD: Final = ("static_map", "map_type")
"""Names that only count without a list of plugins."""
_WAITS: Final = "move_base of Noetic waits for its transform for ever"
_SLASHED: Final = {
    "global_frame": _WAITS,
    "robot_base_frame": _WAITS,
    "sensor_frame": "the costmap of Noetic drops every scan",
}
"""Effect of a slash before a frame (tf2 ``validateFrameId``; amcl alone strips it)."""
_NUMBER: Final = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


@dataclass(frozen=True, slots=True)
class CostmapContext:
    """Other parameters of the stack that a costmap depends on.

    ``above`` is the enclosing namespace. ``frames`` maps names of frames, without slashes, to
    frames. ``resolve`` makes move_base's names absolute. ``maps`` are the topics of the map.
    ``may_carry_scan`` tells whether a laser may be on a topic. With ``stops_robot`` the robot
    stops if a source of this costmap is late.
    """

    above: ParameterNamespace
    frames: Mapping[str, Frame]
    resolve: Callable[[str], str]
    maps: tuple[str, ...]
    may_carry_scan: Callable[[str], bool]
    stops_robot: bool = False


class CostmapReader:
    """Reader of the costmap in a namespace; findings go to ``report``."""

    def __init__(
        self, space: ParameterNamespace, report: FindingCollector, context: CostmapContext
    ) -> None:
        self._report, self._context = report, context
        self._planned, self._own = plan_layers(space, report)

    def read(self) -> LayeredCostmap:
        """Return the costmap with the layers that are on."""
        own = self._own
        costmap = self._read_own()
        read = [(one, self._layer(one, costmap)) for one in self._planned]
        self._check_old_parameters()
        if not costmap.rolling_window and self._shows_map():
            for name in _SIZE:
                self._ignore(own, name, "the map gives the grid its size, its cells and its origin")
        else:
            width, height = (self._whole_metres(costmap, name) for name in ("width", "height"))
            costmap = replace(costmap, width=width, height=height)
        active = [(one, layer) for one, layer in read if layer is not None]
        self._doubt_order(active)
        self._doubt_inflation(costmap, active)
        costmap = replace(costmap, frame=self._frame(costmap))
        return replace(costmap, layers=tuple(layer for _, layer in active))

    def _doubt_order(self, active: Sequence[tuple[PlannedLayer, Layer]]) -> None:
        """Warn of layers that are not inflated, and of maps that overwrite obstacles."""
        layers = [layer for _, layer in active]
        inflating = [n for n, layer in enumerate(layers) if isinstance(layer, InflationLayer)]
        for number, (one, layer) in enumerate(active):
            if inflating and number > inflating[-1]:
                last = active[inflating[-1]][0].name
                message = f"{one.name} comes after {last}: its cells are not inflated"
                self._report.warn(one.place, message, f"put {last} last")
            covered = [each.name for each in layers[:number] if isinstance(each, ObstacleLayer)]
            if covered and isinstance(layer, StaticLayer) and not layer.use_maximum:
                message = f"{one.name} overwrites all that {', '.join(covered)} shows"
                self._report.warn(one.place, message, f"put {one.name} first")

    def _doubt_inflation(
        self, costmap: LayeredCostmap, active: Sequence[tuple[PlannedLayer, Layer]]
    ) -> None:
        """Warn of radii below that of the robot, and of cells above it."""
        corners = replace(costmap, footprint_padding=0.0).padded_footprint()
        inscribed = inscribed_radius(corners)
        if costmap.resolution > corners.max() and costmap.rolling_window:
            message = f"cells of {costmap.resolution:g} m are larger than the robot"
            self._report.warn((*self._own.path, "resolution"), message)
        for one, layer in active:
            if isinstance(layer, InflationLayer) and layer.inflation_radius < inscribed - 1e-6:
                message = (
                    f"inflation_radius {layer.inflation_radius:g} m is below the inscribed radius "
                    f"of the footprint, {inscribed:.3g} m: plans lead where the robot touches walls"
                )
                near = self._context.above.entries | self._own.entries | one.namespace.entries
                names = (name for name in ("inflation_radius", *SEARCHED_UPWARDS) if name in near)
                place = next((near[name].place for name in names), self._own.path)
                self._report.warn(place, message, f"write {inscribed:.3g} or more")

    def _read_own(self) -> LayeredCostmap:
        """Read the costmap without its layers."""
        entries = self._own.entries
        layers = {one.name for one in self._planned}
        copied = {name for one in self._planned for name in COPIED.get(one.type, ())}
        elsewhere = {*layers, *copied, *_RANGES, "plugins", *_OLD}
        # Costmaps often share a file that describes the layers of both.
        idle = dict.fromkeys(sorted(COPIED_NAMES - elsewhere), "no layer of this costmap reads it")
        for name, entry in entries.items():
            if isinstance(entry.value, Mapping):
                if name not in layers:
                    idle[name] = "no layer of this costmap is called that"
            elif name in _OLD and "plugins" in entries:
                idle[name] = "costmap_2d does not read it when there are plugins: the list decides"
        values = {name: entries[name] for name in entries if name not in SEARCHED_UPWARDS}
        space = ParameterNamespace(self._own.path, values | self._body())
        return self._section(LayeredCostmap, space, elsewhere, idle)

    def _section(
        self,
        model: type[M],
        space: ParameterNamespace,
        elsewhere: Collection[str] = (),
        idle: Mapping[str, str] | None = None,
    ) -> M:
        is_silent = model is ObservationSource and space.value("data_type") != "LaserScan"
        for name, effect in _SLASHED.items():
            frame = space.value(name)
            if isinstance(frame, str) and frame.startswith("/") and not is_silent:
                message = f"{frame} begins with a slash, which tf2 refuses: {effect}"
                place = space.entries[name].place
                self._report.refuse(place, message, f"write {frame.lstrip('/')}")
        return read_section(model, space, self._report, without_effect=idle, elsewhere=elsewhere)

    def _ignore(self, space: ParameterNamespace, name: str, reason: str) -> None:
        if name in space.entries:
            self._report.ignore(space.entries[name].place, reason)

    def _shows_map(self) -> bool:
        return any(one.type == STATIC for one in self._planned)

    def _body(self) -> dict[str, Entry]:
        """Return footprint and radius from the nearest enclosing namespace."""
        body: dict[str, Entry] = {
            name: space.entries[name]
            for space in (self._context.above, self._own)
            for name in SEARCHED_UPWARDS
            if name in space.entries
        }
        if "footprint" in body:
            value, place = body["footprint"]
            footprint = Entry(_parse_footprint(value), place)
            if footprint.value in ([], ""):
                del body["footprint"]
            else:
                body["footprint"] = footprint
                if "robot_radius" in body:
                    self._report.ignore(body["robot_radius"].place, "there is a footprint")
        return body

    def _layer(self, planned: PlannedLayer, costmap: LayeredCostmap) -> Layer | None:
        """Return a layer; ``None`` if it is off or not supported."""
        if planned.namespace.value("enabled") is False:
            self._switch_off(planned, costmap)
            return None
        kind = _LAYERS.get(planned.type)
        if kind is None:
            self._refuse_type(planned)
            return None
        if kind is StaticLayer:
            return self._static(planned)
        if kind is InflationLayer:
            return replace(self._section(InflationLayer, planned.namespace), name=planned.name)
        return self._obstacle(planned, VoxelLayer if kind is VoxelLayer else ObstacleLayer, costmap)

    def _switch_off(self, planned: PlannedLayer, costmap: LayeredCostmap) -> None:
        entries = planned.namespace.entries
        if planned.type == STATIC and not costmap.rolling_window:
            message = (
                "a static layer that is off still gives the costmap the size of the map, "
                "which is not supported"
            )
            hint = f"leave the layer {planned.name} out of plugins"
            self._report.refuse(entries["enabled"].place, message, hint)
        for name in entries:
            if name != "enabled":
                self._ignore(planned.namespace, name, f"the layer {planned.name} is off")

    def _refuse_type(self, planned: PlannedLayer) -> None:
        near = [kind for kind in _LAYERS if _bare(kind) == _bare(planned.type)]
        if near:
            message = f'pluginlib knows no layer "{planned.type}"'
            self._report.refuse(planned.place, message, f"write {near[0]}")
            return
        message = f'no layer of type "{planned.type}" is supported'
        hint = (
            f"switch it off (enabled: false under {planned.name}), leave it out of plugins, "
            "or bring the whole stack as a system under test of its own"
        )
        self._report.refuse(planned.place, message, hint)

    def _static(self, planned: PlannedLayer) -> StaticLayer:
        space, report, maps = planned.namespace, self._report, self._context.maps
        layer = self._section(StaticLayer, space)
        topic = self._context.resolve(layer.map_topic)
        if topic not in maps:
            entry = space.entries.get("map_topic")
            message = (
                f"the static layer listens to {topic}, the map of the run is on {', '.join(maps)}"
            )
            hint = (
                f"switch the layer off (enabled: false under {planned.name}), or name the topic "
                "under topics/maps if that is the same map"
            )
            report.refuse(planned.place if entry is None else entry.place, message, hint)
        name, value = "unknown_cost_value", layer.unknown_cost_value
        if value % 256 != 255:
            state = "unknown" if layer.track_unknown_space else "free"
            message = f"{value}: unknown cells of the map become lethal, cells of {value} {state}"
            report.warn(space.entries[name].place, message, "write -1 or leave it out")
        name, value = "lethal_cost_threshold", layer.lethal_cost_threshold
        if value < 1:
            message = f"{value} makes every known cell of the map lethal"
            report.refuse(space.entries[name].place, message, "write 1 to 100")
        return replace(layer, name=planned.name)

    def _obstacle(
        self, planned: PlannedLayer, kind: type[ObstacleLayer], costmap: LayeredCostmap
    ) -> ObstacleLayer:
        space, report = planned.namespace, self._report
        names = space.words("observation_sources")
        layer = self._section(kind, space, names)
        if planned.type == _FETCH:
            message = f"the layer {planned.name} is a voxel layer here: there is no depth camera"
            report.warn(planned.place, message)
        if layer.combination_method not in (0, 1):
            message = f"{layer.combination_method}: what the layer sees never reaches the costmap"
            place = space.entries["combination_method"].place
            report.warn(place, message, "write 1 for the maximum")
        sources = (self._source(name, space) for name in layer.observation_sources.split())
        layer = replace(
            layer,
            name=planned.name,
            sources=tuple(source for source in sources if source is not None),
        )
        if "track_unknown_space" in space.entries:
            return layer
        return replace(layer, track_unknown_space=costmap.track_unknown_space)

    def _source(self, name: str, layer: ParameterNamespace) -> ObservationSource | None:
        """Return a source; ``None`` with a warning for a sensor that no robot has."""
        report, stops = self._report, self._context.stops_robot
        entry = layer.entries.get(name)
        if entry is not None and not isinstance(entry.value, Mapping):
            report.refuse(entry.place, "must be keys with values")
            return None
        space = layer.below(name)
        source = self._section(ObservationSource, self._with_ranges(space, layer))
        topic = self._context.resolve(source.topic or name)
        rate = source.expected_update_rate
        silent = source.data_type in _CLOUDS or not self._context.may_carry_scan(topic)
        if rate > 0.0 and stops and silent:
            message = (
                f"nothing is published on {topic} here, and after {rate:g} s without it move_base "
                "stops the robot for good"
            )
            hint = f"write 0, switch off the layer, or take {name} out of observation_sources"
            report.refuse(space.entries["expected_update_rate"].place, message, hint)
        elif rate > 0.0 and not stops:
            reason = "a late source stops the robot only if it is one of the local costmap"
            self._ignore(space, "expected_update_rate", reason)
        if source.data_type != "LaserScan":
            self._say_unheard(name, layer, source.data_type, topic)
            return None
        reach, cleared = source.obstacle_range, source.raytrace_range
        if source.marking and source.clearing and reach > cleared:
            message = f"{name} marks up to {reach:g} m and clears only up to {cleared:g} m"
            ranges = self._with_ranges(space, layer).entries
            place = next(ranges[key].place for key in _RANGES if key in ranges)
            report.warn(place, message, "write a raytrace_range above the obstacle_range")
        return replace(source, name=name, topic=topic, expected_update_rate=rate if stops else 0.0)

    def _with_ranges(
        self, space: ParameterNamespace, layer: ParameterNamespace
    ) -> ParameterNamespace:
        """Return a source's namespace with ranges from enclosing ones (``searchParam``)."""
        entries = dict(space.entries)
        for above in (layer, self._own, self._context.above):
            for name in _RANGES:
                if name in above.entries:
                    entries.setdefault(name, above.entries[name])
        return ParameterNamespace(space.path, entries)

    def _say_unheard(
        self, name: str, layer: ParameterNamespace, data_type: str, topic: str
    ) -> None:
        space = layer.below(name)
        entry = space.entries.get("data_type") or space.entries.get("topic")
        place = space.path if entry is None else entry.place
        if name not in layer.entries and (names := layer.entries.get("observation_sources")):
            near = [*layer.entries.items(), *self._own.entries.items()]
            described = [key for key, entry in near if isinstance(entry.value, Mapping)]
            message = f'it names "{name}", which has no keys here and waits for a {data_type}'
            self._report.warn(names.place, message, did_you_mean(name, described))
            return
        if data_type not in _CLOUDS:
            message = f'must be LaserScan, PointCloud or PointCloud2 (given: "{data_type}")'
            self._report.refuse(place, message, "move_base ends at once with anything else")
            return
        message = f'the source "{name}" waits for a {data_type} on {topic}'
        if "data_type" not in space.entries:
            message += " (the default data_type)"
        hint = "a run has lasers only, so this source receives nothing"
        self._report.warn(place, message, hint)

    def _check_old_parameters(self) -> None:
        """Check ``static_map`` and ``map_type``."""
        own, report = self._own, self._report
        static = own.entries.get("static_map")
        if "plugins" not in own.entries:
            if static is not None and not isinstance(static.value, bool):
                report.refuse(static.place, f"must be true or false (given: {static.value!r})")
            if own.value("map_type") not in (None, "costmap", "voxel"):
                message = "costmap_2d takes everything but voxel for costmap"
                report.warn(own.entries["map_type"].place, message)
        elif static is not None and static.value is True and not self._shows_map():
            message = "the list of plugins has no static layer, so the costmap shows no map"
            hint = "add {name: static_layer, type: costmap_2d::StaticLayer} or leave it out"
            report.warn(static.place, message, hint)

    def _whole_metres(self, costmap: LayeredCostmap, name: str) -> float:
        """Return a size [m] in whole metres, which costmap_2d requires."""
        size: float = getattr(costmap, name)
        # roscpp rounds to the nearest integer, halves up.
        whole = float(math.floor(size + 0.5))
        if whole == size:
            return size
        place = self._own.entries[name].place
        if whole < 1.0:
            message = f"costmap_2d takes whole metres and rounds {size:g} to 0"
            self._report.refuse(place, message, "write 1 or more")
            return size
        message = f"costmap_2d takes whole metres and rounds {size:g} to {whole:g}"
        self._report.warn(place, message, f"write {whole:g}")
        return whole

    def _frame(self, costmap: LayeredCostmap) -> Frame:
        frames, name = self._context.frames, costmap.global_frame.removeprefix("/")
        if name in frames:
            return frames[name]
        entry = self._own.entries.get("global_frame")
        choices = " nor ".join(
            f"amcl's {'global' if frame == 'map' else 'odom'}_frame_id ({called})"
            for called, frame in frames.items()
        )
        message = f'the frame "{name}" is neither {choices}'
        hint = "write one of them, or its name for amcl"
        self._report.refuse(self._own.path if entry is None else entry.place, message, hint)
        return "map"


def _bare(kind: str) -> str:
    return re.split(r"::|/", kind.strip())[-1]


def _parse_footprint(footprint: Any) -> Any:
    """Parse a footprint in text form, ``"[[0.3, 0.2], ...]"``; other text stays text."""
    if not isinstance(footprint, str):
        return footprint
    try:
        # costmap_2d reads numbers such as .5 and 1. that JSON does not know.
        return json.loads(_NUMBER.sub(lambda match: repr(float(match[0])), footprint))
    except ValueError:
        return footprint.strip()
