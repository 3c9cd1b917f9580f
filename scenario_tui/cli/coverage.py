"""The command that lists the features a campaign exercises, and those it leaves out."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from grammars.text.words import NOTHING, count_noun, format_quantity
from scenario_tui.cli import completion
from scenario_tui.cli.answer import Answer, ExitCode
from scenario_tui.cli.options import Processes, check_campaign_file
from scenario_tui.cli.output import plain_table, print_line, say, stdout_console
from scenario_tui.source import DaemonTarget, all_traces

if TYPE_CHECKING:
    from rich.table import Table

    from daemon.analysis.coverage import Coverage, FeatureCount, FloorArea, RoomArea


def coverage(
    subject: Annotated[
        list[str],
        typer.Argument(
            metavar="CAMPAIGN.yaml|TRACES...",
            help="A campaign file, before it runs; or recorded runs: traces (.mcap), folders of "
            "them, ids of campaigns or runs.",
            autocompletion=completion.offers(
                completion.campaigns,
                completion.runs,
                completion.files(".mcap"),
                completion.campaign_files,
            ),
        ),
    ],
    near: Annotated[
        float,
        typer.Option(min=0.01, max=1000.0, help="The robot meets a door at this distance, metres."),
    ] = 1.5,
    processes: Processes = None,
    *,
    target: DaemonTarget,
) -> Answer[Coverage]:
    """List the features that a campaign exercises, and those that it does not.

    For recorded runs also the doors met and triggered, and the floor seen and driven on.
    """
    counts = _measure_coverage(subject, near, processes, target)
    code = ExitCode.INFRASTRUCTURE if counts.unreadable else ExitCode.EXPECTED
    return Answer("coverage", counts, partial(_print, counts), code)


def _measure_coverage(
    subject: list[str], near: float, processes: int | None, target: DaemonTarget
) -> Coverage:
    from daemon.analysis.coverage import planned_coverage, trace_coverage

    # By the name alone, so that a missing campaign file is reported as a file, not as a run.
    files = [name for name in subject if name.endswith((".yaml", ".yml"))]
    if files and len(subject) > 1:
        raise typer.BadParameter("one campaign file, or traces, not both", param_hint="CAMPAIGN")
    if files:
        from daemon.campaign import expand, load_campaign
        from scenario_tui.library.submission import searches_text

        check_campaign_file(Path(files[0]))
        campaign = load_campaign(files[0])
        if words := searches_text(Path(files[0]), tuple(one.name for one in campaign.searches)):
            say(f"{words}; name its id here once it has run")
        planned = expand(campaign)
        return planned_coverage(planned.specs, planned.scenes)
    paths = all_traces(subject, target)
    return trace_coverage(paths, near=near, processes=processes)


def _print(counts: Coverage) -> None:
    """Print the tables of features, doors and floors."""
    basis = "by their traces" if counts.recorded else "as planned"
    print_line(f"{count_noun(counts.runs, 'run')}, {basis}")
    print_line()
    stdout_console().print(_feature_table(counts))
    for rows, table in ((counts.doors, _door_table), (counts.floor, _floor_table)):
        if rows:
            print_line()
            stdout_console().print(table(counts))
    for one in counts.unreadable:
        say(f"{one.trace}: error: {one.problem}")


def _feature_table(counts: Coverage) -> Table:
    """Return a table with a row per group of features: exercised ones with runs, and the others."""
    table = plain_table("feature", "", "not exercised")
    for group in counts.groups:
        exercised = ", ".join(_feature_with_runs(feature, counts) for feature in group.planned)
        others = ", ".join(feature.name for feature in group.missing)
        table.add_row(group.path.replace("/", " / "), exercised, others)
    return table


def _feature_with_runs(feature: FeatureCount, counts: Coverage) -> str:
    runs = counts.exercised(feature)
    if counts.recorded and runs < feature.planned:
        return f"{feature.name} {runs} (of {feature.planned} planned)"
    return f"{feature.name} {runs}"


def _door_table(counts: Coverage) -> Table:
    near = f"within {counts.near:g} m"
    titles = ("door", "runs", "moving", "moved", "triggered", near, "nearest")
    table = plain_table(*titles, figures=True)
    # Doors of different buildings may share a name.
    several = len({door.scene for door in counts.doors}) > 1
    for door in counts.doors:
        figures = (door.runs, door.planned, door.moved, door.triggered, door.met)
        name = f"{door.scene} {door.door}" if several else door.door
        table.add_row(name, *map(str, figures), format_quantity(door.nearest, "m"))
    return table


def _floor_table(counts: Coverage) -> Table:
    table = plain_table("floor", "free", "seen by the laser", "driven on", figures=True)
    for floor in counts.floor:
        table.add_row(floor.scene, *_area_cells(floor))
        for room in floor.rooms:
            table.add_row(f"  {room.room}", *_area_cells(room))
    return table


def _area_cells(area: FloorArea | RoomArea) -> tuple[str, str, str]:
    free = f"{area.free:.0f} m²"
    return free, _share(area.seen, area.free), _share(area.driven, area.free)


def _share(part: float, whole: float) -> str:
    return f"{part:.1f} m²  {part / whole:4.0%}" if whole else NOTHING
