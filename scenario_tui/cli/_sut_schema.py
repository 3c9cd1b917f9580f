"""The JSON Schema of files about systems under test, the parameters of the ROS stack included."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

Schema = dict[str, Any]

_OURS: Final = ("sources", "obstacle_layer", "obstacle_layer_name", "inflation_layer")
"""Fields of a costmap's model that nobody writes."""


def sut_schema(title: str) -> Schema:
    """Check the parameters of the kinds that ship; those that plug in check their own."""
    from daemon.campaign.suts import SutText
    from daemon.navigation import PilotParameters
    from grammars.editor import editor_schema

    schema = editor_schema(SutText, title)
    definitions = ros_definitions()
    definitions["pilot"] = editor_schema(PilotParameters, "Parameters of the pilot")
    del definitions["pilot"]["$schema"]
    takes = {name: {"$ref": f"#/$defs/{name}"} for name in ("pilot", "ros")}
    kinds = takes | {"idle": {"maxProperties": 0}}
    schema["properties"]["kind"]["examples"] = list(kinds)
    schema["properties"]["like"]["examples"] = ["pilot"]
    schema["anyOf"] = [{"required": ["kind"]}, {"required": ["like"]}]
    schema["allOf"] = [
        {
            "if": {"properties": {"kind": {"const": kind}}, "required": ["kind"]},
            "then": {"properties": {"parameters": parameters}},
        }
        for kind, parameters in kinds.items()
    ]
    # What another file says the kind is cannot be known here: offer what any of them takes.
    schema["allOf"].append(
        {
            "if": {"required": ["like"], "not": {"required": ["kind"]}},
            "then": {"properties": {"parameters": {"anyOf": list(takes.values())}}},
        }
    )
    schema["$defs"] = dict(sorted(definitions.items()))
    return schema


def ros_definitions() -> dict[str, Schema]:
    """Return the sections of the tree of ROS parameters, and the tree as ``ros``.

    Names that no node knows are left to ``scenario check``, which warns of them; ``null`` takes
    an inherited value away.
    """
    from daemon.navigation.ros import amcl, costmap, dwa, move_base, navfn
    from daemon.navigation.ros.parameters import TopicParameters
    from daemon.navigation.ros.quirks import Quirks

    found: dict[str, Schema] = {}
    _add(found, "amcl", amcl.AmclParameters, amcl.WITHOUT_EFFECT)
    _add(found, "costmap", costmap.CostmapParameters, costmap.WITHOUT_EFFECT)
    _add(found, "source", costmap.ObservationSource, costmap.SOURCE_WITHOUT_EFFECT)
    _add(found, "dwa", dwa.DwaParameters, dwa.WITHOUT_EFFECT)
    _add(found, "navfn", navfn.NavfnParameters, navfn.WITHOUT_EFFECT)
    _add(found, "move_base", move_base.MoveBaseParameters, move_base.MOVE_BASE_WITHOUT_EFFECT)
    _add(found, "rotation", move_base.RotateRecoveryParameters, {})
    _add(found, "dispatcher", move_base.DispatcherParameters, None)
    _add(found, "topics", TopicParameters, None)
    _add(found, "quirks", Quirks, None)
    found["quirks"]["properties"]["like"] = {
        "description": "The profile the switches change.",
        "enum": ["original", "fixed"],
    }
    _complete_costmap(found)
    found["move_base"]["properties"] |= {
        "global_costmap": _reference("costmap"),
        "local_costmap": _reference("costmap"),
        "DWAPlannerROS": _reference("dwa"),
        "NavfnROS": _reference("navfn"),
        "rotate_recovery": _reference("rotation"),
    }
    return found | {"ros": _tree()}


def _add(
    found: dict[str, Schema],
    name: str,
    model: type[Any],
    without_effect: Mapping[str, str] | None,
) -> None:
    """Add a section; ``None`` for one that no ROS node reads, where every name must be known."""
    from grammars.editor import editor_schema

    schema = editor_schema(model, name)
    for key in ("$schema", "title"):
        del schema[key]
    for nested, body in schema.pop("$defs", {}).items():
        found.setdefault(nested, body)
    schema["additionalProperties"] = without_effect is not None
    schema["properties"] = {key: _nullable(body) for key, body in schema["properties"].items()}
    for idle, reason in (without_effect or {}).items():
        schema["properties"].setdefault(idle, {})["description"] = f"Without effect here: {reason}."
    found[name] = schema


def _nullable(body: Schema) -> Schema:
    """Let ``null`` take an inherited value away."""
    if "anyOf" in body:
        return body | {"anyOf": [*body["anyOf"], {"type": "null"}]}
    changed = dict(body)
    if isinstance(body.get("type"), str):
        changed["type"] = [body["type"], "null"]
    if "const" in body:
        changed["enum"] = [changed.pop("const")]
    if "enum" in changed:
        changed["enum"] = [*changed["enum"], None]
    return changed


def _complete_costmap(found: dict[str, Schema]) -> None:
    """Write a costmap as people do: sources by name, not as a list."""
    costmap = found["costmap"]["properties"]
    for name in _OURS:
        del costmap[name]
    del found["source"]["properties"]["name"]
    found.pop("observationsource", None)
    costmap["observation_sources"] = {
        "type": ["string", "null"],
        "description": "Names of sources with spaces between them; each is described under its "
        "name.",
    }
    costmap["scan"] = _reference("source")


def _reference(name: str) -> Schema:
    return {"$ref": f"#/$defs/{name}"}


def _tree() -> Schema:
    quirks = {
        "description": "Oddities of the original that are kept: original, fixed, or switches.",
        "anyOf": [
            {"enum": ["original", "fixed"]},
            _reference("quirks"),
        ],
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
