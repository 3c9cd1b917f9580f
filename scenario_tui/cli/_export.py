"""The command that makes artefacts of a floor plan or a campaign."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scenario_tui.cli import _completion
from scenario_tui.cli._files import plans_or_campaigns
from scenario_tui.cli._options import AsJson

if TYPE_CHECKING:
    from collections.abc import Iterable

    from templates.world import World


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


class Yaw(StrEnum):
    """Where the robot looks at generated waypoints."""

    ZERO = "zero"
    PATH = "path"


def export(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="PLAN.fpm|CAMPAIGN.yaml",
            help="A floor plan or a campaign.",
            autocompletion=_completion.files(plans_or_campaigns),
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
        Yaw, typer.Option(help="For tasks: look along the path, or along x of the map.")
    ] = Yaw.ZERO,
    repeats: Annotated[
        int | None,
        typer.Option(min=1, help="Behaviours of the first repeats only. Default: of all."),
    ] = None,
    timestamp: Annotated[
        str, typer.Option(metavar="ISO8601", help="For prov: when. Default: left out.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Write artefacts of a floor plan or a campaign: maps, meshes, Gazebo worlds, tasks, …

    A campaign gets one folder per scenario; scenarios with equal worlds share one.
    """
    from grammars.diagnostics import Diagnostic, InputError, Severity, Where
    from scenario_tui.cli._diagnostics import report
    from scenario_tui.cli._output import emit
    from scenario_tui.cli._worlds import world_of_plan, worlds_of_campaign
    from templates.artefacts import export as write
    from templates.naming import file_name
    from templates.rendering import Templates
    from templates.world import Settings

    worlds: Iterable[World]
    if is_campaign := source.suffix in (".yaml", ".yml"):
        worlds, warnings = worlds_of_campaign(source, repeats)
    else:
        world, warnings = world_of_plan(source)
        worlds = (world,)
    report(warnings)
    settings = Settings(
        laser_height=laser_height,
        resolution=resolution,
        distance=distance,
        first=first,
        forward=not backward,
        closed=closed,
        yaw=yaw.value,
        timestamp=_checked_time(timestamp),
    )
    own = Templates(templates)
    written: list[str] = []
    report(own.unused())
    for world in worlds:
        folder = out / file_name(world.name) if is_campaign else out
        try:
            done = write(world, kinds, folder, settings=settings, templates=own)
        except OSError as error:
            place = Where(str(error.filename or folder))
            raise InputError(Diagnostic(place, f"cannot be written: {error.strerror}")) from error
        where = Where(f"{source} ({world.name})" if is_campaign else str(source))
        report(Diagnostic(where, note, severity=Severity.WARNING) for note in done.notes)
        written += map(str, done.paths)
        if not as_json:
            for path in done.paths:
                typer.echo(path)
    if as_json:
        emit("export", files=written)


def _checked_time(text: str) -> str:
    from datetime import datetime

    try:
        return datetime.fromisoformat(text).isoformat() if text else ""
    except ValueError as error:
        raise typer.BadParameter(f"{text!r} is no time, write 2026-01-31T12:00:00+00:00") from error
