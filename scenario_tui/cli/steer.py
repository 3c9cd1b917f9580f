"""Commands that steer: cancel, retry, pause, resume, priority, stop."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from scenario_tui.cli import completion
from scenario_tui.cli.options import AsJson, CampaignName, Connect, State

if TYPE_CHECKING:
    from scenario_tui.client import DaemonClient


_RETRYABLE: Final = ("lost", "cancelled", "fail", "error", "inconclusive", "pass", "all")


def _steer(
    word: str,
    ask: Callable[[DaemonClient, str], int],
    campaign: str,
    connect: str,
    state: Path | None,
    as_json: bool,
) -> tuple[str, str]:
    """Ask the daemon about a campaign; return its id and how many runs it concerned, in words."""
    from scenario_tui.cli.output import emit
    from scenario_tui.cli.target import DaemonTarget, find_campaign
    from scenario_tui.text.formatting import pluralise

    with DaemonTarget(connect, state).open() as daemon:
        found = find_campaign(daemon, campaign).id
        runs = ask(daemon, found)
    if as_json:
        emit(word, campaign=found, runs=runs)
    return found, pluralise(runs, "run")


def cancel(
    campaign: CampaignName, connect: Connect = "", state: State = None, as_json: AsJson = False
) -> None:
    """Cancel what is queued or running of a campaign.

    The results it has are kept.
    """
    from scenario_tui.cli.output import say

    found, runs = _steer(
        "cancel", lambda daemon, found: daemon.cancel(found), campaign, connect, state, as_json
    )
    say(f"cancelled {runs} of {found}")


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
    from scenario_tui.cli.output import say

    found, runs = _steer(
        "retry",
        lambda daemon, found: daemon.retry(found, only=only),
        campaign,
        connect,
        state,
        as_json,
    )
    say(f"queued {runs} of {found} again")


def pause(
    campaign: CampaignName, connect: Connect = "", state: State = None, as_json: AsJson = False
) -> None:
    """Start no more runs of a campaign until it is resumed.

    Runs that are running finish.
    """
    from scenario_tui.cli.output import say

    found, runs = _steer(
        "pause", lambda daemon, found: daemon.pause(found), campaign, connect, state, as_json
    )
    say(f"paused {found}; {runs} wait until `scenario resume {found}`")


def resume(
    campaign: CampaignName, connect: Connect = "", state: State = None, as_json: AsJson = False
) -> None:
    """Go on with a paused campaign."""
    from scenario_tui.cli.output import say

    found, runs = _steer(
        "resume", lambda daemon, found: daemon.resume(found), campaign, connect, state, as_json
    )
    say(f"resumed {found}, {runs} queued")


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
    from scenario_tui.cli.output import emit, say
    from scenario_tui.cli.target import DaemonTarget, find_campaign

    with DaemonTarget(connect, state).open() as daemon:
        row = find_campaign(daemon, campaign)
        daemon.prioritise(row.id, number)
    if as_json:
        emit("priority", campaign=row.id, priority=number)
    say(f"{row.id} has priority {number}")


def stop(connect: Connect = "", state: State = None, as_json: AsJson = False) -> None:
    """Ask the daemon to leave.

    Running runs get a while to finish; what is queued goes on with the next daemon.
    """
    from daemon.batch.paths import endpoint_text
    from scenario_tui.cli.output import emit, say
    from scenario_tui.cli.target import DaemonTarget

    target = DaemonTarget(connect, state)
    # Asked first: once the daemon has left, nothing says where it was.
    endpoint = target.endpoint
    with target.open() as daemon:
        overview = daemon.overview()
        daemon.shutdown()
    waiting = overview.queued + overview.running
    if as_json:
        emit("stop", endpoint=endpoint, unfinished=waiting)
    kept = f"; {waiting} unfinished runs go on when it is started again" if waiting else ""
    say(f"the daemon at {endpoint_text(endpoint)} is leaving{kept}")
