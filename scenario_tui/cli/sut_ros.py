"""Configuration of the ROS 1 stack: planners, layers, the lasers of each part."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, Final

from scenario_tui.cli.output import print_line

if TYPE_CHECKING:
    from daemon.campaign import LoadedSut
    from daemon.stacks.ros1.configuration import RosParameters
    from daemon.stacks.ros1.costmap.layers import Layer, LayeredCostmap, ObservationSource

_NOT_ROS_PARAMETERS: Final = frozenset({"layers", "frame", "recovery_behaviors"})
"""Fields of the models that are no parameters, or have no default to show."""
_KINDS: Final = {
    "StaticLayer": "map",
    "ObstacleLayer": "obstacles",
    "VoxelLayer": "obstacles",
    "InflationLayer": "inflation",
}


def described(read: RosParameters) -> dict[str, Any]:
    """Return topics, wiring, planners and costmaps of a configuration for JSON."""
    return {
        "topics": dataclasses.asdict(read.topics),
        "wiring": {part: bool(lasers) for part, lasers in _wiring(read).items()},
        "planners": {
            "global": read.move_base.base_global_planner,
            "local": read.move_base.base_local_planner,
        },
        "costmaps": {
            "global_costmap": _costmap_values(read.global_costmap),
            "local_costmap": _costmap_values(read.local_costmap),
        },
    }


def _costmap_values(costmap: LayeredCostmap) -> dict[str, Any]:
    layers = [{"kind": _KINDS[type(x).__name__], **dataclasses.asdict(x)} for x in costmap.layers]
    return {**dataclasses.asdict(costmap), "layers": layers}


def defaults(sut: LoadedSut, read: RosParameters) -> dict[str, dict[str, Any]]:
    """Return the defaults that apply, by namespace."""
    from daemon.stacks.ros1.planners import GLOBAL, LOCAL, namespace_of

    planners = read.move_base.base_global_planner, read.move_base.base_local_planner
    wide, near = (f"move_base/{namespace_of(name)}" for name in planners)
    namespaces: dict[str, Any] = {
        "amcl": read.amcl,
        "move_base": read.move_base,
        "move_base/global_costmap": read.global_costmap,
        "move_base/local_costmap": read.local_costmap,
        wide: read.global_planner,
        near: read.local_planner,
        "move_base/rotate_recovery": read.rotate_recovery,
        "dispatcher": read.dispatcher,
    }
    left_out = {*_NOT_ROS_PARAMETERS}
    for name, planner in zip(planners, (GLOBAL, LOCAL), strict=True):
        left_out |= set(planner[name].without_effect)
    return {
        namespace: {
            field.name: getattr(model, field.name)
            for field in dataclasses.fields(model)
            if field.name not in left_out | _written_names(sut, namespace)
        }
        for namespace, model in namespaces.items()
    }


def _written_names(sut: LoadedSut, namespace: str) -> set[str]:
    """Return the names written in a namespace, or in others where ROS looks for them."""
    above = tuple(namespace.split("/"))
    spaces = [above]
    if namespace.endswith("rotate_recovery"):
        # rotate_recovery takes its speeds from there (rotate_recovery.cpp, initialize).
        spaces.append(("move_base", "TrajectoryPlannerROS"))
    names = {path[-1] for path in sut.settings if path[:-1] in spaces}
    if namespace.endswith("costmap"):
        from daemon.stacks.ros1.costmap.layers import SEARCHED_UPWARDS

        names |= {name for name in SEARCHED_UPWARDS if ("move_base", name) in sut.settings}
    return names


def print_costmaps(read: RosParameters) -> None:
    """Print the planners, and the layers of both costmaps from the lowest up."""
    move_base = read.move_base
    print_line("\nplanners and costmaps", style="bold")
    plan, drive = move_base.base_global_planner, move_base.base_local_planner
    print_line(f"  {plan} plans, {drive} drives")
    for name in ("global_costmap", "local_costmap"):
        costmap: LayeredCostmap = getattr(read, name)
        title = name.replace("_", " ")
        rolls = ", rolling" if costmap.rolling_window else ""
        unknown = ", unknown space tracked" if costmap.track_unknown_space else ""
        print_line(f"  {title} in {costmap.frame}, {costmap.update_frequency:g} Hz{rolls}{unknown}")
        for layer in costmap.layers:
            print_line(f"    {_layer_text(layer)}")


def _layer_text(layer: Layer) -> str:
    from daemon.stacks.ros1.costmap.layers import InflationLayer, StaticLayer, VoxelLayer

    if isinstance(layer, StaticLayer):
        unknown = "" if layer.track_unknown_space else ", unknown cells free"
        return f"{layer.name}: the map{unknown}{', by maximum' if layer.use_maximum else ''}"
    if isinstance(layer, InflationLayer):
        falls = f"cost_scaling_factor {layer.cost_scaling_factor:g}"
        return f"{layer.name}: inflates by {layer.inflation_radius:g} m, {falls}"
    parts = [_source_text(source) for source in layer.sources] or ["no laser"]
    if isinstance(layer, VoxelLayer):
        parts.insert(0, f"{layer.z_voxels} voxels of {layer.z_resolution:g} m")
    return f"{layer.name}: {'; '.join(parts)}"


def _source_text(source: ObservationSource) -> str:
    does = []
    if source.marking:
        does.append(f"marks to {source.obstacle_range:g} m")
    if source.clearing:
        does.append(f"clears to {source.raytrace_range:g} m")
    keeps = source.observation_persistence
    memory = f", keeps {keeps:g} s" if keeps > 0.0 else ""
    return f"{source.name} on {source.topic} {' and '.join(does) or 'does nothing'}{memory}"


def _wiring(read: RosParameters) -> dict[str, tuple[str, ...]]:
    """Return the lasers in the file that each part of the stack hears."""
    return dataclasses.asdict(read.topics.wire(read.topics.lasers()))


def print_wiring(read: RosParameters) -> None:
    """Print the topics of lasers, and their listeners."""
    topics = read.topics
    if topics.by_laser:
        print_line("\nlasers come on", style="bold")
        for laser, named in topics.by_laser.items():
            print_line(f"  {laser}: {', '.join(named)}")
    else:
        print_line(f"\nthe scan comes on {topics.published}", style="bold")
    heard_by = _wiring(read)
    listeners = {
        "amcl": (topics.amcl,),
        "global costmap": topics.global_costmap,
        "local costmap": topics.local_costmap,
    }
    for name, listens in listeners.items():
        lasers = heard_by[name.replace(" ", "_")]
        answer = "hears it" if lasers else "does not hear it"
        if topics.by_laser:
            answer = f"hears {', '.join(lasers)}" if lasers else "hears no laser"
        print_line(
            f"  {name} listens to {', '.join(listens) or 'nothing'}: {answer}",
            style="" if lasers else "yellow",
        )
