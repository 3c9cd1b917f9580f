"""The command that writes reports."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from scenario_tui.cli import completion
from scenario_tui.cli.exit_codes import ExitCode
from scenario_tui.cli.options import (
    AsJson,
    Connect,
    Processes,
    State,
    check_writable,
    why_no_folder,
)
from scenario_tui.cli.output import Output, stdout_console, track_progress

if TYPE_CHECKING:
    from daemon.analysis.history import CampaignHistory
    from daemon.analysis.report import SuggestedCommand
    from daemon.analysis.results import Results
    from daemon.model.assessments import ReferenceComparison
    from scenario_tui.cli.target import DaemonTarget

_DEFAULT_PAGE: Final = Path("report.html")


class ReportOutput(Output, schema="report"):
    """Outcome of a campaign or a search, and the files ``written`` about it by their kind.

    ``references`` are what others found of the same beside what was found here.
    """

    campaign: str
    runs: int
    answer: str
    exit_code: int
    written: dict[str, str]
    references: tuple[ReferenceComparison, ...] = ()


class HistoryOutput(Output, schema="history"):
    """The submissions of a campaign, the oldest first, and the page that was written about them."""

    answer: str
    history: CampaignHistory
    written: dict[str, str]


def report(
    campaign: Annotated[
        str,
        typer.Argument(
            metavar="CAMPAIGN",
            help="A folder of traces, or id or name of a campaign or search, or how it begins. "
            "Default: the newest campaign.",
            autocompletion=completion.campaigns_or_folders,
        ),
    ] = "",
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="The page to write. Default: report.html."
        ),
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option(
            "--figures",
            metavar="FOLDER",
            file_okay=False,
            help="Write each figure of the page as PDF into this folder, too.",
        ),
    ] = None,
    junit: Annotated[
        Path | None,
        typer.Option(
            "--junit", metavar="FILE", dir_okay=False, help="Write verdicts as JUnit XML."
        ),
    ] = None,
    csv: Annotated[
        Path | None,
        typer.Option("--csv", metavar="FILE", help="Write all measures and margins as CSV."),
    ] = None,
    parquet: Annotated[
        Path | None,
        typer.Option("--parquet", metavar="FILE", help="The same as Parquet."),
    ] = None,
    history: Annotated[
        bool,
        typer.Option(
            "--history", help="Write how the submissions of this name went, and what is new."
        ),
    ] = False,
    exit_status: Annotated[
        bool,
        typer.Option("--exit-status", help="Leave with the code of the verdicts, 1 for a failure."),
    ] = False,
    processes: Processes = None,
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Write a campaign or a search as one page with figures, a campaign as tables, too."""
    from daemon.analysis.report import (
        headline,
        read_report_data,
        write_csv,
        write_junit,
        write_page,
        write_parquet,
    )
    from scenario_tui.cli.target import DaemonTarget

    target = DaemonTarget(connect, state)
    if figures is not None and (lacking := why_no_folder(figures.absolute().parent)):
        why = f"{figures} cannot be written: {figures.absolute().parent} {lacking}"
        raise typer.BadParameter(why, param_hint="--figures")
    tables = {"junit": junit, "csv": csv, "parquet": parquet}
    for option, file in ({"output": output} | tables).items():
        if file is not None:
            check_writable(file, f"--{option}")
    options = tables | {"figures": figures}
    if history:
        if any(options.values()) or exit_status:
            raise typer.BadParameter("it is a page alone", param_hint="--history")
        _report_history(campaign, output or _DEFAULT_PAGE, target, as_json=as_json)
        return
    if _report_search(campaign, output, target, options, exit_status=exit_status, as_json=as_json):
        return
    # With table formats only, no page is written.
    page = output or (None if any(tables.values()) and not figures else _DEFAULT_PAGE)
    results = _choose_campaign(campaign, target)
    bar = partial(track_progress, description="reading traces")
    material = read_report_data(results, processes=processes, watched=bar)
    if page is not None:
        text = write_page(material, _run_commands(), processes=processes, figure_folder=figures)
        page.write_text(text, encoding="utf-8")
    if junit is not None:
        records = tuple(run.record for run in material.runs)
        write_junit(results.name, material.assessment, records, junit)
    for writer, path in ((write_csv, csv), (write_parquet, parquet)):
        if path is not None:
            writer(material, path)
    written = {"page": page, "figures": figures} | tables
    answer = headline(material.assessment, material.runs)
    summary = ReportOutput(
        results.name,
        len(material.runs),
        f"{answer.word}. {answer.sentence}",
        material.assessment.exit_code,
        {kind: str(path) for kind, path in written.items() if path},
        material.references,
    )
    # A folder may be called like a campaign: say which of them this is about.
    subject = f"{results.name} ({results.id or results.where})"
    _tell(summary, subject, results.unread, as_json=as_json)
    if exit_status:
        raise typer.Exit(ExitCode(material.assessment.exit_code))


def _report_history(campaign: str, page: Path, target: DaemonTarget, *, as_json: bool) -> None:
    """Write the page of a campaign's history and print what is new.

    Raises :class:`daemon.batch.errors.Refused` if there is no such campaign.
    """
    from daemon.analysis.history import read_history
    from daemon.analysis.history_page import history_page
    from daemon.batch.ledger import LedgerReader
    from scenario_tui.cli.target import find_campaign

    with target.open() if target.named else LedgerReader.open(target.paths) as source:
        history = read_history(source, find_campaign(source, campaign).name)
    page.write_text(history_page(history), encoding="utf-8")
    output = HistoryOutput(history.headline, history, {"page": str(page)})
    _tell(output, history.name, as_json=as_json)


def _report_search(
    named: str,
    output: Path | None,
    target: DaemonTarget,
    tables: Mapping[str, Path | None],
    *,
    exit_status: bool,
    as_json: bool,
) -> bool:
    """Write the page of a search; return False when a campaign is meant.

    Tables are left to campaigns: nothing is expected of what a search tries.
    """
    from daemon.search.answers.sentences import headline
    from scenario_tui.cli.search import search_code
    from scenario_tui.cli.search_report import choose_search, write_search_page

    material = choose_search(named, target)
    if material is None:
        return False
    row = material.row
    asked = [f"--{kind}" for kind, path in tables.items() if path is not None]
    if asked:
        hint = f"its runs are in `scenario search {row.campaign} --json`"
        message = f"tables are of campaigns, {row.campaign} is a search: {hint}"
        raise typer.BadParameter(message, param_hint=", ".join(asked))
    page = output or _DEFAULT_PAGE
    write_search_page(material, page)
    code = search_code(row)
    summary = ReportOutput(
        row.name, len(material.proposals), headline(row), int(code), {"page": str(page)}
    )
    _tell(summary, f"{row.task.name} ({row.campaign})", as_json=as_json)
    if exit_status:
        raise typer.Exit(code)
    return True


def _choose_campaign(campaign: str, target: DaemonTarget) -> Results:
    """Return what is meant: a folder of traces, otherwise a campaign with its traces brought here.

    A folder without traces is meant when no campaign has its name.
    """
    from daemon.analysis.results import folder_results
    from daemon.batch.errors import DaemonError
    from scenario_tui.cli.named_traces import names_traces

    folder = Path(campaign)
    is_folder = bool(campaign) and folder.is_dir()
    if is_folder and names_traces(campaign):
        return folder_results(folder)
    if folder.suffix == ".mcap":
        message = "a report is about a campaign or a folder of traces"
        hint = "for one run there is `scenario export RUN picture`"
        raise typer.BadParameter(f"{message}: {hint}", param_hint="CAMPAIGN")
    try:
        return _submitted_campaign(campaign, target)
    except DaemonError:
        if is_folder:
            return folder_results(folder)  # says that it holds none
        raise


def _submitted_campaign(campaign: str, target: DaemonTarget) -> Results:
    from daemon.analysis.results import bring_traces, campaign_results
    from daemon.batch.ledger import LedgerReader
    from scenario_tui.cli.named_traces import newest_results, transfer_progress
    from scenario_tui.cli.target import find_campaign

    if target.named:
        with target.open() as daemon:
            results = campaign_results(daemon, find_campaign(daemon, campaign), target.endpoint)
            size = sum(run.result.trace.size for run in results.records if run.result is not None)
            with transfer_progress(size) as advance:
                return bring_traces(results, daemon, progress=advance)
    if not campaign and not target.paths.ledger.is_file() and (newest := newest_results()):
        message = f"{target.paths.state} is no state directory: nothing was submitted here"
        command = f"scenario report {shlex.quote(str(newest))}"
        hint = f"name the folder of traces `scenario run` left: `{command}`"
        raise typer.BadParameter(f"{message}; {hint}", param_hint="CAMPAIGN")
    with LedgerReader.open(target.paths) as reader:
        row = find_campaign(reader, campaign)
        return bring_traces(campaign_results(reader, row, str(target.paths.state)))


def _run_commands() -> tuple[SuggestedCommand, ...]:
    """Return what can be typed about a run with this version."""
    from daemon.analysis.report import SuggestedCommand

    return (
        SuggestedCommand("scenario replay {run} --from {oracle}", "watch that moment"),
        SuggestedCommand("scenario replay {run}", "watch it again"),
        SuggestedCommand("scenario export {run} picture -o run.svg", "a picture of it"),
        SuggestedCommand("scenario judge {run}", "judge it again"),
        SuggestedCommand("scenario blame {run}", "find out what makes it fail", failing=True),
    )


def _tell(
    summary: ReportOutput | HistoryOutput,
    subject: str,
    unread: Iterable[tuple[str, str]] = (),
    *,
    as_json: bool,
) -> None:
    """Print the outcome and the files that were written."""
    from rich.filesize import decimal

    if as_json:
        summary.emit()
        return
    lines = [f"{subject}: {summary.answer}"]
    lines += [f"not read: {file}: {problem}" for file, problem in unread]
    for path in summary.written.values():
        is_file = Path(path).is_file()
        lines.append(f"{path} ({decimal(Path(path).stat().st_size)})" if is_file else path)
    for line in lines:
        stdout_console().print(line, markup=False, soft_wrap=True)
