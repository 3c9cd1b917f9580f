"""The command that makes a building, a walls layer, of a map or a drawing."""

from __future__ import annotations

import math
import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, NoReturn

import typer

from scenario_tui.cli.options import AsJson
from scenario_tui.cli.output import Output, OutputPart, report_findings, say

if TYPE_CHECKING:
    from collections.abc import Sequence

    from grammars.maps import WallsText
    from grammars.maps.map_import import ImportReport
    from grammars.model.geometry import Point2
    from grammars.model.grid import OccupancyGrid

_OTHER_FILE: Final = "of a map, name the YAML file that map_server reads, not its image"


class FoundDoorway(OutputPart):
    """A gap in which a door may hang, its sizes in metres."""

    name: str
    width: float
    depth: float


class MapFigures(OutputPart):
    """Figures of an import: the largest error in cells, areas in m², the rest in metres."""

    cell: float
    largest_error: float
    directions_deg: list[float]
    dropped_floor: float
    dropped_wall_cells: int
    filled_cells: int
    open_border: float
    widest_opening: Point2 | None


class ImportOutput(Output, schema="import"):
    """A walls layer and its contents, in metres."""

    file: str
    width: float
    depth: float
    spaces: list[str]
    walls: int
    corners: int
    doorways: list[FoundDoorway]
    map: MapFigures


def import_(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="MAP.yaml|DRAWING.dxf",
            help="A map (the YAML of map_server, its image beside it) or a drawing.",
            exists=True,
            dir_okay=False,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", metavar="NAME", help="NAME.walls.yaml is written. Default: as the file."
        ),
    ] = None,
    tolerance: Annotated[
        float,
        typer.Option(min=0.4, max=5.0, help="How far walls may lie off their cells, in cells."),
    ] = 1.0,
    specks: Annotated[
        int, typer.Option(min=1, help="Fewer unknown cells than this are noise.")
    ] = 4,
    least_room: Annotated[
        float, typer.Option(min=0.0, help="Smallest piece of floor that is kept, m².")
    ] = 1.0,
    doorways: Annotated[
        bool,
        typer.Option(
            "--doorways/--no-doorways",
            help="Gaps of 0.7 to 1.3 m between walls become doorways between rooms.",
        ),
    ] = True,
    height: Annotated[
        str, typer.Option(metavar="LENGTH", help="Height of the walls, which neither shows.")
    ] = "2.5 m",
    layer: Annotated[
        list[str] | None,
        typer.Option(metavar="PATTERN", help="For drawings: layers that hold walls."),
    ] = None,
    standing: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATTERN", help="For drawings: layers of racks, columns and the like."
        ),
    ] = None,
    unit: Annotated[
        str, typer.Option(help="For drawings: mm, cm, dm, m, in or ft. Default: as the file says.")
    ] = "",
    thickness: Annotated[
        str, typer.Option(metavar="LENGTH", help="For drawings: of walls drawn as one line.")
    ] = "0.1 m",
    force: Annotated[
        bool, typer.Option("--force", help="Write over a walls layer that is there.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Make a building, NAME.walls.yaml, of the map of a robot or of a drawing (DXF).

    Campaigns name it in place of a floor plan: floorplan: NAME.
    """
    from grammars.maps import walls_text
    from grammars.maps.map_import import EmptyMapError, ImportSettings, vectorise
    from grammars.model.map_files import read_map

    target = _target(file, out)
    if target.exists() and not force:
        _refuse(
            str(target), "is there already", "take another name (-o), or write over it: --force"
        )
    settings = ImportSettings(
        _name_in(target), tolerance, specks, least_room, _length(height, "height"), doorways
    )
    yaw = 0.0
    if file.suffix.lower() in (".dxf", ".dwg"):
        grid = _drawn(file, layer, standing or (), unit, _length(thickness, "thickness"))
    elif file.suffix.lower() in (".yaml", ".yml"):
        saved = read_map(file, turned=True)
        report_findings(saved.warnings)
        grid, yaw = saved.grid, saved.yaw
    else:
        _refuse(str(file), "is neither the YAML file of a map nor a drawing", _OTHER_FILE)
    try:
        imported = vectorise(grid, settings, yaw=yaw)
    except EmptyMapError as error:
        _refuse(str(file), str(error), "look at its free_thresh and negate")
    try:
        target.write_text(walls_text(imported.building), encoding="utf-8")
    except OSError as error:
        _refuse(str(target), f"cannot be written: {error.strerror}", "")
    output = _output(target, imported.building, imported.report)
    if as_json:
        output.emit()
        return
    typer.echo(_described(output))
    _say_what_is_next(target)


def _drawn(
    file: Path, layers: Sequence[str] | None, standing: Sequence[str], unit: str, thickness: float
) -> OccupancyGrid:
    """Return the map of a drawing; print warnings, also when it cannot be read."""
    from grammars.text.diagnostics import Findings
    from grammars.text.plugins import load_extra

    for library in ("ezdxf", "PIL"):
        load_extra(library, "import", "a drawing", "import")
    from grammars.maps.drawing import WALL_LAYERS, draw_map

    findings = Findings()
    try:
        return draw_map(file, layers or WALL_LAYERS, standing, unit, thickness, findings)
    finally:
        report_findings(findings.warnings)


def _target(file: Path, out: Path | None) -> Path:
    """Return the file to write: NAME.walls.yaml, whether or not its ending was given."""
    path = out if out is not None else Path(file.stem)
    return path if path.name.endswith(".walls.yaml") else path.with_name(f"{path.name}.walls.yaml")


def _name_in(target: Path) -> str:
    """Return a name a walls layer may have, from the name of its file."""
    name = re.sub(r"[^A-Za-z0-9._-]+", "_", target.name.removesuffix(".walls.yaml"))
    return (name.lstrip("._-") or "building")[:100]


def _length(text: str, option: str) -> float:
    from grammars.text.quantity import read_as

    try:
        value = read_as(text, "length")
    except ValueError as error:
        raise typer.BadParameter(f"--{option}: {error}") from error
    if not 0.0 < value <= 100.0:
        raise typer.BadParameter(f"--{option}: {text} is no size for a building")
    return value


def _refuse(file: str, message: str, hint: str) -> NoReturn:
    from grammars.text.diagnostics import InputError, Where

    raise InputError.at(Where(file), message, hint)


def _output(target: Path, building: WallsText, report: ImportReport) -> ImportOutput:
    return ImportOutput(
        str(target),
        round(report.width, 3),
        round(report.depth, 3),
        list(building.spaces),
        len(building.standing),
        report.corners,
        [
            FoundDoorway(name, round(math.dist(door.start, door.end), 3), door.depth)
            for name, door in building.entryways.items()
        ],
        MapFigures(
            report.resolution,
            round(report.largest_error, 3),
            [round(math.degrees(direction), 2) for direction in report.directions],
            round(report.dropped_floor, 3),
            report.dropped_walls,
            report.filled_cells,
            round(report.open_border, 3),
            report.widest_opening,
        ),
    )


def _described(output: ImportOutput) -> str:
    """Return the output in words."""
    lines = [
        f"{output.file}: {output.width:.2f} m by {output.depth:.2f} m",
        f"  spaces    {len(output.spaces)}: {', '.join(output.spaces)}",
        f"  walls     {output.walls}, {output.corners} corners",
    ]
    doors = ", ".join(f"{door.name} {door.width:.2f} m" for door in output.doorways)
    lines.append(f"  doorways  {len(output.doorways)}{': ' if doors else ''}{doors}")
    cells = output.map
    lines.append(
        f"  error     at most {cells.largest_error:.2f} cells of {cells.cell:g} m"
        f" ({cells.largest_error * cells.cell:.3f} m)"
    )
    if cells.widest_opening is not None:
        x, y = cells.widest_opening
        lines.append(
            f"  open      floor ends without a wall along {cells.open_border:.1f} m,"
            f" most of it at [{x}, {y}]"
        )
    dropped = []
    if cells.dropped_floor:
        dropped.append(f"{cells.dropped_floor:.2f} m² of floor in small pockets")
    if cells.dropped_wall_cells:
        dropped.append(f"{cells.dropped_wall_cells} occupied cells outside")
    if cells.filled_cells:
        dropped.append(f"{cells.filled_cells} unknown cells as noise")
    if dropped:
        lines.append(f"  left out  {', '.join(dropped)}")
    return "\n".join(lines)


def _say_what_is_next(target: Path) -> None:
    name = target.name.removesuffix(".walls.yaml")
    say(
        f"Look at it: scenario export {shlex.quote(str(target))} picture. "
        f"Campaigns name it in place of a floor plan: floorplan: {name}"
    )
