"""Commands that steer: cancel, retry, pause, priority, delete; what `daemon --stop` does."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from grammars.text.diagnostics import did_you_mean
from scenario_tui.cli import completion
from scenario_tui.cli.options import AsJson, CampaignName, Connect, State
from scenario_tui.cli.output import Output, say

if TYPE_CHECKING:
    from daemon.model.status import DeletedCampaign
    from daemon.model.verbs import DaemonClient


_RETRYABLE: Final = ("lost", "cancelled", "fail", "error", "inconclusive", "pass", "all")


class SteeringOutput(Output):
    """What became of so many ``runs`` of a campaign; the schema is named like the action."""

    campaign: str
    runs: int


class CancelOutput(SteeringOutput, schema="cancel"):
    """A campaign whose runs were cancelled."""


class RetryOutput(SteeringOutput, schema="retry"):
    """A campaign with runs that are tried again."""


class PauseOutput(SteeringOutput, schema="pause"):
    """A campaign that waits."""


class ResumeOutput(SteeringOutput, schema="resume"):
    """A campaign that goes on."""


def _steer(
    output: type[SteeringOutput],
    ask: Callable[[DaemonClient, str], int],
    campaign: str,
    connect: str,
    state: Path | None,
    as_json: bool,
) -> None:
    """Ask the daemon to do something with a campaign, and say what became of it."""
    from scenario_tui.campaign_actions import ACTIONS
    from scenario_tui.cli.target import DaemonTarget, find_campaign_or_search

    with DaemonTarget(connect, state).open() as daemon:
        row = find_campaign_or_search(daemon, campaign)
        found = row.id
        runs = ask(daemon, found)
    # The sentence is for people and on standard error, so it does no harm beside the JSON.
    if as_json:
        output(found, runs).emit()
    words = ACTIONS[output.schema].outcome_text(
        found, runs, until=f"`scenario pause {found} --off`"
    )
    if output is CancelOutput and row.search in ("running", "waiting"):
        # Between two of its runs there may be none to cancel.
        words += f", which has ended; `scenario search {found}` says what it found"
    say(words)


def cancel(
    campaign: CampaignName, connect: Connect = "", state: State = None, as_json: AsJson = False
) -> None:
    """Cancel what is queued or running of a campaign.

    The results it has are kept.
    """
    _steer(CancelOutput, lambda daemon, id_: daemon.cancel(id_), campaign, connect, state, as_json)


def retry(
    campaign: CampaignName,
    only: Annotated[
        str,
        typer.Option(
            "--only",
            help="Which runs: lost, cancelled, an outcome, or all; separated by |.",
            autocompletion=completion.one_of(*_RETRYABLE),
        ),
    ] = "lost|cancelled",
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Queue lost or cancelled runs of a campaign again."""
    for word in only.split("|"):
        if word.strip() not in _RETRYABLE:
            message = f'"{word}" is no kind of run: {did_you_mean(word, _RETRYABLE)}'
            raise typer.BadParameter(message, param_hint="--only")

    def ask(daemon: DaemonClient, id_: str) -> int:
        return daemon.retry(id_, only=only)

    _steer(RetryOutput, ask, campaign, connect, state, as_json)


def pause(
    campaign: CampaignName,
    off: Annotated[bool, typer.Option("--off", help="Go on with a paused campaign.")] = False,
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Start no more runs of a campaign, or go on with it.

    Runs that are running finish.
    """
    output = ResumeOutput if off else PauseOutput

    def ask(daemon: DaemonClient, id_: str) -> int:
        return daemon.steer(id_, paused=not off)

    _steer(output, ask, campaign, connect, state, as_json)


class PriorityOutput(Output, schema="priority"):
    """A campaign and its priority."""

    campaign: str
    priority: int


class DeleteOutput(Output, schema="delete"):
    """Campaigns that are gone, or would be."""

    dry_run: bool
    campaigns: tuple[DeletedCampaign, ...]


def priority(
    campaign: CampaignName,
    number: Annotated[
        int,
        typer.Argument(
            metavar="N", min=-1000, max=1000, help="Usual is 0; write -- before a negative one."
        ),
    ],
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Let a campaign go before those of lower priority.

    Campaigns of the same priority take turns, run by run.
    """
    from scenario_tui.campaign_actions import PRIORITY
    from scenario_tui.cli.target import DaemonTarget, find_campaign_or_search

    with DaemonTarget(connect, state).open() as daemon:
        row = find_campaign_or_search(daemon, campaign)
        daemon.steer(row.id, priority=number)
    if as_json:
        PriorityOutput(row.id, number).emit()
    say(PRIORITY.outcome_text(row.id, priority=number))


def delete(
    campaigns: Annotated[
        list[str],
        typer.Argument(
            metavar="CAMPAIGN...",
            help="Ids or names of campaigns, or how they begin.",
            autocompletion=completion.campaigns,
        ),
    ],
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Do not ask.")] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", "-n", help="Say what would go; remove nothing.")
    ] = False,
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Remove campaigns for good: runs, results, and traces that no other campaign uses.

    Not while runs of them wait or run: cancel them first.
    """
    from scenario_tui.campaign_actions import deletion_text
    from scenario_tui.cli.target import DaemonTarget, find_campaign_or_search

    with DaemonTarget(connect, state).open() as daemon:
        found = tuple(dict.fromkeys(find_campaign_or_search(daemon, name).id for name in campaigns))
        gone = daemon.delete(found, dry=True)
        if not dry_run:
            if not yes:
                _ask_whether(deletion_text(gone, dry=True))
            gone = daemon.delete(found)
    if as_json:
        DeleteOutput(dry_run, gone).emit()
    say(deletion_text(gone, dry=dry_run))


def _ask_whether(what: str) -> None:
    """Have it confirmed; wrong usage where there is nobody to ask."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise typer.BadParameter("there is no terminal to ask at: say --yes", param_hint="--yes")
    say(what)
    typer.confirm("Delete? Nothing brings it back.", abort=True, err=True)
