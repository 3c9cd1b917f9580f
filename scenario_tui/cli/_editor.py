"""Commands that serve editors: JSON Schemas of the YAML files, the extension for VS Code."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scenario_tui.cli._schemas import FileKind


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
) -> None:
    """Print or write the JSON Schemas that editors complete and check YAML files with."""
    from scenario_tui.cli._schemas import schema_text

    if outputs:
        if kind is not None:
            raise typer.BadParameter("is about no kind of file", param_hint="--outputs")
        _outputs(out)
        return
    if out is None:
        if kind is None:
            raise typer.BadParameter("name a kind to print, or a folder to write to with --out")
        typer.echo(schema_text(kind), nl=False)
        return
    out.mkdir(parents=True, exist_ok=True)
    for each in FileKind if kind is None else (kind,):
        path = out / each.file
        path.write_text(schema_text(each), encoding="utf-8")
        typer.echo(path)


def _outputs(out: Path | None) -> None:
    from scenario_tui.cli._outputs import FILE, outputs_text

    if out is None:
        typer.echo(outputs_text(), nl=False)
        return
    out.mkdir(parents=True, exist_ok=True)
    path = out / FILE
    path.write_text(outputs_text(), encoding="utf-8")
    typer.echo(path)


def vscode(
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="Folder to write to.")
    ] = Path(),
) -> None:
    """Write the extension for Visual Studio Code.

    Install it with: code --install-extension scenario.vsix
    """
    from grammars.editor import pack_extension

    out.mkdir(parents=True, exist_ok=True)
    path = out / "scenario.vsix"
    path.write_bytes(pack_extension())
    typer.echo(path)
