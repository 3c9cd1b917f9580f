"""Commands that submit a campaign to a daemon and wait for it: submit, wait."""

from __future__ import annotations

import time
from functools import partial
from math import inf
from typing import TYPE_CHECKING, Annotated

import typer

from grammars.text.words import count_noun, duration_text
from scenario_tui.cli.answer import Answer, ExitCode
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
    watch: Annotated[bool, "-w", "Show progress until the campaign ends."] = False,
    fresh: Annotated[
        bool,
        "Run everything anew. Otherwise a run whose specification has a result keeps it, "
        "even if the code of the system under test has changed since.",
    ] = False,
    baseline: Baseline = "",
    worse_by: WorseBy = None,
    slots: Slots = None,
) -> Answer[HandedOver] | Answer[ComparedResults]:
    """Submit a campaign to the daemon, and watch it with --watch.

    Only runs without a result are executed. If no daemon answers, one is started on this machine.
    """
    from daemon.analysis.results import ComparedResults
    from scenario_tui.cli.compare import compare_with_baseline, refuse_unknown_baseline
    from scenario_tui.cli.run import load_announced
    from scenario_tui.library.submission import receipt_text

    if baseline and not watch:
        raise typer.BadParameter("is compared at the end: add --watch", param_hint="--baseline")
    loaded = load_announced(campaign)
    if watch:
        refuse_unknown_baseline(loaded, baseline, target)
    job = loaded.submit(connect=target.connect, state=target.state, fresh=fresh, workers=slots)
    say(receipt_text(job.receipt))
    if not watch:
        from daemon.model.status import HandedOver

        handed = HandedOver(job.receipt, target.endpoint)
        return Answer("submit", handed, partial(_print_next, job.id, target))
    try:
        results = job.wait().value
    except KeyboardInterrupt:
        say(f"\n{job.id} continues; see `{target.command('results', job.id)}`")
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
        (target.command("report", results.row.id), "one page with figures"),
    )


def wait(
    campaign: CampaignName,
    target: DaemonTarget,
    timeout: Annotated[
        float | None,
        typer.Option(
            metavar="TIME", parser=parse_duration, help="Longest time to wait: 30s, 10min, 2h."
        ),
    ] = None,
) -> Answer[ComparedResults] | Answer[SearchResult]:
    """Wait until a campaign ends, and exit with its code.

    Exits with 4 after --timeout. Waits for a daemon that does not answer, by default for two
    minutes. Ctrl-C ends the waiting only.
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
        match = ask_patiently(target, lambda daemon: find_campaign(daemon, campaign), patience)
        name, rest = match.id, max(0.0, deadline - time.monotonic())
        if match.search:
            return wait_for_search(target, name, patience=patience, limit=rest)
        results = wait_for(target, name, patience=patience, limit=rest).value
    except KeyboardInterrupt:
        say(f"\n{name} continues; wait again with `{target.command('wait', name)}`")
        raise
    row, code = results.row, results.assessment.exit_code
    words = conclude(results).glyph_text
    if not row.finished:
        # The conclusion so far is printed, but an unfinished campaign has no verdict yet.
        runs = count_noun(row.queued + row.running, "run")
        words = f"{runs} left after {duration_text(limit)}, {words}"
        code = ExitCode.INCONCLUSIVE
    text = partial(say, f"{row.id}: {words}")
    return Answer("results", ComparedResults.of(results), text, code)
