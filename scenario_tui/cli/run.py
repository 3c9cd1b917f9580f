"""Commands that run a campaign here and now: demo, run."""

from __future__ import annotations

import signal
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from grammars.text.diagnostics import Severity
from grammars.text.words import command_line, count_noun
from scenario_tui.cli.answer import Answer, ExitCode
from scenario_tui.cli.options import (
    Baseline,
    CampaignFile,
    Slots,
    Wall,
    WorseBy,
    check_writable,
    out_folder,
)
from scenario_tui.cli.output import print_commands, print_line, report_findings, say, show_progress
from scenario_tui.library.campaign import Campaign, load
from scenario_tui.source import DaemonTarget
from scenario_tui.text.formatting import run_word

if TYPE_CHECKING:
    from daemon.analysis.results import CampaignResults, ComparedResults
    from daemon.judging.assessment import CampaignDifference

Out = Annotated[Path | None, out_folder("Folder of traces. Default: scenario-results/<campaign>/.")]


def demo(out: Out = None, slots: Slots = None) -> Answer[ComparedResults]:
    """Show everything once: a robot, moving doors, verdicts.

    Takes seconds and needs only this installation.
    """
    from importlib.resources import as_file, files

    from daemon.analysis.results import ComparedResults

    # The package may be an archive.
    with as_file(files("campaigns")) as folder:
        results = _run(load(folder / "demo" / "campaign.yaml"), out, slots)
    # The demonstration may show a failing robot: it succeeds if every run was judged.
    judged = {run_word(row) for row in results.rows} <= {"pass", "fail", "inconclusive"}
    code = ExitCode.EXPECTED if judged else ExitCode.INFRASTRUCTURE
    return Answer("results", ComparedResults.of(results), partial(_print_demo, results), code)


def run(
    campaign: CampaignFile,
    baseline: Baseline = "",
    worse_by: WorseBy = None,
    out: Out = None,
    junit: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", dir_okay=False, help="Write verdicts as JUnit XML, for build servers."
        ),
    ] = None,
    slots: Slots = None,
    wall: Wall = None,
    attempts: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=100,
            help="Attempts for a run whose process dies without a result. Default: 3.",
        ),
    ] = None,
) -> Answer[ComparedResults]:
    """Run a campaign here and now, without a daemon.

    The traces and a note about their campaign stay, by default in scenario-results/; everything
    else is temporary.
    """
    from daemon.analysis.results import ComparedResults
    from scenario_tui.cli.compare import compare_with_baseline, refuse_unknown_baseline

    # Before the runs, not after them; the new folder of the traces may hold the file as well.
    if junit is not None and (out is None or out not in junit.parents):
        check_writable(junit, "--junit")
    target = DaemonTarget(say=say, progress=show_progress)
    loaded = load_announced(campaign)
    refuse_unknown_baseline(loaded, baseline, target)
    results = _run(loaded, out, slots, wall, attempts)
    if junit is not None:
        from daemon.analysis.report import write_junit

        write_junit(results.row.name, results.assessment, results.rows, junit)
    between = compare_with_baseline(results, baseline, worse_by, target)
    value = ComparedResults.of(results, between)
    return Answer(
        "results", value, partial(_print_run, results, between, campaign), value.exit_code
    )


def load_announced(path: Path) -> Campaign:
    """Load a campaign; print its warnings and its searches, unless it has errors."""
    from scenario_tui.library.submission import searches_text

    campaign = load(path)
    # The run of a campaign with errors raises all of its findings.
    if not any(one.severity is Severity.ERROR for one in campaign.findings):
        report_findings(campaign.findings)
        if words := searches_text(path, campaign.searches):
            say(words)
    return campaign


def _run(
    campaign: Campaign,
    out: Path | None,
    slots: int | None,
    wall: float | None = None,
    attempts: int | None = None,
) -> CampaignResults:
    # SIGTERM interrupts as Ctrl-C does: finished traces are kept, and nothing else is left.
    previous = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        return campaign.run(workers=slots, out=out, wall=wall, attempts=attempts).value
    except KeyboardInterrupt:
        from scenario_tui.library.execution import traces_folder

        folder = traces_folder(campaign.submission(), out)
        if folder.is_dir():
            traces = count_noun(len(tuple(folder.glob("*.mcap"))), "finished trace")
            say(f"\ninterrupted; {traces} in {folder}/")
        raise
    finally:
        signal.signal(signal.SIGTERM, previous)


def _print_demo(results: CampaignResults) -> None:
    _print_results(results)
    print_line("This is what testing with scenarios looks like. Make it yours:")
    print_commands(
        ("scenario new my-tests", "write a small campaign, every line explained"),
        ("scenario check my-tests/campaign.yaml", "find every problem before anything runs"),
        ("scenario submit my-tests/campaign.yaml", "submit it to the daemon"),
        ("scenario tui", "watch it in the dashboard"),
    )


def _print_run(
    results: CampaignResults, between: CampaignDifference | None, campaign: Path
) -> None:
    _print_results(results, between)
    report = command_line("report", results.where)
    print_commands(
        *([(report, "one page with figures")] if any(row.trace for row in results.rows) else []),
        (command_line("submit", campaign), "run it with the daemon, which keeps the results"),
        ("scenario tui", "the dashboard of the daemon"),
    )


def _print_results(results: CampaignResults, between: CampaignDifference | None = None) -> None:
    from scenario_tui.cli.results import print_summary

    print_summary(results, between)
    traces = count_noun(sum(1 for row in results.rows if row.trace), "trace")
    print_line(f"{traces} in {results.where}/\n")
