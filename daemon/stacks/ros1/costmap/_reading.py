"""From the namespace of a costmap to its layers, as costmap_2d of Noetic reads them.

What cannot be honoured is refused at its line; what is probably a slip, and what nobody reads, is
said and lived with.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import Any, Final

from daemon.stacks.findings import FindingCollector, ParameterFinding, ParameterLocation
from daemon.stacks.ros1.costmap._layer_reading import SECTIONS, CostmapContext, Frame, LayerReader
from daemon.stacks.ros1.costmap._layers import LayeredCostmap
from daemon.stacks.ros1.costmap._namespaces import (
    STATIC,
    ParameterNamespace,
    PlannedLayer,
    plan_layers,
)
from daemon.stacks.ros1.costmap._obstacle_reading import looks_like_source
from daemon.stacks.ros1.costmap._sections import (
    COSTMAP_WITHOUT_EFFECT,
    STATIC_WITHOUT_EFFECT,
    VOXEL_WITHOUT_EFFECT,
    BodySection,
    CostmapSection,
)
from daemon.stacks.ros1.parameters import read_section

_BODY: Final = tuple(f.name for f in fields(BodySection))
_SIZE: Final = ("width", "height", "resolution", "origin_x", "origin_y")
_NUMBER: Final = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


def read_costmap(
    given: Mapping[str, Any],
    path: ParameterLocation,
    report: FindingCollector,
    context: CostmapContext | None = None,
) -> LayeredCostmap:
    """Return the costmap in the namespace ``given`` at ``path``; findings go to ``report``."""
    context = context or CostmapContext()
    costmap = ParameterNamespace.of(given, path)
    planned, moved = plan_layers(costmap, report)
    own = ParameterNamespace(path, {n: w for n, w in costmap.entries.items() if n not in moved})
    section = _read_own(own, planned, report)
    reader = LayerReader(section, (own, context.above), context, report)
    layers = tuple(layer for one in planned if (layer := reader.read(one)) is not None)
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
    own: ParameterNamespace, planned: tuple[PlannedLayer, ...], report: FindingCollector
) -> CostmapSection:
    """Read what the costmap itself reads, and say what of the rest reaches nobody."""
    names = {one.name for one in planned}
    elsewhere = {"plugins", "static_map", "map_type", "obstacle_range", "raytrace_range", *_BODY}
    known = {f.name for section in SECTIONS.values() for f in fields(section)}
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
    own: ParameterNamespace, name: str, planned: tuple[PlannedLayer, ...], report: FindingCollector
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
    own: ParameterNamespace, name: str, planned: tuple[PlannedLayer, ...], report: FindingCollector
) -> None:
    """Say that a parameter of layers does not get from the costmap's own namespace to them."""
    written = own.entries[name]
    if any(written == one.namespace.entries.get(name) for one in planned):
        return  # it was copied
    readers = [
        one.name
        for one in planned
        if one.type in SECTIONS and name in {f.name for f in fields(SECTIONS[one.type])}
    ]
    own_values = all(name in one.namespace.entries for one in planned if one.name in readers)
    if not readers or own_values:
        reason = "the layers have their own" if readers else "no layer of this costmap reads it"
        report.without_effect.append(ParameterFinding(written.place, reason))
        return
    message = f"does not reach the layer {readers[0]}: costmap_2d does not look for it here"
    report.problems.append(ParameterFinding(written.place, message, f"write it under {readers[0]}"))


def _check_old_parameters(
    own: ParameterNamespace, planned: tuple[PlannedLayer, ...], report: FindingCollector
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


def _say_idle(
    own: ParameterNamespace, names: Iterable[str], reason: str, report: FindingCollector
) -> None:
    for name in names:
        if name in own.entries:
            report.without_effect.append(ParameterFinding(own.entries[name].place, reason))


def _whole_metres(
    own: ParameterNamespace, name: str, size: float, report: FindingCollector
) -> float:
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
    own: ParameterNamespace,
    section: CostmapSection,
    context: CostmapContext,
    report: FindingCollector,
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


def _read_body(
    own: ParameterNamespace, above: ParameterNamespace, report: FindingCollector
) -> BodySection:
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
