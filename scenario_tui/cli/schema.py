"""The command that writes files for editors: JSON Schemas of YAML files, and the extension.

The schemas come from the models that read the files. The schema of systems under test includes
the parameters of the kinds that ship.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeAlias, get_args

import typer

from scenario_tui.cli.options import check_folder, out_folder

Schema: TypeAlias = dict[str, Any]


FileKind: TypeAlias = Literal["campaign", "mission", "robot", "sut", "oracles", "walls"]
"""Kinds of YAML files; each has a schema file with its name."""
FILE_KINDS: Final[tuple[FileKind, ...]] = get_args(FileKind)


def schema(
    kind: Annotated[
        FileKind | None,
        typer.Argument(
            metavar="KIND",
            help="Kind of YAML file. Default with --out: all kinds.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[Path | None, out_folder("Folder for KIND.schema.json files.")] = None,
    outputs: Annotated[bool, "Write the schema of the --json output instead."] = False,
    extension: Annotated[
        Path | None,
        typer.Option(
            "--vscode",
            metavar="DIR",
            help="Folder for the extension of Visual Studio Code, scenario.vsix, instead.",
        ),
    ] = None,
) -> None:
    """Print or write files for editors: JSON Schemas, the VS Code extension.

    Install the extension with: code --install-extension scenario.vsix
    """
    if extension is not None:
        if kind is not None or outputs or out is not None:
            raise typer.BadParameter("cannot be combined", param_hint="--vscode")
        check_folder(extension, "--vscode")
        from grammars.editor import pack_extension

        _write(extension / "scenario.vsix", pack_extension())
        return
    if outputs:
        if kind is not None:
            raise typer.BadParameter("takes no kind of file", param_hint="--outputs")
        from scenario_tui.cli.output_schemas import SCHEMA_FILE, outputs_schema

        _publish(outputs_schema(), out, SCHEMA_FILE)
        return
    if out is None and kind is None:
        raise typer.BadParameter("name a kind to print, or a folder with --out")
    for each in FILE_KINDS if kind is None else (kind,):
        _publish(schema_of(each), out, f"{each}.schema.json")


def schema_of(kind: FileKind) -> Schema:
    """Return the JSON Schema (draft 2020-12) of one kind of file."""
    from daemon.campaign import CampaignFile
    from grammars.editor import editor_schema
    from grammars.editor.oracles import oracle_schema
    from grammars.maps import WallsText
    from grammars.model.mission_files import MissionText
    from grammars.model.robot_files import RobotText

    names = {"sut": "System under test", "walls": "Walls layer"}
    title = f"{names.get(kind, kind.capitalize())} of scenario-tui"
    if kind == "oracles":
        return oracle_schema(title)
    if kind == "sut":
        return _sut_schema(title)
    models: dict[str, type[Any]] = {
        "campaign": CampaignFile,
        "mission": MissionText,
        "robot": RobotText,
    }
    return editor_schema(models.get(kind, WallsText), title)


def _sut_schema(title: str) -> Schema:
    """Return the schema of SUT files, with the parameters of the kinds that ship."""
    from daemon.campaign import SutFile
    from daemon.stacks.kind import IDLE
    from daemon.stacks.pilot import PILOT
    from daemon.stacks.ros1 import ROS
    from daemon.stacks.ros2 import ROS2
    from grammars.editor import editor_schema, nullable

    schema = editor_schema(SutFile, title)
    definitions, kinds = dict[str, Schema](), dict[str, Schema]()
    for kind in (PILOT, ROS, IDLE, ROS2):
        schemas = kind.schemas()
        definitions |= schemas
        kinds[kind.name] = {"$ref": f"#/$defs/{kind.name}"} if schemas else {"maxProperties": 0}
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
    # The kind may stand in another file, unknown here: offer the parameters of all kinds.
    any_kind = [parameters for parameters in kinds.values() if "$ref" in parameters]
    schema["allOf"].append(
        {
            "if": {"required": ["like"], "not": {"required": ["kind"]}},
            "then": {"properties": {"parameters": {"anyOf": any_kind}}},
        }
    )
    schema["$defs"] = dict(sorted((schema["$defs"] | definitions).items()))
    # Keys of ROS 2 go last, because editors offer keys in this order.
    keys: Schema = {k: v for k, v in schema["properties"].items() if k not in ROS2.keys}
    ros2 = {key: nullable(schema["properties"][key]) for key in ROS2.keys}
    for name in [name for name in schema["$defs"] if name.startswith("ros2")]:
        section = schema["$defs"][name]["properties"]
        section |= {key: nullable(body) for key, body in section.items()}
    schema["properties"] = keys | ros2
    nothing: Schema = {"not": {}, "errorMessage": "only kind ros2 has this key"}
    schema["allOf"].append(
        {
            "if": {"properties": {"kind": {"not": {"const": "ros2"}}}, "required": ["kind"]},
            "then": {"properties": dict.fromkeys(ros2, nothing)},
        }
    )
    return schema


def schema_text(schema: Schema) -> str:
    """Return a schema as the text of its file."""
    return json.dumps(schema, ensure_ascii=False, indent=2) + "\n"


def _publish(schema: Schema, folder: Path | None, file: str) -> None:
    """Print a schema, or write it into a folder and print its path."""
    if folder is None:
        typer.echo(schema_text(schema), nl=False)
    else:
        _write(folder / file, schema_text(schema).encode())


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    typer.echo(path)
