"""Commands that steer campaigns: cancel, retry, acknowledge, pause, priority, delete."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from grammars.text.diagnostics import did_you_mean
from scenario_tui.campaign_actions import (
    ACKNOWLEDGE,
    CANCEL,
    DELETE,
    PAUSE,
    PRIORITY,
    RESUME,
    RETRY,
    CampaignAction,
    deletion_text,
)
from scenario_tui.cli import completion
from scenario_tui.cli.answer import Answer
from scenario_tui.cli.options import CampaignName
from scenario_tui.cli.output import say
from scenario_tui.source import DaemonTarget, find_campaign

if TYPE_CHECKING:
    from daemon.model.status import Deletion

_RETRYABLE: Final = ("lost", "cancelled", "fail", "error", "inconclusive", "pass", "all")


@dataclass(frozen=True, slots=True)
class SteeredRuns:
    """The number of ``runs`` of a campaign that an action concerned."""

    campaign: str
    runs: int


@dataclass(frozen=True, slots=True)
class CampaignPriority:
    """A campaign and its priority."""

    campaign: str
    priority: int


def _steer(
    action: CampaignAction, name: str, target: DaemonTarget, **arguments: Any
) -> Answer[SteeredRuns]:
    """Ask the daemon for an action on a campaign."""
    with target.open() as daemon:
        row = find_campaign(daemon, name)
        value = SteeredRuns(row.id, action.request(daemon, row.id, **arguments))
    words = action.outcome_text(row.id, value.runs, target.command, **arguments)
    if action is CANCEL and row.search in ("running", "waiting"):
        # A search may have no run to cancel, between two of them.
        answer = target.command("search", row.id)
        words += f", which has ended; `{answer}` shows its answer"
    schema = "resume" if action is RESUME else action.command
    return Answer(schema, value, partial(say, words))


def cancel(campaign: CampaignName, *, target: DaemonTarget) -> Answer[SteeredRuns]:
    """Cancel the queued and running runs of a campaign.

    Its results are kept.
    """
    return _steer(CANCEL, campaign, target)


def retry(
    campaign: CampaignName,
    only: Annotated[
        str,
        typer.Option(
            help="Runs to retry: lost, cancelled, an outcome, or all; separated by |.",
            autocompletion=completion.offers(completion.words(*_RETRYABLE)),
        ),
    ] = "lost|cancelled",
    *,
    target: DaemonTarget,
) -> Answer[SteeredRuns]:
    """Queue lost or cancelled runs of a campaign again."""
    for word in only.split("|"):
        if word.strip() not in _RETRYABLE:
            message = f'"{word}" is not a kind of run: {did_you_mean(word, _RETRYABLE)}'
            raise typer.BadParameter(message, param_hint="--only")
    return _steer(RETRY, campaign, target, only=only)


def acknowledge(campaign: CampaignName, *, target: DaemonTarget) -> Answer[SteeredRuns]:
    """Mark the failures of a campaign as seen; the dashboard then shows new ones only.

    The mark ends when another run goes wrong, or one is executed again.
    """
    return _steer(ACKNOWLEDGE, campaign, target)


def pause(
    campaign: CampaignName,
    off: Annotated[bool, "Continue a paused campaign."] = False,
    *,
    target: DaemonTarget,
) -> Answer[SteeredRuns]:
    """Start no more runs of a campaign, or continue it with --off.

    Running runs finish.
    """
    return _steer(RESUME if off else PAUSE, campaign, target)


def priority(
    campaign: CampaignName,
    number: Annotated[
        int,
        typer.Argument(
            metavar="N", min=-1000, max=1000, help="Default is 0; write -- before a negative one."
        ),
    ],
    *,
    target: DaemonTarget,
) -> Answer[CampaignPriority]:
    """Set the priority of a campaign; a higher one runs first.

    Campaigns of the same priority take turns, run by run.
    """
    answer = _steer(PRIORITY, campaign, target, priority=number)
    return Answer(answer.schema, CampaignPriority(answer.value.campaign, number), answer.text)


def delete(
    campaigns: Annotated[
        list[str],
        typer.Argument(
            metavar="CAMPAIGN...",
            help="Ids or names of campaigns, or their beginnings.",
            autocompletion=completion.offers(completion.campaigns),
        ),
    ],
    yes: Annotated[bool, "-y", "Do not ask."] = False,
    dry_run: Annotated[bool, "-n", "List what would go; remove nothing."] = False,
    *,
    target: DaemonTarget,
) -> Answer[Deletion]:
    """Delete campaigns: runs, results, and traces that no other campaign uses.

    A campaign with queued or running runs is refused: cancel them first.
    """
    with target.open() as daemon:
        ids = tuple(dict.fromkeys(find_campaign(daemon, name).id for name in campaigns))
        deleted = daemon.delete(ids, dry=True)
        if not dry_run:
            if not yes:
                _confirm(deletion_text(deleted, dry=True))
            deleted = DELETE.request(daemon, *ids)
    from daemon.model.status import Deletion

    text = partial(say, deletion_text(deleted, dry=dry_run))
    return Answer("delete", Deletion(dry_run, deleted), text)


def _confirm(deletion: str) -> None:
    """Ask a person to confirm a deletion; wrong usage without a terminal."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        message = "no terminal to ask for confirmation: use --yes"
        raise typer.BadParameter(message, param_hint="--yes")
    say(deletion)
    typer.confirm("Delete? This cannot be undone.", abort=True, err=True)
