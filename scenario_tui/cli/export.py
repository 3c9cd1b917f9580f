"""The command that writes artefacts of a floor plan, a campaign or a recorded run."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

import typer

from daemon.batch.errors import TraceUnavailable
from grammars.text.diagnostics import Finding, Severity, Where
from grammars.text.words import first_words
from scenario_tui.cli import completion
from scenario_tui.cli.answer import Answer, CommandError, ExitCode, wrong_usage
from scenario_tui.cli.options import Base, check_folder, check_writable, refuse_typed
from scenario_tui.cli.output import print_line, report_findings, say, track_progress
from scenario_tui.source import DaemonTarget, bring_traces, one_trace, recorded_runs, trace_files

if TYPE_CHECKING:
    from collections.abc import Sequence

    from templates.world import ArtefactWorld, ExportSettings


@dataclass(frozen=True, slots=True)
class ExportedFiles:
    """Exported files, and the reasons why traces are ``missing`` by their runs."""

    files: tuple[Path, ...]
    missing: dict[str, str] = field(default_factory=dict)


def world_of_plan(path: Path, base: str = "") -> tuple[ArtefactWorld, tuple[Finding, ...]]:
    """Return the world of a plan (`.fpm`, `.walls.yaml` or JSON-LD), and the warnings about it.

    Relative identifiers of JSON-LD resolve against ``base``, by default the file's address.
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
        # The files of a folder are named after their parts of the plan; the plan has its own name.
        name = path.stem if path.suffix != ".json" and path.is_file() else plan.name
    world = ArtefactWorld(name, compile_scene(plan), plan, sources=model_files(path))
    return world, plan.warnings


Artefact = StrEnum(
    "Artefact", "ALL MAP JSONLD MESH SDF KEYFRAMES TASKS LAUNCH FOXGLOVE PICTURE PROV TRACES"
)
"""Kinds of artefacts of a floor plan, a campaign or a recorded run."""
_RECORDED_KINDS: Final = ("picture", "traces")
_PICTURE_ENDINGS: Final = (".svg", ".png", ".pdf")
_FILE_ENDINGS: Final = (".fpm", ".yaml", ".yml", ".json", ".jsonld", ".variation", ".scenery")
"""Endings of files that people write, for names of files that do not exist."""
_OF_FILES: Final = (
    "laser_height", "resolution", "distance", "first", "backward", "closed", "yaw", "repeats",
    "timestamp", "base",
)  # fmt: skip
"""Parameters that do not apply to recorded runs."""
_OF_KINDS: Final[dict[str, tuple[str, ...]]] = {
    "tasks": ("distance", "first", "backward", "closed", "yaw"),
    "prov": ("timestamp",),
}
"""Parameters that apply to this kind only."""
_OF_PICTURES: Final = ("since", "until")
"""Parameters that apply to the picture of a run only."""


def export(
    context: typer.Context,
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="A floor plan (.fpm, .jsonld or a folder of .json), a walls layer "
            "(.walls.yaml), a campaign file, a recorded run or its trace (.mcap), or a submitted "
            "campaign.",
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
            "keyframes (campaigns only), tasks, launch (ROS), foxglove, picture, prov; for "
            "recorded runs: picture or traces.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "-o",
            metavar="PATH",
            help="Folder to write to; for the picture of a run, also a file such as run.svg.",
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
        float, typer.Option(min=0.01, help="For tasks: distance from the walls, metres.")
    ] = 0.7,
    first: Annotated[int, typer.Option(min=0, help="For tasks: the first waypoint.")] = 0,
    backward: Annotated[bool, "For tasks: the other way round."] = False,
    closed: Annotated[bool, "For tasks: return to the first waypoint."] = False,
    yaw: Annotated[
        Literal["zero", "path"], "For tasks: look along the path, or along x of the map."
    ] = "zero",
    repeats: Annotated[
        int | None, typer.Option(min=1, help="Behaviours of the first repeats only. Default: all.")
    ] = None,
    timestamp: Annotated[
        datetime | None,
        typer.Option(
            metavar="ISO8601",
            formats=["%Y-%m-%d", "%Y-%m-%dT%H:%M:%S", "%Y-%m-%dT%H:%M:%S%z"],
            help="For prov: time of the export. Default: left out.",
        ),
    ] = None,
    base: Base = "",
    since: Annotated[
        float | None,
        typer.Option(
            "--from", metavar="SECONDS", help="For the picture of a run: a close-up from here on."
        ),
    ] = None,
    until: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="For the picture of a run: a close-up up to here."),
    ] = None,
    *,
    target: DaemonTarget,
) -> Answer[ExportedFiles]:
    """Write artefacts of a building, a campaign or a run: maps, worlds, pictures, traces, …

    A campaign gets one folder per scenario; scenarios with equal worlds share one. Traces come
    from a daemon or from their store, and each is verified. An interrupted export can be resumed.
    """
    if _is_recorded(source, kinds):
        refuse_typed(context, _OF_FILES, "applies to floor plans and campaign files, not to runs")
        if "picture" not in kinds:
            refuse_typed(context, _OF_PICTURES, "applies to a picture only")
        value = _export_recorded(source, kinds, out, target, (since, until))
    else:
        from templates.world import ExportSettings

        refuse_typed(context, _OF_PICTURES, "applies to the picture of a run only")
        for kind, names in _OF_KINDS.items():
            if kind not in kinds and "all" not in kinds:
                refuse_typed(context, names, f"applies to {kind} only")
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


def _is_recorded(source: Path, kinds: Sequence[str]) -> bool:
    """Return True if the source is a trace, a run or a submitted campaign."""
    # `scenario new patrol` makes a folder with the name of its campaign, which has traces as well.
    if source.suffix == ".mcap" or "traces" in kinds:
        return True
    return not source.exists() and source.suffix not in _FILE_ENDINGS and len(source.parts) == 1


def _export_recorded(
    source: Path,
    kinds: Sequence[str],
    out: Path,
    target: DaemonTarget,
    part: tuple[float | None, float | None],
) -> ExportedFiles:
    """Write the traces of recorded runs into the folder ``out``, or the picture of one run.

    The picture shows the ``part`` of the run between two moments [s]. Raises wrong usage for other
    kinds, and for both at a time.
    """
    if len(kinds) != 1 or kinds[0] not in _RECORDED_KINDS:
        other = [kind for kind in kinds if kind not in _RECORDED_KINDS]
        message = "recorded runs have `picture` and `traces`, one at a time"
        if other and "traces" not in kinds:
            about = f"{other[0]} needs a building or a campaign file, and {source} is not a file"
            message = f"{about}: {message}"
        raise typer.BadParameter(message, param_hint="KIND")
    if kinds[0] == "traces":
        check_folder(out, "--out")
        return _copy_traces(str(source), out, target)
    from daemon.analysis.report.run_maps import draw_run

    path = out
    if out.is_dir() or not out.suffix:
        path = out / f"{source.name.removesuffix('.mcap')}.svg"
    if path.suffix not in _PICTURE_ENDINGS:
        raise typer.BadParameter(f"{path} must end in .svg, .png or .pdf", param_hint="--out")
    check_writable(path, "--out")
    trace = one_trace(str(source), target)
    with wrong_usage("--from, --until"):
        draw_run(trace, path, since=part[0], until=part[1])
    return ExportedFiles((path,))


def _copy_traces(name: str, folder: Path, target: DaemonTarget) -> ExportedFiles:
    """Copy the traces of a campaign or a run, from a daemon or their store.

    Each is verified. Interrupted copies are resumed, and complete ones are kept.
    """
    if Path(name).is_file() and trace_files(name):
        raise typer.BadParameter(f"the trace {name} is already here", param_hint="SOURCE")
    with target.read() as source:
        rows = recorded_runs(source, name, target)
        traces = bring_traces(rows, source, target, folder)
    pairs = zip(rows, traces, strict=True)
    missing = {row.id: str(one) for row, one in pairs if isinstance(one, TraceUnavailable)}
    return ExportedFiles(tuple(one for one in traces if isinstance(one, Path)), missing)


def _print(exported: ExportedFiles) -> None:
    for path in exported.files:
        print_line(str(path))
    for reason in exported.missing.values():
        say(reason)


def _worlds(
    source: Path, out: Path, repeats: int | None, base: str
) -> list[tuple[ArtefactWorld, Path]]:
    """Return the worlds of a plan or a campaign, each with its folder."""
    from daemon.analysis.campaign_worlds import worlds_of_campaign
    from grammars.floorplan import WALLS_ENDING
    from templates.naming import file_name

    if source.suffix not in (".yaml", ".yml") or source.name.endswith(WALLS_ENDING):
        world, warnings = world_of_plan(source, base)
        report_findings(warnings)
        return [(world, out)]
    worlds, warnings = worlds_of_campaign(source, repeats)
    report_findings(warnings)
    # Also for a single world: paths stay the same when another scenario is added.
    return [(world, out / file_name(world.name)) for world in worlds]


def _export_files(
    worlds: Sequence[tuple[ArtefactWorld, Path]],
    kinds: Sequence[Artefact],
    settings: ExportSettings,
    source: Path,
) -> ExportedFiles:
    """Write artefacts of every world into its folder, after all kinds have been checked."""
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
    """Return the subject of a note: the source, with the worlds unless all of them have it."""
    if len(worlds) == count:
        return str(source)
    return f"{source} ({first_words(worlds)})"
