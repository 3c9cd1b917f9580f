"""The command that makes artefacts of a floor plan or a campaign."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scenario_tui.cli import completion
from scenario_tui.cli.completion import plan_or_campaign_files
from scenario_tui.cli.options import AsJson, Base
from scenario_tui.cli.output import Output, report_diagnostics

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from grammars.text.diagnostics import Diagnostic
    from templates.artefacts import ExportResult
    from templates.world import ArtefactWorld


def world_of_plan(path: Path, base: str = "") -> tuple[ArtefactWorld, tuple[Diagnostic, ...]]:
    """Return the world of a plan (`.fpm`, `.walls.yaml` or JSON-LD), and the warnings about it.

    Relative identifiers of JSON-LD resolve against ``base``, else against the file's address.
    """
    from grammars.floorplan import load_floorplan
    from grammars.jsonld import is_jsonld, load_floorplan_jsonld, model_files
    from grammars.maps import WALLS_ENDING, load_walls
    from grammars.scenery.composition import compile_scene
    from templates.world import ArtefactWorld

    if path.name.endswith(WALLS_ENDING):
        plan = load_walls(path)
        name = path.name.removesuffix(WALLS_ENDING)
    else:
        plan = load_floorplan_jsonld(path, base) if is_jsonld(path) else load_floorplan(path)
        # One of several files is called after what it holds of the plan: the plan itself has a
        # name.
        name = path.stem if path.suffix != ".json" and path.is_file() else plan.name
    world = ArtefactWorld(name, compile_scene(plan), plan, sources=model_files(path))
    return world, plan.warnings


class Artefact(StrEnum):
    """What a floor plan or a campaign can be exported as."""

    ALL = "all"
    GEOJSON = "geojson"
    MAP = "map"
    JSONLD = "jsonld"
    MESH = "mesh"
    SDF = "sdf"
    KEYFRAMES = "keyframes"
    TASKS = "tasks"
    LAUNCH = "launch"
    FOXGLOVE = "foxglove"
    PICTURE = "picture"
    PROV = "prov"


class WaypointYaw(StrEnum):
    """Where the robot looks at generated waypoints."""

    ZERO = "zero"
    PATH = "path"


class ExportOutput(Output, schema="export"):
    """The files that were written."""

    files: list[str]


def export(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="PLAN.fpm|CAMPAIGN.yaml",
            help="A floor plan (.fpm, .jsonld or a folder of .json), a walls layer "
            "(.walls.yaml) or a campaign.",
            autocompletion=completion.files(plan_or_campaign_files),
        ),
    ],
    kinds: Annotated[
        list[Artefact],
        typer.Argument(
            metavar="KIND",
            help="all, or any of: geojson, jsonld, map, mesh, sdf (Gazebo), "
            "keyframes (of campaigns only), tasks, launch (ROS), foxglove, picture, prov.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option("--out", "-o", metavar="DIR", help="Folder to write to.", file_okay=False),
    ] = Path(),
    templates: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            exists=True,
            file_okay=False,
            help="Your own templates: a file here replaces ours of the same name.",
        ),
    ] = None,
    laser_height: Annotated[
        float | None,
        typer.Option(min=0.0, help="For map: height of the laser, metres. Default: the robot's."),
    ] = None,
    resolution: Annotated[
        float | None,
        typer.Option(
            min=0.005, max=1.0, help="For map: size of a cell, metres. Default: the campaign's."
        ),
    ] = None,
    distance: Annotated[
        float, typer.Option(min=0.01, help="For tasks: how far from the walls, metres.")
    ] = 0.7,
    first: Annotated[int, typer.Option(min=0, help="For tasks: waypoint to begin with.")] = 0,
    backward: Annotated[
        bool, typer.Option("--backward", help="For tasks: the other way round.")
    ] = False,
    closed: Annotated[
        bool, typer.Option("--closed", help="For tasks: come back to the first waypoint.")
    ] = False,
    yaw: Annotated[
        WaypointYaw, typer.Option(help="For tasks: look along the path, or along x of the map.")
    ] = WaypointYaw.ZERO,
    repeats: Annotated[
        int | None,
        typer.Option(min=1, help="Behaviours of the first repeats only. Default: of all."),
    ] = None,
    timestamp: Annotated[
        str, typer.Option(metavar="ISO8601", help="For prov: when. Default: left out.")
    ] = "",
    base: Base = "",
    as_json: AsJson = False,
) -> None:
    """Write artefacts of a floor plan or a campaign: maps, meshes, Gazebo worlds, tasks, …

    A campaign gets one folder per scenario; scenarios with equal worlds share one.
    """
    from daemon.analysis.campaign_worlds import worlds_of_campaign
    from grammars.maps import WALLS_ENDING
    from grammars.text.diagnostics import Diagnostic, Severity, Where
    from templates.artefacts import export_worlds
    from templates.naming import file_name
    from templates.rendering import Templates
    from templates.world import ExportSettings

    worlds: Iterable[ArtefactWorld]
    is_walls = source.name.endswith(WALLS_ENDING)
    if is_campaign := source.suffix in (".yaml", ".yml") and not is_walls:
        worlds, warnings = worlds_of_campaign(source, repeats)
    else:
        world, warnings = world_of_plan(source, base)
        worlds = (world,)
    report_diagnostics(warnings)
    settings = ExportSettings(
        laser_height=laser_height,
        resolution=resolution,
        distance=distance,
        first=first,
        forward=not backward,
        closed=closed,
        yaw=yaw.value,
        timestamp=_check_time(timestamp),
    )
    own = Templates(templates)
    written: list[str] = []
    report_diagnostics(own.unused())
    # A campaign has a folder for each world, also when there is one: paths stay the same when
    # another scenario is added.
    placed = [(w, out / file_name(w.name) if is_campaign else out) for w in worlds]
    results = export_worlds(placed, kinds, settings=settings, templates=own)
    noted: dict[str, list[str]] = {}
    for (world, _), done in zip(placed, _written(results, out), strict=True):
        for note in done.notes:
            noted.setdefault(note, []).append(world.name)
        written += map(str, done.paths)
        # Said as they are made and not at the end: with many worlds that takes a while.
        if not as_json:
            for path in done.paths:
                typer.echo(path)
    report_diagnostics(
        Diagnostic(Where(_about(source, names, len(placed))), note, severity=Severity.WARNING)
        for note, names in noted.items()
    )
    if as_json:
        ExportOutput(written).emit()


def _about(source: Path, worlds: list[str], count: int) -> str:
    """Return what a note is about: the source, with the worlds if it is not about all of them."""
    if len(worlds) == count:
        return str(source)
    more = f" and {len(worlds) - 3} more" if len(worlds) > 3 else ""
    return f"{source} ({', '.join(worlds[:3])}{more})"


def _written(results: Iterator[ExportResult], out: Path) -> Iterator[ExportResult]:
    """Yield ``results``; a folder that cannot be written is bad input."""
    from grammars.text.diagnostics import Diagnostic, InputError, Where

    try:
        yield from results
    except OSError as error:
        place = Where(str(error.filename or out))
        raise InputError(Diagnostic(place, f"cannot be written: {error.strerror}")) from error


def _check_time(text: str) -> str:
    from datetime import datetime

    try:
        return datetime.fromisoformat(text).isoformat() if text else ""
    except ValueError as error:
        raise typer.BadParameter(f"{text!r} is no time, write 2026-01-31T12:00:00+00:00") from error
