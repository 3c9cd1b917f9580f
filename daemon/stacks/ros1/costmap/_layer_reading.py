"""One layer after the other, from what it will read to the value it comes to."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal, TypeAlias

from daemon.stacks.findings import FindingCollector, ParameterFinding, ParameterLocation
from daemon.stacks.ros1.costmap._layers import InflationLayer, Layer, StaticLayer
from daemon.stacks.ros1.costmap._namespaces import (
    INFLATION,
    OBSTACLE,
    STATIC,
    VOXEL,
    ParameterNamespace,
    PlannedLayer,
)
from daemon.stacks.ros1.costmap._obstacle_reading import FETCH, Hearing, read_obstacle_layer
from daemon.stacks.ros1.costmap._sections import (
    INFLATION_WITHOUT_EFFECT,
    STATIC_WITHOUT_EFFECT,
    CostmapSection,
    InflationSection,
    ObstacleSection,
    StaticSection,
    VoxelSection,
)
from daemon.stacks.ros1.parameters import read_section

Frame: TypeAlias = Literal["map", "odom"]
SECTIONS: Final[Mapping[str, type[Any]]] = {
    STATIC: StaticSection,
    OBSTACLE: ObstacleSection,
    VOXEL: VoxelSection,
    FETCH: VoxelSection,
    INFLATION: InflationSection,
}
"""What layers of each type read."""
_REFUSED: Final[Mapping[str, str]] = {
    "range_sensor_layer::RangeSensorLayer": "there are no range sensors here, only lasers",
    "social_navigation_layers::ProxemicLayer": "no people are told of here, there are lasers only",
    "social_navigation_layers::PassingLayer": "no people are told of here, there are lasers only",
    "frontier_exploration::BoundedExploreLayer": "it explores, and here the map is known",
    "spatio_temporal_voxel_layer/SpatioTemporalVoxelLayer": "it needs depth cameras",
}


@dataclass(frozen=True, slots=True)
class CostmapContext:
    """What other parameters of the stack a costmap is read by.

    ``above`` is the namespace around it; ``frames`` are the names frames have, without slashes;
    ``resolve`` makes absolute names of move_base's; ``maps`` are the topics on which the map is
    published; ``may_carry_scan`` tells whether a laser may be on a topic. With ``stops_robot``
    the robot stops when a source of this costmap is late.
    """

    above: ParameterNamespace = field(default_factory=lambda: ParameterNamespace(()))
    frames: Mapping[str, Frame] = field(default_factory=lambda: {"map": "map", "odom": "odom"})
    resolve: Callable[[str], str] = lambda name: f"/{name.lstrip('/')}"
    maps: tuple[str, ...] = ("/map",)
    may_carry_scan: Callable[[str], bool] = lambda topic: True
    stops_robot: bool = False


@dataclass(frozen=True, slots=True)
class LayerReader:
    """Makes layers of what was planned; ``around`` are the namespaces sources search upwards."""

    costmap: CostmapSection
    around: tuple[ParameterNamespace, ...]
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
        near = [kind for kind in SECTIONS if _bare(kind) == _bare(planned.type)]
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

    def _check_values(self, space: ParameterNamespace, read: StaticSection) -> None:
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
