"""The command that writes reports, and pictures of single runs."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from scenario_tui.cli import _completion
from scenario_tui.cli._exits import ExitCode
from scenario_tui.cli._options import AsJson, Connect, State

if TYPE_CHECKING:
    from daemon.report import Chosen, Command, Material
    from scenario_tui.cli._session import Target

_DEFAULT: Final = Path("report.html")
_LOOKS: Final = (
    ("replay", "scenario replay {run}", "watch it again", False),
    ("report", "scenario report --run {run} -o run.svg", "a picture of it", False),
    ("judge", "scenario judge {run}", "judge it again", False),
    ("blame", "scenario blame {run}", "find out what makes it fail", True),
)


def report(
    campaign: Annotated[
        str,
        typer.Argument(
            metavar="CAMPAIGN",
            help="A folder of traces, or id or name of a campaign, or how it begins. "
            "Default: the newest campaign.",
            autocompletion=_completion.campaigns_or_folders,
        ),
    ] = "",
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="The page to write. Default: report.html."
        ),
    ] = None,
    junit: Annotated[
        Path | None,
        typer.Option("--junit", metavar="FILE", help="Write verdicts as JUnit XML."),
    ] = None,
    csv: Annotated[
        Path | None,
        typer.Option("--csv", metavar="FILE", help="Write all measures and margins as CSV."),
    ] = None,
    parquet: Annotated[
        Path | None,
        typer.Option("--parquet", metavar="FILE", help="The same as Parquet."),
    ] = None,
    run: Annotated[
        str,
        typer.Option(
            "--run",
            metavar="RUN",
            help="Only draw this run: an id or a trace (.svg or .png).",
            autocompletion=_completion.runs_or_traces,
        ),
    ] = "",
    exit_status: Annotated[
        bool,
        typer.Option("--exit-status", help="Leave with the code of the verdicts, 1 for a failure."),
    ] = False,
    processes: Annotated[
        int | None,
        typer.Option("--processes", "-j", min=1, max=1024, help="Default: one per core."),
    ] = None,
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Write a campaign as one page with figures, or as tables for machines."""
    from daemon.report import gather, write_csv, write_junit, write_page, write_parquet
    from scenario_tui.cli._output import watched
    from scenario_tui.cli._session import Target

    target = Target(connect, state)
    if run:
        _draw(run, campaign, output, target, as_json=as_json)
        return
    tables = {"junit": junit, "csv": csv, "parquet": parquet}
    page = output or (None if any(tables.values()) else _DEFAULT)
    chosen = _chosen(campaign, target)
    bar = partial(watched, description="reading traces")
    material = gather(chosen, processes=processes, watched=bar)
    if page is not None:
        _write(page, write_page(material, _commands(), processes=processes))
    for writer, path in ((write_junit, junit), (write_csv, csv), (write_parquet, parquet)):
        if path is not None:
            writer(material, path)
    written = {"page": page} | tables
    _tell(material, {kind: path for kind, path in written.items() if path}, as_json=as_json)
    if exit_status:
        raise typer.Exit(ExitCode(material.assessment.exit_code))


def _chosen(campaign: str, target: Target) -> Chosen:
    """Return what is meant: a folder of traces, else a campaign of the state directory.

    Of a daemon that was named, the traces are brought here.
    """
    from daemon.report import folder_of_traces, open_ledger, recorded
    from scenario_tui.cli._session import find_campaign

    folder = Path(campaign)
    if campaign and folder.is_dir():
        return folder_of_traces(folder)
    if folder.suffix == ".mcap":
        message = "a report is about a campaign or a folder of traces"
        raise typer.BadParameter(f"{message}: for one run there is --run", param_hint="CAMPAIGN")
    if target.named:
        return _brought(campaign, target)
    with open_ledger(target.places) as reader:
        return recorded(reader, find_campaign(reader, campaign), target.places)


def _brought(campaign: str, target: Target) -> Chosen:
    from daemon.errors import NotAtHand
    from daemon.report import assembled
    from daemon.store import local_copy
    from daemon.store import recorded as recorded_trace
    from scenario_tui.cli._chosen import progress
    from scenario_tui.cli._session import find_campaign

    with target.open() as daemon:
        row = find_campaign(daemon, campaign)
        records = list(daemon.records(row.id))
        runs = [daemon.run(record.id) for record in records]
        size = sum(run.result.trace.size for run in runs if run.result is not None)
        with progress(size) as told:
            for position, run in enumerate(runs):
                if records[position].trace is None:
                    continue
                try:
                    path = local_copy(recorded_trace(run), daemon, told=told)
                    records[position] = replace(records[position], trace=str(path))
                except NotAtHand as error:
                    note = f"{records[position].note} {error}".strip()
                    records[position] = replace(records[position], trace=None, note=note)
        declared = daemon.declared(row.id)
    specs = [run.spec for run in runs]
    return assembled(row, target.endpoint, declared, records, specs)


def _commands() -> tuple[Command, ...]:
    """Return what can be typed about a run with this version."""
    from daemon.report import Command
    from scenario_tui.cli._main import command_names

    known = command_names()
    return tuple(
        Command(text, purpose, failing) for name, text, purpose, failing in _LOOKS if name in known
    )


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def _tell(material: Material, written: dict[str, Path], *, as_json: bool) -> None:
    from daemon.report import answer
    from scenario_tui.cli._output import emit, out

    said = answer(material.assessment, material.runs)
    if as_json:
        emit(
            "report",
            campaign=material.chosen.name,
            runs=len(material.runs),
            answer=f"{said.word}. {said.sentence}",
            exit_code=material.assessment.exit_code,
            written={kind: str(path) for kind, path in written.items()},
        )
        return
    console = out()
    # A folder may be called like a campaign: say which of them this is about.
    about = f"{material.chosen.name} ({material.chosen.id or material.chosen.where})"
    console.print(f"{about}: {said.word}. {said.sentence}", markup=False, soft_wrap=True)
    for file, problem in material.chosen.unread:
        console.print(f"not read: {file}: {problem}", markup=False, soft_wrap=True)
    for path in written.values():
        size = path.stat().st_size / 1e6
        console.print(f"{path} ({size:.2f} MB)", markup=False, soft_wrap=True)


def _draw(run: str, campaign: str, output: Path | None, target: Target, *, as_json: bool) -> None:
    from daemon.report import draw_run
    from scenario_tui.cli._chosen import one_trace
    from scenario_tui.cli._output import emit, out

    if campaign:
        raise typer.BadParameter("name a campaign or a run, not both", param_hint="--run")
    path = output or Path("run.svg")
    if path.suffix not in (".svg", ".png"):
        raise typer.BadParameter(f"{path} must end in .svg or .png", param_hint="--output")
    trace = one_trace(run, target, "--run")
    draw_run(trace, path)
    if as_json:
        emit("picture", trace=str(trace), written=str(path))
        return
    out().print(str(path), markup=False, soft_wrap=True)
