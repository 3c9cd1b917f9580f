"""Commands that start something: demo, check, run, submit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scenario_tui.cli import _completion
from scenario_tui.cli._exits import ExitCode
from scenario_tui.cli._files import layer_files
from scenario_tui.cli._gate import Baseline, WorseBy
from scenario_tui.cli._options import AsJson, CampaignFile, Connect, Slots, State

if TYPE_CHECKING:
    from daemon.protocol import Submission
    from grammars.diagnostics import Diagnostic

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

    from scenario_tui.cli._embedded import run_here
    from scenario_tui.cli._output import out as console
    from scenario_tui.cli._summary import print_commands
    from scenario_tui.cli._told import emit_results

    with as_file(files("campaigns")) as folder:
        found = run_here(_prepared(folder / "demo" / "campaign.yaml"), out, slots, as_json)
    if as_json:
        emit_results(found)
    else:
        console().print("This is what testing with scenarios looks like. Make it yours:")
        print_commands(
            ("scenario check CAMPAIGN.yaml", "find every problem before anything runs"),
            ("scenario submit CAMPAIGN.yaml", "hand a campaign to the daemon and go on"),
            ("scenario tui", "watch it in the dashboard"),
        )
    # A demo may well show a failing robot: it succeeds when every run was judged.
    judged = set(found.words) <= {"pass", "fail", "inconclusive"}
    raise typer.Exit(ExitCode.EXPECTED if judged else ExitCode.INFRASTRUCTURE)


def run(
    campaign: CampaignFile,
    baseline: Baseline = "",
    worse_by: WorseBy = None,
    out: Out = None,
    slots: Slots = None,
    as_json: AsJson = False,
) -> None:
    """Run a campaign here and now, without a daemon.

    Nothing is left behind but the traces and what they are about, in scenario-results/ unless
    told otherwise.
    """
    from scenario_tui.cli._compare import print_between
    from scenario_tui.cli._embedded import run_here, shown
    from scenario_tui.cli._gate import final_code, hold
    from scenario_tui.cli._summary import print_commands
    from scenario_tui.cli._told import emit_results

    found = run_here(_prepared(campaign), out, slots, as_json)
    between = hold(found, baseline, worse_by, None)
    if as_json:
        emit_results(found, comparison=between)
    else:
        if between is not None:
            print_between(between)
        kept = {Path(row.trace).parent for row in found.rows if row.trace}
        print_commands(
            *((f"scenario report {shown(folder)}", "one page with figures") for folder in kept),
            (f"scenario submit {campaign}", "run it with the daemon, results are kept"),
            ("scenario tui", "the dashboard of the daemon"),
        )
    raise typer.Exit(final_code(found, between))


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
    from scenario_tui.cli._output import emit, say
    from scenario_tui.cli._session import Target
    from scenario_tui.cli._submit import start_daemon_if_needed, watch_to_the_end
    from scenario_tui.preparing import tell_receipt

    if baseline and not watch:
        raise typer.BadParameter("is judged at the end: add --watch", param_hint="--baseline")
    submission = _prepared(campaign, fresh=fresh)
    target = Target(connect, state)
    start_daemon_if_needed(target, slots)
    endpoint = target.endpoint
    with target.open() as daemon:
        receipt = daemon.submit(submission)
    say(tell_receipt(receipt))
    if watch:
        code = watch_to_the_end(target, submission.campaign, as_json, baseline, worse_by)
        raise typer.Exit(code)
    if as_json:
        emit("submit", receipt=receipt, endpoint=endpoint)
        return
    from scenario_tui.cli._summary import print_commands

    print_commands(
        ("scenario tui", "watch it in the dashboard"),
        (f"scenario results {submission.campaign}", "verdicts so far"),
        (f"scenario cancel {submission.campaign}", "stop it"),
    )


def check(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE",
            help="Campaigns, floor plans, scenery or other layers.",
            autocompletion=_completion.files(layer_files),
        ),
    ],
    as_json: AsJson = False,
) -> None:
    """Find every problem of campaigns and layers.

    Nothing is run; the geometry of what would run is examined.
    """
    from grammars.diagnostics import Severity
    from scenario_tui.cli._check import checked
    from scenario_tui.cli._diagnostics import counts, report
    from scenario_tui.cli._output import emit, say

    findings: dict[str, tuple[Diagnostic, ...]] = {}
    for file in files:
        about, found = checked(file)
        findings[str(file)] = found
        if not as_json:
            report(found)
            say(f"{file}: {about + ', ' if about else ''}{counts(found)}")
    if as_json:
        emit("check", files=findings)
    everything = [d for found in findings.values() for d in found]
    if any(d.severity is Severity.ERROR for d in everything):
        raise typer.Exit(ExitCode.BAD_INPUT)


def _prepared(path: Path, *, fresh: bool = False) -> Submission:
    """Load, check and expand a campaign; warnings are printed, errors raise ``InputError``."""
    from scenario_tui.cli._diagnostics import report
    from scenario_tui.preparing import prepare

    submission, warnings = prepare(path, fresh=fresh)
    report(warnings)
    return submission
