"""Commands that run campaigns: demo, check, run, submit, wait."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scenario_tui.cli import completion
from scenario_tui.cli.exit_codes import ExitCode
from scenario_tui.cli.options import (
    AsJson,
    Attempts,
    Base,
    Baseline,
    CampaignFile,
    CampaignName,
    Connect,
    Slots,
    State,
    Wall,
    WorseBy,
    check_writable,
    parse_duration,
)
from scenario_tui.cli.output import Output, report_findings, say, show_progress, stdout_console
from scenario_tui.interrupts import stop_if_interrupted

if TYPE_CHECKING:
    from daemon.model.status import SubmissionReceipt
    from daemon.model.submission import Submission
    from grammars.text.diagnostics import Finding


Out = Annotated[
    Path | None,
    typer.Option(
        "--out", "-o", metavar="DIR", help="Where traces go. Default: scenario-results/<campaign>/."
    ),
]


def demo(out: Out = None, slots: Slots = None, as_json: AsJson = False) -> None:
    """Show everything once: a robot, moving doors, verdicts.

    Takes seconds and needs nothing but this installation.
    """
    from importlib.resources import as_file, files

    from scenario_tui.cli.execute import run_here
    from scenario_tui.cli.output import print_commands
    from scenario_tui.cli.results import emit_results
    from scenario_tui.text.formatting import run_word

    # The campaigns are part of the package, which may lie in an archive.
    with as_file(files("campaigns")) as folder:
        found = run_here(
            _prepare_submission(folder / "demo" / "campaign.yaml", hint=False),
            out,
            slots,
            as_json,
        )
    if as_json:
        emit_results(found)
    else:
        stdout_console().print("This is what testing with scenarios looks like. Make it yours:")
        print_commands(
            ("scenario new my-tests", "write a small campaign, every line explained"),
            ("scenario check my-tests/campaign.yaml", "find every problem before anything runs"),
            ("scenario submit my-tests/campaign.yaml", "hand it to the daemon and go on"),
            ("scenario tui", "watch it in the dashboard"),
        )
    # A demo may well show a failing robot: it succeeds when every run was judged.
    judged = {run_word(row) for row in found.rows} <= {"pass", "fail", "inconclusive"}
    raise typer.Exit(ExitCode.EXPECTED if judged else ExitCode.INFRASTRUCTURE)


def run(
    campaign: CampaignFile,
    baseline: Baseline = "",
    worse_by: WorseBy = None,
    out: Out = None,
    junit: Annotated[
        Path | None,
        typer.Option(
            "--junit",
            metavar="FILE",
            dir_okay=False,
            help="Write verdicts as JUnit XML, for build servers.",
        ),
    ] = None,
    slots: Slots = None,
    wall: Wall = None,
    attempts: Attempts = None,
    as_json: AsJson = False,
) -> None:
    """Run a campaign here and now, without a daemon.

    Nothing is left behind but the traces and what they are about, in scenario-results/ unless
    told otherwise.
    """
    from scenario_tui.cli.compare import compare_with_baseline, final_code, print_comparison
    from scenario_tui.cli.execute import run_here, typed_path
    from scenario_tui.cli.output import print_commands
    from scenario_tui.cli.results import emit_results
    from scenario_tui.source import DaemonTarget

    limit = wall or 0.0
    # Before the runs, not after them; a folder that is made for the traces may hold it as well.
    if junit is not None and (out is None or out not in junit.parents):
        check_writable(junit, "--junit")
    submission = _prepare_submission(campaign)
    found = run_here(submission, out, slots, as_json, wall=limit, attempts=attempts)
    if junit is not None:
        from daemon.analysis.report import write_junit

        write_junit(found.row.name, found.assessment, found.rows, junit)
    between = compare_with_baseline(
        found, baseline, worse_by, DaemonTarget(say=say, progress=show_progress)
    )
    if as_json:
        emit_results(found, comparison=between)
    else:
        if between is not None:
            print_comparison(between)
        kept = {Path(row.trace).parent for row in found.rows if row.trace}
        submission_command = f"scenario submit {shlex.quote(str(campaign))}"
        print_commands(
            *(
                (f"scenario report {shlex.quote(typed_path(folder))}", "one page with figures")
                for folder in kept
            ),
            (submission_command, "run it with the daemon, results are kept"),
            ("scenario tui", "the dashboard of the daemon"),
        )
    raise typer.Exit(final_code(found, between))


class SubmitOutput(Output, schema="submit"):
    """What the daemon says to a campaign."""

    receipt: SubmissionReceipt
    endpoint: str

    def print(self) -> None:
        """Print what to type next."""
        from scenario_tui.cli.output import print_commands

        print_commands(
            ("scenario tui", "watch it in the dashboard"),
            (f"scenario results {self.receipt.campaign}", "verdicts so far"),
            (f"scenario cancel {self.receipt.campaign}", "stop it"),
        )


def submit(
    campaign: CampaignFile,
    watch: Annotated[
        bool, typer.Option("--watch", "-w", help="Stay until it is finished, show progress.")
    ] = False,
    fresh: Annotated[
        bool,
        typer.Option(
            "--fresh",
            help="Run everything anew. Otherwise runs whose specification has a result keep it, "
            "also when the code of a system under test has changed since.",
        ),
    ] = False,
    baseline: Baseline = "",
    worse_by: WorseBy = None,
    slots: Slots = None,
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Hand a campaign to the daemon, watch it if you like.

    Only runs that have no result yet are executed. A daemon is started on this machine if none
    answers.
    """
    from scenario_tui.cli.execute import start_daemon_if_needed, watch_to_end
    from scenario_tui.library.submission import receipt_text
    from scenario_tui.library.watching import SUBMIT_PATIENCE, ask_patiently
    from scenario_tui.source import DaemonTarget

    if baseline and not watch:
        raise typer.BadParameter("is judged at the end: add --watch", param_hint="--baseline")
    submission = _prepare_submission(campaign, fresh=fresh)
    target = DaemonTarget(connect, state, say, show_progress)
    start_daemon_if_needed(target, slots)
    # After starting one: before, there may be no endpoint.
    endpoint = target.endpoint
    # Again, it is the same campaign: the daemon knows it by its id.
    receipt = ask_patiently(target, lambda daemon: daemon.submit(submission), SUBMIT_PATIENCE)
    say(receipt_text(receipt))
    if watch:
        code = watch_to_end(target, submission.campaign, as_json, baseline, worse_by)
        raise typer.Exit(code)
    SubmitOutput(receipt, endpoint).show(as_json)


class CheckOutput(Output, schema="check"):
    """What was found in each file."""

    files: dict[str, tuple[Finding, ...]]


def check(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE",
            help="Campaigns, floor plans, scenery or other layers.",
            autocompletion=completion.offers(
                completion.files(
                    ".yaml", ".yml", ".fpm", ".scenery", ".variation", ".jsonld", ".json"
                )
            ),
        ),
    ],
    base: Base = "",
    as_json: AsJson = False,
) -> None:
    """Find every problem of campaigns and layers.

    Nothing is run; the geometry of what would run is examined.
    """
    from grammars.text.diagnostics import Severity
    from scenario_tui.text.diagnostics import diagnostic_counts

    findings: dict[str, tuple[Finding, ...]] = {}
    for file in files:
        about, found = _check(file, base)
        findings[str(file)] = found
        if not as_json:
            report_findings(found)
            say(f"{file}: {about + ', ' if about else ''}{diagnostic_counts(found)}")
    if as_json:
        CheckOutput(findings).emit()
    everything = [d for found in findings.values() for d in found]
    if any(d.severity is Severity.ERROR for d in everything):
        raise typer.Exit(ExitCode.BAD_INPUT)


def _check(file: Path, base: str) -> tuple[str, tuple[Finding, ...]]:
    """Return what a file is and what is wrong with it; of one that is not there, what is meant."""
    from grammars.text.diagnostics import InputError
    from scenario_tui.cli.options import refuse_missing_file
    from scenario_tui.library.checking import check_file

    try:
        refuse_missing_file(str(file))
    except InputError as error:
        return "", error.findings
    return check_file(file, base=base)


def _prepare_submission(path: Path, *, fresh: bool = False, hint: bool = True) -> Submission:
    """Load, check and expand a campaign; warnings are printed, errors raise ``InputError``.

    With ``hint`` it is said which searches it has.
    """
    from scenario_tui.library.campaign import load
    from scenario_tui.library.submission import searches_text

    campaign = load(path)
    submission = campaign.submission(fresh=fresh)
    stop_if_interrupted()
    report_findings(campaign.findings)
    if hint and (words := searches_text(path, campaign.searches)):
        say(words)
    return submission


def wait(
    campaign: CampaignName,
    timeout: Annotated[
        float | None,
        typer.Option(
            "--timeout",
            metavar="TIME",
            parser=parse_duration,
            help="At most so long: 30s, 10min, 2h.",
        ),
    ] = None,
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Wait until a campaign is over, and leave with its exit code.

    Leaves with 4 when the time is up before. A daemon that is away is waited for, two minutes
    unless --timeout says otherwise. Ctrl-C ends the waiting only.
    """
    import time
    from math import inf

    from daemon.analysis.results import read_results
    from grammars.text.words import count_noun, duration_text
    from scenario_tui.cli.answer import write_json
    from scenario_tui.cli.results import emit_results
    from scenario_tui.cli.search import wait_for_search
    from scenario_tui.library.watching import PATIENCE, ask_patiently, watch
    from scenario_tui.source import DaemonTarget, find_campaign
    from scenario_tui.text.results import conclude

    limit = inf if timeout is None else timeout
    deadline = time.monotonic() + limit
    patience = PATIENCE if timeout is None else timeout
    target = DaemonTarget(connect, state, say, show_progress)
    name = campaign
    try:
        meant = ask_patiently(target, lambda daemon: find_campaign(daemon, campaign), patience)
        name, left = meant.id, max(0.0, deadline - time.monotonic())
        if meant.search:
            answer = wait_for_search(target, name, patience=patience, limit=left)
            if as_json:
                write_json(answer.schema, answer.value)
            answer.text()
            raise typer.Exit(answer.code)
        row = watch(target.open, name, patience=patience, limit=left)
        results = ask_patiently(target, lambda daemon: read_results(daemon, row), PATIENCE)
    except KeyboardInterrupt:
        say(f"\n{name} goes on; come back with `scenario wait {name}`")
        raise typer.Exit(ExitCode.INTERRUPTED) from None
    if as_json:
        emit_results(results)
    said = conclude(results.assessment, finished=row.finished).glyph_text
    if not row.finished:
        runs = count_noun(row.queued + row.running, "run")
        # What is said so far is said, but a campaign that goes on has no verdict yet.
        say(f"{row.id}: {runs} left after {duration_text(limit)}, {said}")
        raise typer.Exit(ExitCode.INCONCLUSIVE)
    say(f"{row.id}: {said}")
    raise typer.Exit(results.assessment.exit_code)
