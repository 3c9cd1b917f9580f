"""The command that makes a building, a walls layer, from a map, a drawing or a picture."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from grammars.text.diagnostics import Findings, InputError, Where
from grammars.text.file_kinds import kind_of_file, refuse_kind
from grammars.text.words import command_line
from scenario_tui.cli.answer import Answer
from scenario_tui.cli.output import report_findings, say

if TYPE_CHECKING:
    from grammars.maps.map_import import ImportedBuilding
    from grammars.model.grid import OccupancyGrid


def _parse_length(text: str) -> float:
    """Return a size of a building in metres; raises ``ValueError``."""
    from grammars.text.quantity import read_as

    value = read_as(text, "length")
    if not 0.0 < value <= 100.0:
        raise ValueError(f"{text} is not a size of a building")
    return value


def import_(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="MAP.yaml|DRAWING.dxf|PICTURE",
            help="A map (YAML of map_server, with its image), a drawing, or a picture of walls.",
            exists=True,
            dir_okay=False,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option("-o", metavar="NAME", help="Write NAME.walls.yaml. Default: the file's name."),
    ] = None,
    tolerance: Annotated[
        float,
        typer.Option(min=0.4, max=5.0, help="Largest distance of walls from their cells, cells."),
    ] = 1.0,
    specks: Annotated[
        int, typer.Option(min=1, help="Treat groups of fewer unknown cells as noise.")
    ] = 4,
    least_room: Annotated[
        float, typer.Option(min=0.0, help="Smallest piece of floor to keep, m².")
    ] = 1.0,
    doorways: Annotated[
        bool,
        typer.Option(
            "--doorways/--no-doorways",
            help="Turn gaps of 0.7 to 1.3 m between walls into doorways between rooms.",
        ),
    ] = True,
    height: Annotated[
        float | None,
        typer.Option(
            metavar="LENGTH", parser=_parse_length, help="Height of the walls. Default: 2.5 m."
        ),
    ] = None,
    layer: Annotated[
        list[str] | None,
        typer.Option(metavar="PATTERN", help="For drawings: layers that hold walls."),
    ] = None,
    standing: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATTERN", help="For drawings: layers that hold racks, columns and the like."
        ),
    ] = None,
    unit: Annotated[str, "For drawings: mm, cm, dm, m, in or ft. Default: the file's unit."] = "",
    thickness: Annotated[
        float | None,
        typer.Option(
            metavar="LENGTH",
            parser=_parse_length,
            help="For drawings: thickness of walls drawn as one line. Default: 0.1 m.",
        ),
    ] = None,
    resolution: Annotated[
        float | None,
        typer.Option(min=0.001, max=10.0, help="For pictures: size of a pixel, metres."),
    ] = None,
    force: Annotated[bool, "Overwrite an existing walls layer."] = False,
) -> Answer[ImportedBuilding]:
    """Make a building, NAME.walls.yaml, from a map, a drawing (DXF) or a picture.

    Campaigns name it in place of a floor plan: floorplan: NAME.
    """
    from grammars.maps import walls_text
    from grammars.maps.map_import import EmptyMapError, ImportedBuilding, ImportSettings, vectorise
    from grammars.model.map_files import PICTURES, read_map, read_picture

    target = _target(file, out)
    if target.exists() and not force:
        remedy = "choose another name (-o), or overwrite it with --force"
        raise InputError.at(Where(str(target)), "exists already", remedy)
    ending = file.suffix.lower()
    is_drawing, is_picture = ending in (".dxf", ".dwg"), ending in PICTURES
    if (layer or standing or unit or thickness) and not is_drawing:
        message = "is no drawing: --layer, --standing, --unit and --thickness have no meaning"
        raise InputError.at(Where(str(file)), message)
    if resolution and not is_picture:
        raise InputError.at(Where(str(file)), "is no picture: --resolution has no meaning")
    yaw = 0.0
    if is_drawing:
        grid = _drawn(file, layer, standing or (), unit, thickness or 0.1)
    elif ending in (".yaml", ".yml"):
        saved = read_map(file, turned=True)
        report_findings(saved.warnings)
        grid, yaw = saved.grid, saved.yaw
    elif is_picture:
        if resolution is None:
            message = "is a picture: the size of its pixels is unknown"
            remedy = "give it in metres, --resolution 0.05; of a map, name the YAML file"
            raise InputError.at(Where(str(file)), message, remedy)
        grid = read_picture(file, resolution)
    else:
        refuse_kind(kind_of_file(file), Where(str(file)))
        message = "is neither the YAML file of a map, a drawing nor a picture"
        raise InputError.at(Where(str(file)), message)
    settings = ImportSettings(
        _name_in(target), tolerance, specks, least_room, height or 2.5, doorways
    )
    try:
        imported = vectorise(grid, settings, yaw=yaw)
    except EmptyMapError as error:
        remedy = "floor is white, walls are black" if resolution else "check free_thresh and negate"
        raise InputError.at(Where(str(file)), str(error), remedy) from error
    target.write_text(walls_text(imported.building), encoding="utf-8")
    value = ImportedBuilding(str(target), imported.report)
    return Answer("import", value, partial(_print_report, value))


def _drawn(
    file: Path, layers: Sequence[str] | None, standing: Sequence[str], unit: str, thickness: float
) -> OccupancyGrid:
    """Return the map of a drawing; print warnings, even if it cannot be read."""
    from grammars.text.plugins import load_extra

    for library in ("ezdxf", "PIL"):
        load_extra(library, "cad", "a drawing", "import")
    from grammars.maps.drawing import WALL_LAYERS, draw_map

    findings = Findings()
    try:
        return draw_map(file, layers or WALL_LAYERS, standing, unit, thickness, findings)
    finally:
        report_findings(findings.warnings)


def _target(file: Path, out: Path | None) -> Path:
    """Return the file to write, NAME.walls.yaml, also for a name without the ending."""
    path = out if out is not None else Path(file.stem)
    return path if path.name.endswith(".walls.yaml") else path.with_name(f"{path.name}.walls.yaml")


def _name_in(target: Path) -> str:
    """Return a valid name of a walls layer from the name of its file."""
    name = re.sub(r"[^A-Za-z0-9._-]+", "_", target.name.removesuffix(".walls.yaml"))
    return (name.lstrip("._-") or "building")[:100]


def _print_report(imported: ImportedBuilding) -> None:
    report = imported.report
    doors = ", ".join(f"{name} {width:.2f} m" for name, width in report.doorways.items())
    lines = [
        f"{imported.file}: {report.width:.2f} m by {report.depth:.2f} m",
        f"  spaces    {len(report.spaces)}: {', '.join(report.spaces)}",
        f"  walls     {report.walls}, {report.corners} corners",
        f"  doorways  {len(report.doorways)}{': ' if doors else ''}{doors}",
        f"  error     at most {report.largest_error:.2f} cells of {report.resolution:g} m"
        f" ({report.largest_error * report.resolution:.3f} m)",
    ]
    if report.widest_opening is not None:
        x, y = report.widest_opening
        lines.append(
            f"  open      floor ends without a wall along {report.open_border:.1f} m,"
            f" most of it at [{x}, {y}]"
        )
    dropped = {
        f"{report.dropped_floor:.2f} m² of floor in small pockets": report.dropped_floor,
        f"{report.dropped_walls} occupied cells outside": report.dropped_walls,
        f"{report.filled_cells} unknown cells as noise": report.filled_cells,
    }
    if any(dropped.values()):
        lines.append(f"  left out  {', '.join(text for text, size in dropped.items() if size)}")
    typer.echo("\n".join(lines))
    name = Path(imported.file).name.removesuffix(".walls.yaml")
    say(
        f"Look at it: {command_line('export', imported.file, 'picture')}\n"
        f"Campaigns name it in place of a floor plan: floorplan: {name}"
    )
