"""From the namespace of a costmap to its layers, as costmap_2d of Noetic reads them.

What cannot be honoured is refused at its line; what is probably a slip, and what nobody reads, is
said and lived with.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Final, Literal

from daemon.stacks.findings import FindingCollector, ParameterFinding, ParameterLocation
from daemon.stacks.ros1.costmap._layers import InflationLayer, Layer, LayeredCostmap, StaticLayer
from daemon.stacks.ros1.costmap._namespaces import (
    INFLATION,
    OBSTACLE,
    STATIC,
    VOXEL,
    Namespace,
    PlannedLayer,
    plan_layers,
)
from daemon.stacks.ros1.costmap._obstacle_reading import (
    FETCH,
    Hearing,
    looks_like_source,
    read_obstacle_layer,
)
from daemon.stacks.ros1.costmap._sections import (
    COSTMAP_WITHOUT_EFFECT,
    INFLATION_WITHOUT_EFFECT,
    STATIC_WITHOUT_EFFECT,
    VOXEL_WITHOUT_EFFECT,
    BodySection,
    CostmapSection,
    InflationSection,
    ObstacleSection,
    StaticSection,
    VoxelSection,
)
from daemon.stacks.ros1.parameters import read_section

Frame = Literal["map", "odom"]

_SECTIONS: Final[Mapping[str, type[Any]]] = {
    STATIC: StaticSection,
    OBSTACLE: ObstacleSection,
    VOXEL: VoxelSection,
    FETCH: VoxelSection,
    INFLATION: InflationSection,
}
_REFUSED: Final[Mapping[str, str]] = {
    "range_sensor_layer::RangeSensorLayer": "there are no range sensors here, only lasers",
    "social_navigation_layers::ProxemicLayer": "nothing here says where people are, but lasers",
    "social_navigation_layers::PassingLayer": "nothing here says where people are, but lasers",
    "frontier_exploration::BoundedExploreLayer": "it explores, and here the map is known",
    "spatio_temporal_voxel_layer/SpatioTemporalVoxelLayer": "it needs depth cameras",
}
_BODY: Final = tuple(f.name for f in fields(BodySection))
_SIZE: Final = ("width", "height", "resolution", "origin_x", "origin_y")
_NUMBER: Final = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


@dataclass(frozen=True, slots=True)
class CostmapContext:
    """What other parameters of the stack a costmap is read by.

    ``above`` is the namespace around it; ``frames`` are the names frames have, without slashes;
    ``resolve`` makes absolute names of move_base's; ``maps`` are the topics on which the map is
    published; ``may_carry_scan`` tells whether a laser may be on a topic. With ``stops_robot``
    the robot stops when a source of this costmap is late.
    """

    above: Namespace = field(default_factory=lambda: Namespace(()))
    frames: Mapping[str, Frame] = field(default_factory=lambda: {"map": "map", "odom": "odom"})
    resolve: Callable[[str], str] = lambda name: f"/{name.lstrip('/')}"
    maps: tuple[str, ...] = ("/map",)
    may_carry_scan: Callable[[str], bool] = lambda topic: True
    stops_robot: bool = False


def read_costmap(
    given: Mapping[str, Any],
    path: ParameterLocation,
    report: FindingCollector,
    context: CostmapContext | None = None,
) -> LayeredCostmap:
    """Return the costmap in the namespace ``given`` at ``path``; findings go to ``report``."""
    context = context or CostmapContext()
    costmap = Namespace.of(given, path)
    planned, moved = plan_layers(costmap, report)
    own = Namespace(path, {n: w for n, w in costmap.entries.items() if n not in moved})
    # Findings stand in traces: what is said of sources has always come first there.
    later = FindingCollector()
    section = _read_own(own, planned, later)
    reader = _LayerReader(section, (own, context.above), context, report)
    layers = tuple(layer for one in planned if (layer := reader.read(one)) is not None)
    report.add(later)
    _check_old_parameters(own, planned, report)
    body = _read_body(own, context.above, report)
    sized = not section.rolling_window and any(one.type == STATIC for one in planned)
    if sized:
        _say_idle(own, _SIZE, "the map gives the grid its size, its cells and its origin", report)
    return LayeredCostmap(
        layers=layers,
        frame=_frame(own, section, context, report),
        update_frequency=section.update_frequency,
        publish_frequency=section.publish_frequency,
        rolling_window=section.rolling_window,
        width=section.width if sized else _whole_metres(own, "width", section.width, report),
        height=section.height if sized else _whole_metres(own, "height", section.height, report),
        resolution=section.resolution,
        origin_x=section.origin_x,
        origin_y=section.origin_y,
        track_unknown_space=section.track_unknown_space,
        footprint=body.footprint,
        robot_radius=body.robot_radius,
        footprint_padding=section.footprint_padding,
    )


def _read_own(
    own: Namespace, planned: tuple[PlannedLayer, ...], report: FindingCollector
) -> CostmapSection:
    """Read what the costmap itself reads, and say what of the rest reaches nobody."""
    names = {one.name for one in planned}
    elsewhere = {"plugins", "static_map", "map_type", "obstacle_range", "raytrace_range", *_BODY}
    known = {f.name for section in _SECTIONS.values() for f in fields(section)}
    known |= {*STATIC_WITHOUT_EFFECT, *VOXEL_WITHOUT_EFFECT}
    for name, written in own.entries.items():
        if name in {f.name for f in fields(CostmapSection)} | elsewhere:
            continue
        if isinstance(written.value, Mapping):
            if name not in names:
                _say_unread_namespace(own, name, planned, report)
            elsewhere.add(name)
        elif name in known - set(COSTMAP_WITHOUT_EFFECT):
            _say_out_of_reach(own, name, planned, report)
            elsewhere.add(name)
    return read_section(
        CostmapSection,
        own.values(),
        own.path,
        report,
        without_effect=COSTMAP_WITHOUT_EFFECT,
        elsewhere=frozenset(elsewhere | names),
    )


def _say_unread_namespace(
    own: Namespace, name: str, planned: tuple[PlannedLayer, ...], report: FindingCollector
) -> None:
    written = own.entries[name]
    hearing = [one.name for one in planned if name in _listed_sources(one)]
    if hearing:
        message = f'does not reach the layer {hearing[0]}, whose source "{name}" then has defaults'
        hint = f"write it under {hearing[0]}"
        report.problems.append(ParameterFinding(written.place, message, hint))
        return
    # Costmaps often share a file that describes the layers and the sources of both.
    reason = "no layer of this costmap is called that"
    if looks_like_source(written.value):
        reason = "observation_sources does not name it"
    report.without_effect.append(ParameterFinding(written.place, reason))


def _listed_sources(planned: PlannedLayer) -> list[str]:
    written = planned.namespace.entries.get("observation_sources")
    return written.value.split() if written and isinstance(written.value, str) else []


def _say_out_of_reach(
    own: Namespace, name: str, planned: tuple[PlannedLayer, ...], report: FindingCollector
) -> None:
    """Say that a parameter of layers does not get from the costmap's own namespace to them."""
    written = own.entries[name]
    if any(written == one.namespace.entries.get(name) for one in planned):
        return  # it was copied
    readers = [
        one.name
        for one in planned
        if one.type in _SECTIONS and name in {f.name for f in fields(_SECTIONS[one.type])}
    ]
    own_values = all(name in one.namespace.entries for one in planned if one.name in readers)
    if not readers or own_values:
        reason = "the layers have their own" if readers else "no layer of this costmap reads it"
        report.without_effect.append(ParameterFinding(written.place, reason))
        return
    message = f"does not reach the layer {readers[0]}: costmap_2d does not look for it here"
    report.problems.append(ParameterFinding(written.place, message, f"write it under {readers[0]}"))


def _check_old_parameters(
    own: Namespace, planned: tuple[PlannedLayer, ...], report: FindingCollector
) -> None:
    """Check ``static_map`` and ``map_type``, which only count when there is no list of plugins."""
    layered = "plugins" in own.entries
    for name in ("static_map", "map_type"):
        written = own.entries.get(name)
        if written is None or (isinstance(written.value, Mapping) and layered):
            continue
        if layered:
            reason = "costmap_2d does not read it when there are plugins: the list decides"
            report.without_effect.append(ParameterFinding(written.place, reason))
        elif name == "static_map" and not isinstance(written.value, bool):
            message = f"must be true or false (given: {written.value!r})"
            report.fatal.append(ParameterFinding(written.place, message))
        elif name == "map_type" and written.value not in ("costmap", "voxel"):
            message = "costmap_2d takes everything but voxel for costmap"
            report.problems.append(ParameterFinding(written.place, message))
    static = own.entries.get("static_map")
    without = layered and not any(one.type == STATIC for one in planned)
    if without and static is not None and static.value is True:
        message = "there are plugins, and none of them is a static layer: no map is shown"
        hint = "add {name: static_layer, type: costmap_2d::StaticLayer} or leave it out"
        report.problems.append(ParameterFinding(static.place, message, hint))


def _say_idle(own: Namespace, names: Iterable[str], reason: str, report: FindingCollector) -> None:
    for name in names:
        if name in own.entries:
            report.without_effect.append(ParameterFinding(own.entries[name].place, reason))


def _whole_metres(own: Namespace, name: str, size: float, report: FindingCollector) -> float:
    """Return the size [m] as costmap_2d has it, whose parameter is a whole number."""
    # roscpp rounds to the nearest, halves up, where a whole number is asked for.
    whole = float(math.floor(size + 0.5))
    if whole == size:
        return size
    place = own.entries[name].place
    if whole < 1.0:
        message = f"costmap_2d takes whole metres: {size:g} is none at all"
        report.fatal.append(ParameterFinding(place, message, "write 1 or more"))
        return size
    message = f"costmap_2d takes whole metres: {size:g} is {whole:g} to it"
    report.problems.append(ParameterFinding(place, message, f"write {whole:g}"))
    return whole


def _frame(
    own: Namespace, section: CostmapSection, context: CostmapContext, report: FindingCollector
) -> Frame:
    name = section.global_frame.strip("/")
    if name in context.frames:
        return context.frames[name]
    place = own.entries["global_frame"].place if "global_frame" in own.entries else own.path
    known = " nor ".join(
        f"{role} ({called})"
        for called, frame in context.frames.items()
        for role in [f"amcl's {'global' if frame == 'map' else 'odom'}_frame_id"]
    )
    message = f'the frame "{name}" is neither {known}'
    hint = "write one of them, or its name for amcl"
    report.fatal.append(ParameterFinding(place, message, hint))
    return "map"


def _read_body(own: Namespace, above: Namespace, report: FindingCollector) -> BodySection:
    """Read footprint and radius from the nearest namespace upwards that has them."""
    values: dict[str, Any] = {}
    places: dict[str, ParameterLocation] = {}
    for name in _BODY:
        there = [space.entries[name] for space in (own, above) if name in space.entries]
        if there:
            values[name], places[name] = there[0].value, there[0].place
    if "footprint" in values:
        values["footprint"] = _parse_footprint(values["footprint"])
        if values["footprint"] in ([], ""):
            del values["footprint"]
        elif "robot_radius" in values:
            reason = "there is a footprint"
            report.without_effect.append(ParameterFinding(places["robot_radius"], reason))
    return read_section(BodySection, values, own.path, report, places=places)


def _parse_footprint(footprint: Any) -> Any:
    """Read a footprint written as text, ``"[[0.3, 0.2], ...]"``; what is none stays text."""
    if not isinstance(footprint, str):
        return footprint
    try:
        # costmap_2d reads numbers such as .5 and 1. that JSON does not know.
        return json.loads(_NUMBER.sub(lambda found: repr(float(found[0])), footprint))
    except ValueError:
        return footprint.strip()


@dataclass(frozen=True, slots=True)
class _LayerReader:
    """Makes layers of what was planned; ``around`` are the namespaces sources search upwards."""

    costmap: CostmapSection
    around: tuple[Namespace, ...]
    context: CostmapContext
    report: FindingCollector

    def read(self, planned: PlannedLayer) -> Layer | None:
        """Return a layer; none for one that is off or cannot be honoured."""
        enabled = planned.namespace.entries.get("enabled")
        if enabled is not None and enabled.value is False:
            self._take_away(planned)
            return None
        if planned.type == STATIC:
            return self._static(planned)
        if planned.type == INFLATION:
            return self._inflation(planned)
        if planned.type in (OBSTACLE, VOXEL, FETCH):
            context = self.context
            hearing = Hearing(context.resolve, context.may_carry_scan, context.stops_robot)
            return read_obstacle_layer(
                planned,
                self.around,
                hearing,
                self.report,
                track_unknown_space=self.costmap.track_unknown_space,
            )
        self._refuse(planned)
        return None

    def _take_away(self, planned: PlannedLayer) -> None:
        if planned.type == STATIC and not self.costmap.rolling_window:
            place = planned.namespace.entries["enabled"].place
            message = (
                "a static layer that is off still gives the costmap the size of the map, "
                "which is not supported"
            )
            hint = f"leave the layer {planned.name} out of plugins"
            self.report.fatal.append(ParameterFinding(place, message, hint))
        for name, written in planned.namespace.entries.items():
            if name != "enabled":
                reason = f"the layer {planned.name} is off"
                self.report.without_effect.append(ParameterFinding(written.place, reason))

    def _refuse(self, planned: PlannedLayer) -> None:
        near = [kind for kind in _SECTIONS if _bare(kind) == _bare(planned.type)]
        if near:
            message = f'pluginlib knows no layer "{planned.type}"'
            finding = ParameterFinding(planned.place, message, f"write {near[0]}")
        else:
            why = _REFUSED.get(planned.type)
            message = f'no layer of type "{planned.type}" is supported'
            hint = (
                f"switch it off (enabled: false under {planned.name}), leave it out of plugins, "
                "or bring the whole stack as a system under test of its own"
            )
            finding = ParameterFinding(planned.place, f"{message}: {why}" if why else message, hint)
        self.report.fatal.append(finding)

    def _static(self, planned: PlannedLayer) -> StaticLayer:
        space = planned.namespace
        read = read_section(
            StaticSection,
            space.values(),
            space.path,
            self.report,
            without_effect=STATIC_WITHOUT_EFFECT,
            places=space.places(),
        )
        topic = self.context.resolve(read.map_topic)
        if topic not in self.context.maps:
            place = space.places().get("map_topic", planned.place)
            message = (
                f"the static layer listens to {topic}, the map of the run is on "
                f"{', '.join(self.context.maps)}"
            )
            hint = (
                f"switch the layer off (enabled: false under {planned.name}), or name the topic "
                "under topics/maps if that is the same map"
            )
            self.report.fatal.append(ParameterFinding(place, message, hint))
        self._check_values(space, read)
        return StaticLayer(planned.name, read.track_unknown_space, read.use_maximum)

    def _check_values(self, space: Namespace, read: StaticSection) -> None:
        """Refuse what would turn the meaning of the map's three values around."""
        places = space.places()
        # Unknown cells of a map are -1, as an unsigned byte 255 (``interpretValue``).
        if read.unknown_cost_value % 256 != 255:
            message = f"{read.unknown_cost_value} would make the unknown cells of the map lethal"
            place = places["unknown_cost_value"]
            self.report.fatal.append(ParameterFinding(place, message, "write -1 or leave it out"))
        elif "unknown_cost_value" in places:
            self._idle(places["unknown_cost_value"])
        if read.lethal_cost_threshold < 1:
            message = f"{read.lethal_cost_threshold} makes every known cell of the map lethal"
            place = places["lethal_cost_threshold"]
            self.report.fatal.append(ParameterFinding(place, message, "write 1 to 100"))
        elif "lethal_cost_threshold" in places:
            self._idle(places["lethal_cost_threshold"])

    def _idle(self, place: ParameterLocation) -> None:
        reason = STATIC_WITHOUT_EFFECT["trinary_costmap"]
        self.report.without_effect.append(ParameterFinding(place, reason))

    def _inflation(self, planned: PlannedLayer) -> InflationLayer:
        space = planned.namespace
        read = read_section(
            InflationSection,
            space.values(),
            space.path,
            self.report,
            without_effect=INFLATION_WITHOUT_EFFECT,
            places=space.places(),
        )
        return InflationLayer(
            planned.name, read.inflation_radius, read.cost_scaling_factor, read.inflate_unknown
        )


def _bare(kind: str) -> str:
    return re.split(r"::|/", kind.strip())[-1]
