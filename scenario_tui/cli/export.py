"""The command that makes artefacts of a floor plan, a campaign or a recorded run."""

from __future__ import annotations

from datetime import datetime
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

import typer

from grammars.text.diagnostics import Finding, Severity, Where
from scenario_tui.cli import completion
from scenario_tui.cli.answer import Answer
from scenario_tui.cli.exit_codes import CommandError, ExitCode
from scenario_tui.cli.export_runs import ExportedFiles, export_recorded, is_recorded
from scenario_tui.cli.options import Base, check_folder, refuse_typed
from scenario_tui.cli.output import print_line, report_findings, say, track_progress
from scenario_tui.source import DaemonTarget

if TYPE_CHECKING:
    from collections.abc import Sequence

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
_OF_PICTURES: Final = ("since", "until")
"""Parameters that mean nothing but for the picture of a run."""


def export(
    context: typer.Context,
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="A floor plan (.fpm, .jsonld or a folder of .json), a walls layer "
            "(.walls.yaml), a campaign file; a recorded run or its trace (.mcap), a campaign that "
            "was submitted.",
            autocompletion=completion.offers(
                completion.runs,
                completion.files(".mcap", ".fpm", ".jsonld", ".json", ".walls.yaml"),
                completion.campaign_files,
            ),
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
            help="Folder to write to; for the picture of a run also its file, run.svg.",
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
        Literal["zero", "path"],
        typer.Option(help="For tasks: look along the path, or along x of the map."),
    ] = "zero",
    repeats: Annotated[
        int | None,
        typer.Option(min=1, help="Behaviours of the first repeats only. Default: of all."),
    ] = None,
    timestamp: Annotated[
        datetime | None,
        typer.Option(
            metavar="ISO8601",
            formats=["%Y-%m-%d", "%Y-%m-%dT%H:%M:%S", "%Y-%m-%dT%H:%M:%S%z"],
            help="For prov: when. Default: left out.",
        ),
    ] = None,
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
    *,
    target: DaemonTarget,
) -> Answer[ExportedFiles]:
    """Write artefacts of a building, a campaign or a run: maps, worlds, pictures, traces, …

    A campaign gets one folder per scenario; scenarios with equal worlds share one. Traces come
    from a daemon or the store they lie in, and each is verified; what was interrupted goes on.
    """
    if is_recorded(source, kinds):
        refuse_typed(context, _OF_FILES, "are of floor plans and campaign files, not of runs")
        if Artefact.PICTURE not in kinds:
            refuse_typed(context, _OF_PICTURES, "goes with picture only")
        value = export_recorded(source, kinds, out, target, (since, until))
    else:
        from templates.world import ExportSettings

        refuse_typed(context, _OF_PICTURES, "goes with a picture of a run")
        for kind, names in _OF_KINDS.items():
            if kind not in kinds and Artefact.ALL not in kinds:
                refuse_typed(context, names, f"goes with {kind}")
        settings = ExportSettings(
            laser_height=laser_height,
            resolution=resolution,
            distance=distance,
            first=first,
            forward=not backward,
            closed=closed,
            yaw=yaw,
            timestamp=timestamp.isoformat() if timestamp else "",
        )
        check_folder(out, "--out")
        value = _export_files(_worlds(source, out, repeats, base), kinds, settings, source)
    code = ExitCode.INFRASTRUCTURE if value.missing else ExitCode.EXPECTED
    return Answer("export", value, partial(_print, value), code)


def _print(exported: ExportedFiles) -> None:
    for path in exported.files:
        print_line(str(path))
    for reason in exported.missing.values():
        say(reason)


def _worlds(
    source: Path, out: Path, repeats: int | None, base: str
) -> list[tuple[ArtefactWorld, Path]]:
    """Return the worlds of a plan or a campaign, each with the folder it is written to."""
    from daemon.analysis.campaign_worlds import worlds_of_campaign
    from grammars.floorplan import WALLS_ENDING
    from templates.naming import file_name

    if source.suffix not in (".yaml", ".yml") or source.name.endswith(WALLS_ENDING):
        world, warnings = world_of_plan(source, base)
        report_findings(warnings)
        return [(world, out)]
    worlds, warnings = worlds_of_campaign(source, repeats)
    report_findings(warnings)
    # Also when there is one: paths stay the same when another scenario is added.
    return [(world, out / file_name(world.name)) for world in worlds]


def _export_files(
    worlds: Sequence[tuple[ArtefactWorld, Path]],
    kinds: Sequence[Artefact],
    settings: ExportSettings,
    source: Path,
) -> ExportedFiles:
    """Write artefacts of every world into its folder, once they can be made of all of them."""
    from templates.artefacts import choose_kinds, export

    for world, _ in worlds:
        choose_kinds(world, kinds)
    files: list[Path] = []
    notes: dict[str, list[str]] = {}
    for world, folder in track_progress(worlds, len(worlds), "exporting"):
        try:
            result = export(world, kinds, folder, settings=settings)
        except OSError as error:
            place = error.filename or folder
            raise CommandError(f"{place} cannot be written: {error.strerror}") from error
        files += result.paths
        for note in result.notes:
            notes.setdefault(note, []).append(world.name)
    report_findings(
        Finding(Where(_about(source, names, len(worlds))), note, severity=Severity.WARNING)
        for note, names in notes.items()
    )
    return ExportedFiles(tuple(files))


def _about(source: Path, worlds: list[str], count: int) -> str:
    """Return what a note is about: the source, with the worlds if it is not about all of them."""
    if len(worlds) == count:
        return str(source)
    more = f" and {len(worlds) - 3} more" if len(worlds) > 3 else ""
    return f"{source} ({', '.join(worlds[:3])}{more})"
