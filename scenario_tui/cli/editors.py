"""Commands that serve editors: JSON Schemas of the YAML files people write, the VS Code extension.

The schemas come from the models that read the files; that of systems under test includes the
parameters of the ROS stack.
"""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Final

import typer


class FileKind(StrEnum):
    """The kinds of YAML files; each has a schema file of its name."""

    CAMPAIGN = "campaign"
    MISSION = "mission"
    ROBOT = "robot"
    SUT = "sut"
    ORACLES = "oracles"
    WALLS = "walls"

    @property
    def file(self) -> str:
        """Name of the published schema."""
        return f"{self.value}.schema.json"


_TITLES: Final = {
    FileKind.CAMPAIGN: "Campaign of scenario-tui",
    FileKind.MISSION: "Mission of scenario-tui",
    FileKind.ROBOT: "Robot of scenario-tui",
    FileKind.SUT: "System under test of scenario-tui",
    FileKind.ORACLES: "Oracles of scenario-tui",
    FileKind.WALLS: "Walls layer of scenario-tui",
}


def schema_of(kind: FileKind) -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of one kind of file."""
    from daemon.campaign import CampaignFile
    from grammars.editor import editor_schema, oracle_schema
    from grammars.maps import WallsText
    from grammars.model.mission_files import MissionText
    from grammars.model.robot_files import RobotText

    models: dict[FileKind, type[Any]] = {
        FileKind.CAMPAIGN: CampaignFile,
        FileKind.MISSION: MissionText,
        FileKind.ROBOT: RobotText,
        FileKind.WALLS: WallsText,
    }
    if kind is FileKind.ORACLES:
        return oracle_schema(_TITLES[kind])
    if kind is FileKind.SUT:
        return sut_schema(_TITLES[kind])
    return editor_schema(models[kind], _TITLES[kind])


Schema = dict[str, Any]
_LAYER_TYPES: Final = [
    "costmap_2d::StaticLayer",
    "costmap_2d::ObstacleLayer",
    "costmap_2d::VoxelLayer",
    "costmap_2d::InflationLayer",
]


def sut_schema(title: str) -> Schema:
    """Check the parameters of the kinds that ship; those that plug in check their own."""
    from daemon.campaign import SutFile
    from daemon.stacks.pilot import PilotParameters
    from daemon.stacks.ros2.keys import ROS2_KEYS
    from grammars.editor import editor_schema

    schema = editor_schema(SutFile, title)
    definitions = ros_definitions()
    definitions["pilot"] = editor_schema(PilotParameters, "Parameters of the pilot")
    del definitions["pilot"]["$schema"]
    takes = {name: {"$ref": f"#/$defs/{name}"} for name in ("pilot", "ros")}
    kinds = takes | {name: {"maxProperties": 0} for name in ("idle", "ros2")}
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
    schema["$defs"] = dict(sorted((schema["$defs"] | definitions).items()))
    # Every file has the others; editors offer keys in this order.
    keys: Schema = {k: v for k, v in schema["properties"].items() if k not in ROS2_KEYS}
    ros2 = {key: _nullable(schema["properties"][key]) for key in ROS2_KEYS}
    for name in [name for name in schema["$defs"] if name.startswith("ros2")]:
        section = schema["$defs"][name]["properties"]
        section |= {key: _nullable(body) for key, body in section.items()}
    schema["properties"] = keys | ros2
    nothing: Schema = {"not": {}, "errorMessage": "only kind ros2 has this key"}
    schema["allOf"].append(
        {
            "if": {"properties": {"kind": {"not": {"const": "ros2"}}}, "required": ["kind"]},
            "then": {"properties": dict.fromkeys(ros2, nothing)},
        }
    )
    return schema


def ros_definitions() -> dict[str, Schema]:
    """Return the sections of the tree of ROS parameters, and the tree as ``ros``.

    Names that no node knows are left to ``scenario check``, which warns of them; ``null`` takes
    an inherited value away.
    """
    from daemon.stacks.ros1 import amcl, move_base
    from daemon.stacks.ros1.costmap import layers
    from daemon.stacks.ros1.planners import GLOBAL, LOCAL, namespace_of
    from daemon.stacks.ros1.quirks import DEFAULT_PROFILE, PROFILES, Quirks
    from daemon.stacks.ros1.wiring import TopicParameters

    found: dict[str, Schema] = {}
    _add_section(found, "amcl", amcl.AmclParameters)
    sections: dict[str, type[Any]] = {
        "costmap": layers.LayeredCostmap,
        "source": layers.ObservationSource,
        "static_layer": layers.StaticLayer,
        "obstacle_layer": layers.VoxelLayer,
        "inflation_layer": layers.InflationLayer,
    }
    for name, model in sections.items():
        _add_section(found, name, model)
    planners = {namespace_of(plugin): entry for plugin, entry in {**GLOBAL, **LOCAL}.items()}
    for name, planner in planners.items():
        _add_section(found, name, planner)
    _add_section(found, "move_base", move_base.MoveBaseParameters)
    _add_section(found, "rotation", move_base.RotateRecoveryParameters)
    _add_section(found, "dispatcher", move_base.DispatcherParameters)
    _add_section(found, "topics", TopicParameters)
    _add_section(found, "quirks", Quirks)
    found["quirks"]["properties"]["like"] = {
        "description": "The profile the switches change.",
        "enum": list(PROFILES),
        "default": DEFAULT_PROFILE,
    }
    _complete_costmap(found)
    names = {"base_global_planner": GLOBAL, "base_local_planner": LOCAL}
    for name, plugins in names.items():
        found["move_base"]["properties"][name]["examples"] = list(plugins)
    found["move_base"]["properties"] |= {
        "global_costmap": _reference("costmap"),
        "local_costmap": _reference("costmap"),
        **{name: _reference(name) for name in planners},
        **{name: found["costmap"]["properties"][name] for name in layers.SEARCHED_UPWARDS},
        "rotate_recovery": _reference("rotation"),
    }
    return found | {"ros": _ros_tree()}


def _add_section(found: dict[str, Schema], name: str, model: type[Any]) -> None:
    from daemon.stacks.ros1.parameters import Section
    from grammars.editor import editor_schema

    schema = editor_schema(model, name)
    for key in ("$schema", "title"):
        del schema[key]
    for nested, body in schema.pop("$defs", {}).items():
        found.setdefault(nested, body)
    # A ROS node ignores names it does not know, so other names are no errors in its section.
    is_section = issubclass(model, Section)
    schema["additionalProperties"] = is_section and not model.strict
    schema["properties"] = {key: _nullable(body) for key, body in schema["properties"].items()}
    for idle, reason in (model.without_effect if is_section else {}).items():
        schema["properties"].setdefault(idle, {})["description"] = f"Without effect here: {reason}."
    found[name] = schema


def _nullable(body: Schema) -> Schema:
    """Let ``null`` take an inherited value away."""
    if "anyOf" in body:
        return body | {"anyOf": [*body["anyOf"], {"type": "null"}]}
    if "$ref" in body:
        rest = {key: value for key, value in body.items() if key != "$ref"}
        return rest | {"anyOf": [{"$ref": body["$ref"]}, {"type": "null"}]}
    changed = dict(body)
    if "type" in body:
        kinds = body["type"] if isinstance(body["type"], list) else [body["type"]]
        changed["type"] = [*kinds, "null"]
    # A constant of one value or null is a choice of two.
    if "const" in body:
        changed["enum"] = [changed.pop("const")]
    if "enum" in changed:
        changed["enum"] = [*changed["enum"], None]
    return changed


def _complete_costmap(found: dict[str, Schema]) -> None:
    """Add to a costmap what files without ``plugins`` write flat, and the layers themselves."""
    costmap = found["costmap"]["properties"]
    layers = ("static_layer", "obstacle_layer", "inflation_layer")
    for name in layers:
        costmap |= {
            key: body for key, body in found[name]["properties"].items() if key != "enabled"
        }
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
        "description": "The layers, the lowest first; each is described under its name.",
    }
    # Names of layers and sources are free; these are the ones without plugins, and in the files
    # that ship, so they get help.
    costmap |= {name: _reference(name) for name in layers}
    costmap["scan"] = found["obstacle_layer"]["properties"]["scan"] = _reference("source")


def _reference(name: str) -> Schema:
    return {"$ref": f"#/$defs/{name}"}


def _ros_tree() -> Schema:
    from daemon.stacks.ros1.quirks import DEFAULT_PROFILE, PROFILES

    quirks = {
        "description": (
            "Oddities of the original that are kept: fast (all but the order in which inflation "
            "passes costs on), original (all), fixed (none), or switches."
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


def schema(
    kind: Annotated[
        FileKind | None,
        typer.Argument(
            metavar="[" + "|".join(FileKind) + "]",
            help="Kind of YAML file. With --out, all of them when left out.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="DIR", help="Write KIND.schema.json files there."),
    ] = None,
    outputs: Annotated[
        bool, typer.Option("--outputs", help="Instead the schema of what --json writes.")
    ] = False,
    extension: Annotated[
        Path | None,
        typer.Option(
            "--vscode",
            metavar="DIR",
            help="Instead write the extension for Visual Studio Code there, scenario.vsix.",
        ),
    ] = None,
) -> None:
    """Print or write what editors use: JSON Schemas of YAML files, the VS Code extension.

    Install the extension with: code --install-extension scenario.vsix
    """

    if extension is not None:
        if kind is not None or outputs or out is not None:
            raise typer.BadParameter("goes with nothing else", param_hint="--vscode")
        _write_extension(extension)
        return
    if outputs:
        if kind is not None:
            raise typer.BadParameter("is about no kind of file", param_hint="--outputs")
        from scenario_tui.cli.output_schemas import SCHEMA_FILE, outputs_schema

        _publish(outputs_schema(), out, SCHEMA_FILE)
        return
    if out is None and kind is None:
        raise typer.BadParameter("name a kind to print, or a folder to write to with --out")
    for each in FileKind if kind is None else (kind,):
        _publish(schema_of(each), out, each.file)


def schema_text(found: Schema) -> str:
    """Return a schema as the text of its file."""
    return json.dumps(found, ensure_ascii=False, indent=2) + "\n"


def _publish(found: Schema, folder: Path | None, file: str) -> None:
    """Print a schema, or write it into a folder and print where it is."""
    if folder is None:
        typer.echo(schema_text(found), nl=False)
        return
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / file
    path.write_text(schema_text(found), encoding="utf-8")
    typer.echo(path)


def _write_extension(folder: Path) -> None:
    """Write the extension for Visual Studio Code, and print where it is."""
    from grammars.editor import pack_extension

    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "scenario.vsix"
    path.write_bytes(pack_extension())
    typer.echo(path)
