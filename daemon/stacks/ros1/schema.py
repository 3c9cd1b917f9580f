"""JSON Schema of the stack's parameters for editors, section by section."""

from __future__ import annotations

from typing import Any, Final, TypeAlias

from daemon.stacks.ros1 import amcl, move_base
from daemon.stacks.ros1.configuration import GLOBAL, LOCAL, namespace_of
from daemon.stacks.ros1.costmap import layers
from daemon.stacks.ros1.parameters import Section
from daemon.stacks.ros1.quirks import DEFAULT_PROFILE, PROFILES, Quirks
from daemon.stacks.ros1.wiring import TopicParameters
from grammars.editor import editor_schema, nullable

Schema: TypeAlias = dict[str, Any]
_LAYER_TYPES: Final = [
    "costmap_2d::StaticLayer",
    "costmap_2d::ObstacleLayer",
    "costmap_2d::VoxelLayer",
    "costmap_2d::InflationLayer",
]


def ros_definitions() -> dict[str, Schema]:
    """Return the sections of the tree of ROS parameters, and the whole tree as ``ros``.

    The schema allows unknown names, since ``scenario check`` warns of them. ``null`` removes an
    inherited value.
    """
    definitions: dict[str, Schema] = {}
    planners = {namespace_of(plugin): entry for plugin, entry in {**GLOBAL, **LOCAL}.items()}
    sections: dict[str, type[Any]] = {
        "amcl": amcl.AmclParameters,
        "costmap": layers.LayeredCostmap,
        "source": layers.ObservationSource,
        "static_layer": layers.StaticLayer,
        "obstacle_layer": layers.VoxelLayer,
        "inflation_layer": layers.InflationLayer,
        **planners,
        "move_base": move_base.MoveBaseParameters,
        "rotation": move_base.RotateRecoveryParameters,
        "dispatcher": move_base.DispatcherParameters,
        "topics": TopicParameters,
        "quirks": Quirks,
    }
    for name, model in sections.items():
        _add_section(definitions, name, model)
    definitions["quirks"]["properties"]["like"] = {
        "description": "The profile the switches change.",
        "enum": list(PROFILES),
        "default": DEFAULT_PROFILE,
    }
    _complete_costmap(definitions)
    names = {"base_global_planner": GLOBAL, "base_local_planner": LOCAL}
    for name, plugins in names.items():
        definitions["move_base"]["properties"][name]["examples"] = list(plugins)
    definitions["move_base"]["properties"] |= {
        "global_costmap": _reference("costmap"),
        "local_costmap": _reference("costmap"),
        **{name: _reference(name) for name in planners},
        **{name: definitions["costmap"]["properties"][name] for name in layers.SEARCHED_UPWARDS},
        "rotate_recovery": _reference("rotation"),
    }
    return definitions | {"ros": _ros_tree()}


def _add_section(definitions: dict[str, Schema], name: str, model: type[Any]) -> None:
    schema = editor_schema(model, name)
    for key in ("$schema", "title"):
        del schema[key]
    for nested, body in schema.pop("$defs", {}).items():
        definitions.setdefault(nested, body)
    # A ROS node ignores unknown names, so they are not errors in its section.
    is_section = issubclass(model, Section)
    schema["additionalProperties"] = is_section and not model.strict
    schema["properties"] = {key: nullable(body) for key, body in schema["properties"].items()}
    for idle, reason in (model.without_effect if is_section else {}).items():
        schema["properties"].setdefault(idle, {})["description"] = f"Without effect here: {reason}."
    definitions[name] = schema


def _complete_costmap(definitions: dict[str, Schema]) -> None:
    """Add the flat names of files without ``plugins`` to a costmap, and its layers."""
    costmap = definitions["costmap"]["properties"]
    names = ("static_layer", "obstacle_layer", "inflation_layer")
    for name in names:
        for key, body in definitions[name]["properties"].items():
            if key != "enabled":
                costmap.setdefault(key, body)
    costmap["static_map"] = {
        "type": ["boolean", "object", "null"],
        "description": "Without plugins: whether there is a static layer. Or a layer of that name.",
    }
    costmap["map_type"] = {
        "enum": ["costmap", "voxel", None],
        "description": "Without plugins: whether the obstacle layer is a voxel layer.",
    }
    plugin = {
        "type": "object",
        "properties": {
            "name": {"type": "string", "description": "Also the namespace of its parameters."},
            "type": {"type": "string", "examples": _LAYER_TYPES},
        },
        "required": ["name", "type"],
    }
    costmap["plugins"] = {
        "type": ["array", "null"],
        "items": plugin,
        "description": "The layers, the lowest first; each has a section of its name.",
    }
    # Names of layers and sources are free. Editors help with the names of costmaps without plugins
    # and of the files that ship.
    costmap |= {name: _reference(name) for name in names}
    costmap["scan"] = definitions["obstacle_layer"]["properties"]["scan"] = _reference("source")


def _reference(name: str) -> Schema:
    return {"$ref": f"#/$defs/{name}"}


def _ros_tree() -> Schema:
    quirks = {
        "description": (
            "Oddities of the original that are kept: fast (all except inflation_queue_order), "
            "original (all), fixed (none), or switches."
        ),
        "anyOf": [
            {"enum": list(PROFILES)},
            _reference("quirks"),
        ],
        "default": DEFAULT_PROFILE,
    }
    return {
        "description": "Parameters of the ROS navigation stack by namespace.",
        "type": "object",
        "properties": {
            "amcl": _reference("amcl"),
            "move_base": _reference("move_base"),
            "costmap_common": _reference("costmap"),
            "dispatcher": _reference("dispatcher"),
            "topics": _reference("topics"),
            "quirks": quirks,
        },
    }
