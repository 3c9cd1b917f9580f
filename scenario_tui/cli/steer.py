"""Commands that steer: cancel, retry, acknowledge, pause, priority, delete."""

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
    action: CampaignAction, name: str, target: DaemonTarget, **given: Any
) -> Answer[SteeredRuns]:
    """Ask the daemon for an action on a campaign."""
    with target.open() as daemon:
        row = find_campaign(daemon, name)
        value = SteeredRuns(row.id, action.request(daemon, row.id, **given))
    words = action.outcome_text(row.id, value.runs, target.command, **given)
    if action is CANCEL and row.search in ("running", "waiting"):
        # Between two of its runs there may be none to cancel.
        answer = target.command("search", row.id)
        words += f", which has ended; `{answer}` says what it found"
    schema = "resume" if action is RESUME else action.command
    return Answer(schema, value, partial(say, words))


def cancel(campaign: CampaignName, *, target: DaemonTarget) -> Answer[SteeredRuns]:
    """Cancel what is queued or running of a campaign.

    The results it has are kept.
    """
    return _steer(CANCEL, campaign, target)


def retry(
    campaign: CampaignName,
    only: Annotated[
        str,
        typer.Option(
            "--only",
            help="Which runs: lost, cancelled, an outcome, or all; separated by |.",
            autocompletion=completion.offers(completion.words(*_RETRYABLE)),
        ),
    ] = "lost|cancelled",
    *,
    target: DaemonTarget,
) -> Answer[SteeredRuns]:
    """Queue lost or cancelled runs of a campaign again."""
    for word in only.split("|"):
        if word.strip() not in _RETRYABLE:
            message = f'"{word}" is no kind of run: {did_you_mean(word, _RETRYABLE)}'
            raise typer.BadParameter(message, param_hint="--only")
    return _steer(RETRY, campaign, target, only=only)


def acknowledge(campaign: CampaignName, *, target: DaemonTarget) -> Answer[SteeredRuns]:
    """Note that you know what went wrong in a campaign; the dashboard tells what is new.

    What is new ends it: a run that settles badly, or is executed again.
    """
    return _steer(ACKNOWLEDGE, campaign, target)


def pause(
    campaign: CampaignName,
    off: Annotated[bool, typer.Option("--off", help="Go on with a paused campaign.")] = False,
    *,
    target: DaemonTarget,
) -> Answer[SteeredRuns]:
    """Start no more runs of a campaign, or go on with it.

    Runs that are running finish.
    """
    return _steer(RESUME if off else PAUSE, campaign, target)


def priority(
    campaign: CampaignName,
    number: Annotated[
        int,
        typer.Argument(
            metavar="N", min=-1000, max=1000, help="Usual is 0; write -- before a negative one."
        ),
    ],
    *,
    target: DaemonTarget,
) -> Answer[CampaignPriority]:
    """Let a campaign go before those of lower priority.

    Campaigns of the same priority take turns, run by run.
    """
    done = _steer(PRIORITY, campaign, target, priority=number)
    return Answer(done.schema, CampaignPriority(done.value.campaign, number), done.text)


def delete(
    campaigns: Annotated[
        list[str],
        typer.Argument(
            metavar="CAMPAIGN...",
            help="Ids or names of campaigns, or how they begin.",
            autocompletion=completion.offers(completion.campaigns),
        ),
    ],
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Do not ask.")] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", "-n", help="Say what would go; remove nothing.")
    ] = False,
    *,
    target: DaemonTarget,
) -> Answer[Deletion]:
    """Remove campaigns for good: runs, results, and traces that no other campaign uses.

    Not while runs of them wait or run: cancel them first.
    """
    with target.open() as daemon:
        found = tuple(dict.fromkeys(find_campaign(daemon, name).id for name in campaigns))
        gone = daemon.delete(found, dry=True)
        if not dry_run:
            if not yes:
                _ask_whether(deletion_text(gone, dry=True))
            gone = DELETE.request(daemon, *found)
    from daemon.model.status import Deletion

    return Answer("delete", Deletion(dry_run, gone), partial(say, deletion_text(gone, dry=dry_run)))


def _ask_whether(what: str) -> None:
    """Have it confirmed; wrong usage where there is nobody to ask."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise typer.BadParameter("there is no terminal to ask at: say --yes", param_hint="--yes")
    say(what)
    typer.confirm("Delete? Nothing brings it back.", abort=True, err=True)
