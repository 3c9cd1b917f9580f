"""Words about runs without a result: their state, its reason, the command that helps."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from daemon.model.verdicts import UNFINISHED_STATES, RunState
from grammars.text.words import count_noun, duration_text

if TYPE_CHECKING:
    from daemon.model.status import CampaignRow, RunRow


def unfinished_text(row: CampaignRow) -> str:
    """Return the rest of a campaign: ``1 run is running, 12 queued, paused, 3 min 20 s left``.

    Empty for one that is finished.
    """
    counts = {"running": row.running, "queued": row.queued}
    parts = [f"{counts[word]:,} {word}" for word in UNFINISHED_STATES if counts[word]]
    if not parts and not row.finished:
        parts = ["the search waits" if row.search == "waiting" else "the search continues"]
    if parts and row.paused:
        parts.append("paused")
    if row.seconds_left is not None:
        parts.append(f"{duration_text(row.seconds_left)} left")
    return ", ".join(parts)


def progress_text(row: CampaignRow) -> str:
    """Return the number of runs of a campaign, and of finished ones unless all have finished."""
    runs = count_noun(row.total, "run")
    if row.ended == row.total:
        return runs
    return f"{row.ended:,} of {runs} finished"


def without_trace_text(
    run: RunRow,
    campaign: CampaignRow | None,
    before: int | None,
    command: Callable[..., str],
) -> str:
    """Return why a run has no trace, and the command that helps, if any.

    ``campaign`` is its own, if known; ``before`` counts its runs that are queued before it.
    ``command`` quotes a command about its daemon.
    """
    again = f"`{command('retry', run.campaign)}` queues it again"
    if run.state is RunState.RUNNING:
        live = f"`{command('tui')}` shows it live"
        return f"{run.id} is running: its trace exists when it ends, {live}"
    if run.state is RunState.QUEUED:
        return f"{run.id} is queued: {_waiting_text(run, campaign, before, command)}"
    if run.state is RunState.CANCELLED:
        return f"{run.id} was cancelled before it ended; {again}"
    if run.state is RunState.LOST:
        why = run.reason.strip().splitlines()[-1:]
        state = f"{run.id} is lost, {count_noun(run.attempt, 'attempt')} left no result"
        return ": ".join((state, *why)) + f"; {again}"
    return f"{run.id} has no trace: {run.reason or 'it does not exist any more'}"


def _waiting_text(
    run: RunRow, campaign: CampaignRow | None, before: int | None, command: Callable[..., str]
) -> str:
    """Return the reason why a queued run waits."""
    if run.reason:
        return f"once more, {run.reason}"
    if campaign is not None and campaign.paused:
        resume = command("pause", campaign.id, "--off")
        return f"its campaign is paused, `{resume}` continues it"
    parts = []
    if before is not None:
        first = f"{count_noun(before, 'run')} of its campaign queued before it"
        parts.append(first if before else "the next of its campaign")
    if campaign is not None and campaign.seconds_left is not None:
        parts.append(f"{duration_text(campaign.seconds_left)} left for all of {campaign.id}")
    return ", ".join(parts) or "it has not started yet"


def without_traces_text(campaign: CampaignRow, command: Callable[..., str]) -> str:
    """Return why a campaign has no traces; ``command`` quotes a command about its daemon."""
    if rest := unfinished_text(campaign):
        return f"no run of {campaign.id} has a trace yet: {rest}"
    words = {"cancelled": campaign.cancelled, "lost": campaign.lost}
    lacking = ", ".join(f"{count:,} {word}" for word, count in words.items() if count)
    if not lacking:
        return f"the traces of {campaign.id} do not exist any more"
    again = f"`{command('retry', campaign.id)}` queues them again"
    return f"no run of {campaign.id} has a trace: {lacking}; {again}"
