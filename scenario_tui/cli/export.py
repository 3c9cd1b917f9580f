"""The command that makes artefacts of a floor plan, a campaign or a recorded run."""

from __future__ import annotations

import shutil
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Final

import typer

from scenario_tui.cli import completion
from scenario_tui.cli.export_runs import (
    PICTURE_ENDINGS,
    WallClockOption,
    export_recorded,
    is_recorded,
)
from scenario_tui.cli.options import AsJson, Base, Connect, State, check_folder, check_writable
from scenario_tui.cli.output import Output, report_findings

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from grammars.text.diagnostics import Finding
    from templates.artefacts import ExportResult
    from templates.world import ArtefactWorld, ExportSettings


def world_of_plan(path: Path, base: str = "") -> tuple[ArtefactWorld, tuple[Finding, ...]]:
    """Return the world of a plan (`.fpm`, `.walls.yaml` or JSON-LD), and the warnings about it.

    Relative identifiers of JSON-LD resolve against ``base``, else against the file's address.
    """
    from grammars.floorplan import WALLS_ENDING, load_floorplan
    from grammars.jsonld import load_floorplan_jsonld
    from grammars.maps import load_walls
    from grammars.scenery.composition import compile_scene
    from grammars.text.sources import is_jsonld, model_files
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
    """Kinds of artefacts of a floor plan, a campaign or a recorded run."""

    ALL = "all"
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
    TRACES = "traces"


_ONE_FILE: Final[dict[Artefact, tuple[str, ...]]] = {
    Artefact.JSONLD: (".jsonld",),
    Artefact.MESH: (".stl", ".glb"),
    Artefact.LAUNCH: (".launch", ".xml"),
    Artefact.FOXGLOVE: (".json",),
    Artefact.PICTURE: PICTURE_ENDINGS,
    Artefact.PROV: (".ttl",),
}
"""Kinds of which one file with each of these endings is made; of others there are several."""
_ENDINGS: Final = frozenset(
    {".yaml", ".pgm", ".sdf", ".world", ".html", ".txt"}.union(*_ONE_FILE.values())
)


_OF_FILES: Final = (
    "laser_height", "resolution", "distance", "first", "backward", "closed", "yaw", "repeats",
    "timestamp", "base",
)  # fmt: skip
"""Parameters that mean nothing for recorded runs."""
_OF_KINDS: Final[dict[Artefact, tuple[str, ...]]] = {
    Artefact.TASKS: ("distance", "first", "backward", "closed", "yaw"),
    Artefact.PROV: ("timestamp",),
}
"""Parameters that mean nothing without this kind."""


class WaypointYaw(StrEnum):
    """Headings of the robot at generated waypoints."""

    ZERO = "zero"
    PATH = "path"


class ExportOutput(Output, schema="export"):
    """The files that were written."""

    files: list[str]


def export(
    context: typer.Context,
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="A floor plan (.fpm, .jsonld or a folder of .json), a walls layer "
            "(.walls.yaml), a campaign file; a recorded run or its trace (.mcap), a campaign that "
            "was submitted.",
            autocompletion=completion.exportable,
        ),
    ],
    kinds: Annotated[
        list[Artefact],
        typer.Argument(
            metavar="KIND",
            help="all, or any of: jsonld, map, mesh, sdf (Gazebo), "
            "keyframes (of campaigns only), tasks, launch (ROS), foxglove, picture, prov; of "
            "recorded runs picture or traces.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            "-o",
            metavar="PATH",
            help="Folder to write to, or with its ending the file: plan.jsonld, run.svg.",
        ),
    ] = Path(),
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
    since: Annotated[
        float | None,
        typer.Option(
            "--from", metavar="SECONDS", help="For the picture of a run: closely, from here on."
        ),
    ] = None,
    until: Annotated[
        float | None,
        typer.Option(
            "--until", metavar="SECONDS", help="For the picture of a run: closely, up to here."
        ),
    ] = None,
    wall_clock: WallClockOption = False,
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Write artefacts of a building, a campaign or a run: maps, worlds, pictures, traces, …

    A campaign gets one folder per scenario; scenarios with equal worlds share one. Traces come
    from a daemon or the store they lie in, and each is verified; what was interrupted goes on.
    """
    if is_recorded(source):
        from scenario_tui.cli.target import DaemonTarget

        _refuse_options(context, _OF_FILES, "are of floor plans and campaign files, not of runs")
        target, part = DaemonTarget(connect, state), (since, until)
        export_recorded(source, kinds, out, target, part, wall_clock, as_json=as_json)
        return
    if Artefact.TRACES in kinds:
        raise typer.BadParameter("traces are of recorded runs, not of files", param_hint="KIND")
    if since is not None or until is not None:
        raise typer.BadParameter("goes with a picture of a run", param_hint="--from, --until")
    if wall_clock:
        raise typer.BadParameter("goes with traces", param_hint="--wall-clock")
    for kind, names in _OF_KINDS.items():
        if kind not in kinds and Artefact.ALL not in kinds:
            _refuse_options(context, names, f"goes with {kind}")
    named = _named_file(out, kinds)
    from daemon.analysis.campaign_worlds import worlds_of_campaign
    from grammars.floorplan import WALLS_ENDING
    from grammars.text.diagnostics import Finding, Severity, Where
    from templates.naming import file_name
    from templates.world import ExportSettings

    worlds: Iterable[ArtefactWorld]
    is_walls = source.name.endswith(WALLS_ENDING)
    if is_campaign := source.suffix in (".yaml", ".yml") and not is_walls:
        worlds, warnings = worlds_of_campaign(source, repeats)
    else:
        world, warnings = world_of_plan(source, base)
        worlds = (world,)
    report_findings(warnings)
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
    if named is not None:
        check_writable(named, "--out")
        if named.exists() and named.samefile(source):
            raise typer.BadParameter(f"{named} is what is exported", param_hint="--out")
    else:
        check_folder(out, "--out")
    files: list[str] = []
    # A campaign has a folder for each world, also when there is one: paths stay the same when
    # another scenario is added.
    placed = [(w, out / file_name(w.name) if is_campaign else out) for w in worlds]
    if named is not None and len(placed) > 1:
        message = f"{source} has {len(placed)} worlds, which are more than {named}: name a folder"
        raise typer.BadParameter(message, param_hint="--out")
    results = _make(placed, named, kinds, settings)
    noted: dict[str, list[str]] = {}
    for (world, _), done in zip(placed, _written(results, out), strict=True):
        for note in done.notes:
            noted.setdefault(note, []).append(world.name)
        files += map(str, done.paths)
        # Said as they are made and not at the end: with many worlds that takes a while.
        if not as_json:
            for path in done.paths:
                typer.echo(path)
    report_findings(
        Finding(Where(_about(source, names, len(placed))), note, severity=Severity.WARNING)
        for note, names in noted.items()
    )
    if as_json:
        ExportOutput(files).emit()


def _refuse_options(context: typer.Context, names: Sequence[str], why: str) -> None:
    """Refuse parameters that were typed although they mean nothing here."""
    sources = {name: context.get_parameter_source(name) for name in names}
    typed = [
        parameter.opts[0]
        for parameter in context.command.params
        if (source := sources.get(parameter.name or "")) and source.name == "COMMANDLINE"
    ]
    if typed:
        raise typer.BadParameter(why, param_hint=", ".join(typed))


def _named_file(out: Path, kinds: Sequence[Artefact]) -> Path | None:
    """Return the file that is to be written, ``None`` where a folder is meant."""
    endings = _ONE_FILE.get(kinds[0], ()) if len(kinds) == 1 else ()
    if not endings or out.is_dir() or out.suffix not in _ENDINGS:
        return None
    if out.suffix not in endings:
        message = f"a file of {kinds[0]} ends in {' or '.join(endings)}"
        raise typer.BadParameter(message, param_hint="--out")
    return out


def _make(
    placed: Sequence[tuple[ArtefactWorld, Path]],
    named: Path | None,
    kinds: Sequence[Artefact],
    settings: ExportSettings,
) -> Iterator[ExportResult]:
    """Yield what is made of each world, in its folder or, of one world, as the file ``named``."""
    from templates.artefacts import ExportResult, choose_kinds, export
    from templates.picture import draw_world, write_drawing

    for world, _ in placed:
        choose_kinds(world, kinds)
    if named is None:
        for world, folder in placed:
            yield export(world, kinds, folder, settings=settings)
        return
    ((world, _),) = placed
    if named.suffix == ".pdf":
        # None of the files of a folder: the parts of a PDF come in another order every time.
        write_drawing(draw_world(world), named)
        yield ExportResult({str(kinds[0]): (named,)}, ())
        return
    with TemporaryDirectory() as temporary:
        done = export(world, kinds, Path(temporary), settings=settings)
        # Of several files with one ending, the first is the whole.
        file = next(path for path in done.paths if path.suffix == named.suffix)
        shutil.move(file, named)
        yield replace(done, made={str(kinds[0]): (named,)})


def _about(source: Path, worlds: list[str], count: int) -> str:
    """Return what a note is about: the source, with the worlds if it is not about all of them."""
    if len(worlds) == count:
        return str(source)
    more = f" and {len(worlds) - 3} more" if len(worlds) > 3 else ""
    return f"{source} ({', '.join(worlds[:3])}{more})"


def _written(results: Iterator[ExportResult], out: Path) -> Iterator[ExportResult]:
    """Yield ``results``; a folder that cannot be written is bad input."""
    from grammars.text.diagnostics import Finding, InputError, Where

    try:
        yield from results
    except OSError as error:
        place = Where(str(error.filename or out))
        raise InputError(Finding(place, f"cannot be written: {error.strerror}")) from error


def _check_time(text: str) -> str:
    from datetime import datetime

    try:
        return datetime.fromisoformat(text).isoformat() if text else ""
    except ValueError as error:
        raise typer.BadParameter(f"{text!r} is no time, write 2026-01-31T12:00:00+00:00") from error
