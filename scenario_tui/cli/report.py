"""The command that writes reports."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from daemon.batch.errors import TraceUnavailable
from grammars.text.words import command_line
from scenario_tui.cli import completion
from scenario_tui.cli.answer import Answer, ExitCode
from scenario_tui.cli.options import (
    Processes,
    TableFile,
    check_writable,
    refuse_typed,
    why_no_folder,
)
from scenario_tui.cli.output import print_line, say, track_progress
from scenario_tui.source import DaemonTarget, bring_traces, find_campaign, open_source

if TYPE_CHECKING:
    from daemon.analysis.history import WrittenHistory
    from daemon.analysis.results import CampaignResults
    from daemon.model.status import RunRow
    from daemon.model.verbs import CampaignSource
    from scenario_tui.cli.values import WrittenReport

_DEFAULT_PAGE: Final = Path("report.html")


def report(
    context: typer.Context,
    target: DaemonTarget,
    campaign: Annotated[
        str,
        typer.Argument(
            metavar="CAMPAIGN",
            help="Id or name of a campaign or search, or its beginning; a folder of traces. "
            "Default: the newest campaign.",
            autocompletion=completion.offers(completion.campaigns, completion.files()),
        ),
    ] = "",
    output: Annotated[
        Path | None,
        typer.Option("-o", metavar="FILE", help="The page to write. Default: report.html."),
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            file_okay=False,
            help="Also write each figure of the page as PDF into this folder.",
        ),
    ] = None,
    junit: Annotated[
        Path | None,
        typer.Option(metavar="FILE", dir_okay=False, help="Write verdicts as JUnit XML."),
    ] = None,
    table: TableFile = None,
    history: Annotated[
        bool, "Write a page about all submissions of this name, and what is new."
    ] = False,
    exit_status: Annotated[bool, "Exit with the code of the verdicts, 1 for a failure."] = False,
    processes: Processes = None,
) -> Answer[WrittenReport] | Answer[WrittenHistory]:
    """Write a report of a campaign or a search: one page with figures.

    For a campaign also as JUnit XML or a table; with these alone, no page is written.
    """
    tables = {"junit": junit, "table": table}
    if figures is not None and (lacking := why_no_folder(figures.absolute().parent)):
        why = f"{figures} cannot be written: {figures.absolute().parent} {lacking}"
        raise typer.BadParameter(why, param_hint="--figures")
    for option, file in {"output": output, "junit": junit}.items():
        if file is not None:
            check_writable(file, f"--{option}")
    if output is not None and output.suffix not in ("", ".html", ".htm"):
        raise typer.BadParameter(f"{output} must end in .html", param_hint="--output")
    if history:
        pages = ("figures", "junit", "table", "exit_status")
        refuse_typed(context, pages, "does not apply to a history, which is only a page")
        return _report_history(campaign, output or _DEFAULT_PAGE, target)
    with open_source(campaign, target, judge=False) as source:
        row = find_campaign(source, campaign)
        if row.search:
            hint = f"its runs are in `scenario search {row.id} --json`"
            why = f"applies to campaigns only, and {row.id} is a search: {hint}"
            refuse_typed(context, ("figures", "junit", "table"), why)
            return _report_search(source, row.id, output or _DEFAULT_PAGE, exit_status, target)
        from daemon.analysis.results import read_results

        results = read_results(source, row)
        specs = [source.run(run.id).spec for run in results.rows]
        results = with_traces(results, source, target)
    # With table formats only, no page is written.
    page = output or (None if any(tables.values()) and not figures else _DEFAULT_PAGE)
    from daemon.analysis.report import (
        headline,
        read_report_data,
        report_table,
        write_junit,
        write_page,
    )
    from scenario_tui.cli.values import WrittenReport

    bar = partial(track_progress, description="reading traces")
    material = read_report_data(results, specs, processes=processes, watched=bar)
    if page is not None:
        text = write_page(material, _run_commands, processes=processes, figure_folder=figures)
        _write_page(page, text)
    if junit is not None:
        records = tuple(run.record for run in material.runs)
        write_junit(row.name, material.assessment, records, junit)
    if table is not None:
        from daemon.analysis.table import write_table

        write_table(report_table(material), table)
    files = {"page": page, "figures": figures} | tables
    _, word, sentence = headline(material.assessment, material.runs)
    code = material.assessment.exit_code
    report = WrittenReport(
        row.name,
        len(material.runs),
        f"{word}. {sentence}",
        code,
        {kind: str(path) for kind, path in files.items() if path},
        material.references,
    )
    # A folder may have the name of a campaign, so print the id as well.
    lines = partial(_print_written, report, f"{row.name} ({row.id})", results.unread)
    return Answer("report", report, lines, code if exit_status else ExitCode.EXPECTED)


def with_traces(
    results: CampaignResults, source: CampaignSource, target: DaemonTarget
) -> CampaignResults:
    """Return results whose traces are local files; the reason explains a missing trace."""
    rows = [row for row in results.rows if row.trace]
    brought = dict(zip((row.id for row in rows), bring_traces(rows, source, target), strict=True))

    def local(row: RunRow) -> RunRow:
        trace = brought.get(row.id)
        if isinstance(trace, TraceUnavailable):
            return replace(row, trace="", reason=f"{row.reason} {trace}".strip())
        return replace(row, trace=str(trace or ""))

    return replace(results, rows=tuple(map(local, results.rows)))


def _report_history(campaign: str, page: Path, target: DaemonTarget) -> Answer[WrittenHistory]:
    """Write the page of a campaign's history.

    Raises :class:`daemon.batch.errors.Refused` if the campaign does not exist.
    """
    from daemon.analysis.history import WrittenHistory, history_page, read_history

    with target.read() as source:
        history = read_history(source, find_campaign(source, campaign).name)
    _write_page(page, history_page(history))
    report = WrittenHistory(history.headline, history, {"page": str(page)})
    return Answer("history", report, partial(_print_written, report, history.name))


def _report_search(
    source: CampaignSource, campaign: str, page: Path, exit_status: bool, target: DaemonTarget
) -> Answer[WrittenReport]:
    """Write the page of a search; it has no expectations, hence no tables of verdicts."""
    from daemon.search.answers.sentences import headline
    from daemon.search.page import search_page
    from scenario_tui.cli.search import search_code
    from scenario_tui.cli.values import WrittenReport
    from scenario_tui.text.search_text import search_commands

    row = source.search_row(campaign)
    assert row is not None  # its campaign is one of a search
    runs = source.all_runs(campaign, results=True)
    best = row.answer.shown if row.answer is not None else None
    recorded = [run for run in runs if best is not None and run.id == best.run and run.trace]
    # Without its trace, the page has no pictures of the run.
    brought = zip(recorded, bring_traces(recorded, source, target), strict=True)
    traces = {run.id: trace for run, trace in brought if isinstance(trace, Path)}
    text = search_page(row, runs, traces=traces, commands=search_commands(row))
    _write_page(page, text)
    code = search_code(row)
    report = WrittenReport(row.name, len(runs), headline(row), int(code), {"page": str(page)})
    lines = partial(_print_written, report, f"{row.task.name} ({campaign})")
    return Answer("report", report, lines, code if exit_status else ExitCode.EXPECTED)


def _write_page(page: Path, text: str) -> None:
    """Write a page; say so if it replaces another."""
    if page.exists():
        say(f"{page} was there and is replaced; -o FILE writes elsewhere")
    page.write_text(text, encoding="utf-8")


def _run_commands(run: str, oracle: str, failed: bool) -> list[tuple[str, str]]:
    """Return commands about a run, each with its purpose."""
    commands = [
        (command_line("replay", run, "--from", oracle), "watch that moment"),
        (command_line("replay", run), "watch it again"),
        (command_line("export", run, "picture", "-o", "run.svg"), "a picture of it"),
        (command_line("judge", run), "judge it again"),
    ]
    if failed:
        commands.append((command_line("blame", run), "find out why it fails"))
    return commands


def _print_written(
    report: WrittenReport | WrittenHistory, subject: str, unread: Sequence[tuple[str, str]] = ()
) -> None:
    """Print the outcome and the written files."""
    from rich.filesize import decimal

    lines = [f"{subject}: {report.answer}"]
    lines += [f"not read: {file}: {problem}" for file, problem in unread]
    for path in report.written.values():
        is_file = Path(path).is_file()
        lines.append(f"{path} ({decimal(Path(path).stat().st_size)})" if is_file else path)
    for line in lines:
        print_line(line)
