"""Commands that hand a campaign to a daemon and wait for it: submit, wait."""

from __future__ import annotations

import time
from functools import partial
from math import inf
from typing import TYPE_CHECKING, Annotated

import typer

from grammars.text.words import count_noun, duration_text
from scenario_tui.cli.answer import Answer
from scenario_tui.cli.exit_codes import ExitCode
from scenario_tui.cli.options import (
    Baseline,
    CampaignFile,
    CampaignName,
    Slots,
    WorseBy,
    parse_duration,
)
from scenario_tui.cli.output import print_commands, say
from scenario_tui.source import DaemonTarget, find_campaign

if TYPE_CHECKING:
    from daemon.analysis.results import CampaignResults, ComparedResults
    from daemon.judging.assessment import CampaignDifference
    from daemon.model.status import HandedOver
    from scenario_tui.cli.values import SearchResult


def submit(
    campaign: CampaignFile,
    target: DaemonTarget,
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
) -> Answer[HandedOver] | Answer[ComparedResults]:
    """Hand a campaign to the daemon, watch it if you like.

    Only runs that have no result yet are executed. A daemon is started on this machine if none
    answers.
    """
    from daemon.analysis.results import ComparedResults
    from scenario_tui.cli.compare import compare_with_baseline
    from scenario_tui.cli.run import load_announced
    from scenario_tui.library.submission import receipt_text

    if baseline and not watch:
        raise typer.BadParameter("is judged at the end: add --watch", param_hint="--baseline")
    job = load_announced(campaign).submit(
        connect=target.connect, state=target.state, fresh=fresh, workers=slots
    )
    say(receipt_text(job.receipt))
    if not watch:
        from daemon.model.status import HandedOver

        handed = HandedOver(job.receipt, target.endpoint)
        return Answer("submit", handed, partial(_print_next, job.id, target))
    try:
        results = job.wait().value
    except KeyboardInterrupt:
        say(f"\n{job.id} goes on; come back with `{target.command('results', job.id)}`")
        raise
    between = compare_with_baseline(results, baseline, worse_by, target)
    value = ComparedResults.of(results, between)
    text = partial(_print_end, results, between, target)
    return Answer("results", value, text, value.exit_code)


def _print_next(campaign: str, target: DaemonTarget) -> None:
    print_commands(
        (target.command("tui"), "watch it in the dashboard"),
        (target.command("results", campaign), "verdicts so far"),
        (target.command("cancel", campaign), "stop it"),
    )


def _print_end(
    results: CampaignResults, between: CampaignDifference | None, target: DaemonTarget
) -> None:
    from scenario_tui.cli.results import print_summary

    print_summary(results, between)
    print_commands(
        (target.command("tui"), "look at it in the dashboard"),
        (target.command("results", results.row.id, "--runs"), "every run and its trace"),
    )


def wait(
    campaign: CampaignName,
    target: DaemonTarget,
    timeout: Annotated[
        float | None,
        typer.Option(
            "--timeout",
            metavar="TIME",
            parser=parse_duration,
            help="At most so long: 30s, 10min, 2h.",
        ),
    ] = None,
) -> Answer[ComparedResults] | Answer[SearchResult]:
    """Wait until a campaign is over, and leave with its exit code.

    Leaves with 4 when the time is up before. A daemon that is away is waited for, two minutes
    unless --timeout says otherwise. Ctrl-C ends the waiting only.
    """
    from daemon.analysis.results import ComparedResults
    from scenario_tui.cli.search import wait_for_search
    from scenario_tui.library.job import wait_for
    from scenario_tui.library.watching import PATIENCE, ask_patiently
    from scenario_tui.text.results import conclude

    limit = inf if timeout is None else timeout
    deadline = time.monotonic() + limit
    patience = PATIENCE if timeout is None else timeout
    name = campaign
    try:
        meant = ask_patiently(target, lambda daemon: find_campaign(daemon, campaign), patience)
        name, rest = meant.id, max(0.0, deadline - time.monotonic())
        if meant.search:
            return wait_for_search(target, name, patience=patience, limit=rest)
        results = wait_for(target, name, patience=patience, limit=rest).value
    except KeyboardInterrupt:
        say(f"\n{name} goes on; come back with `{target.command('wait', name)}`")
        raise
    row, code = results.row, results.assessment.exit_code
    words = conclude(results).glyph_text
    if not row.finished:
        # The conclusion so far is printed, but a campaign that goes on has no verdict yet.
        runs = count_noun(row.queued + row.running, "run")
        words = f"{runs} left after {duration_text(limit)}, {words}"
        code = ExitCode.INCONCLUSIVE
    text = partial(say, f"{row.id}: {words}")
    return Answer("results", ComparedResults.of(results), text, code)
