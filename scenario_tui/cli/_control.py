"""Commands that steer: cancel, retry, pause, resume, priority, stop."""

from __future__ import annotations

from typing import Annotated

import typer

from scenario_tui.cli._options import AsJson, CampaignName, Connect, State


def cancel(
    campaign: CampaignName, connect: Connect = "", state: State = None, as_json: AsJson = False
) -> None:
    """Cancel what is queued or running of a campaign.

    The results it has are kept.
    """
    from scenario_tui.cli._output import emit, say
    from scenario_tui.cli._session import Target, find_campaign
    from scenario_tui.wording import counted

    with Target(connect, state).open() as daemon:
        row = find_campaign(daemon, campaign)
        count = daemon.cancel(row.id)
    if as_json:
        emit("cancel", campaign=row.id, runs=count)
    say(f"cancelled {counted(count, 'run')} of {row.id}")


def retry(
    campaign: CampaignName,
    only: Annotated[
        str,
        typer.Option(
            "--only", help="Which runs: lost, cancelled, an outcome, or all; separated by |."
        ),
    ] = "lost|cancelled",
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Queue lost or cancelled runs of a campaign again."""
    from scenario_tui.cli._output import emit, say
    from scenario_tui.cli._session import Target, find_campaign
    from scenario_tui.wording import counted

    with Target(connect, state).open() as daemon:
        row = find_campaign(daemon, campaign)
        count = daemon.retry(row.id, only=only)
    if as_json:
        emit("retry", campaign=row.id, runs=count)
    say(f"queued {counted(count, 'run')} of {row.id} again")


def pause(
    campaign: CampaignName, connect: Connect = "", state: State = None, as_json: AsJson = False
) -> None:
    """Start no more runs of a campaign until it is resumed.

    Runs that are running finish.
    """
    from scenario_tui.cli._output import emit, say
    from scenario_tui.cli._session import Target, find_campaign
    from scenario_tui.wording import counted

    with Target(connect, state).open() as daemon:
        row = find_campaign(daemon, campaign)
        count = daemon.pause(row.id)
    if as_json:
        emit("pause", campaign=row.id, runs=count)
    say(f"paused {row.id}; {counted(count, 'run')} wait until `scenario resume {row.id}`")


def resume(
    campaign: CampaignName, connect: Connect = "", state: State = None, as_json: AsJson = False
) -> None:
    """Go on with a paused campaign."""
    from scenario_tui.cli._output import emit, say
    from scenario_tui.cli._session import Target, find_campaign
    from scenario_tui.wording import counted

    with Target(connect, state).open() as daemon:
        row = find_campaign(daemon, campaign)
        count = daemon.resume(row.id)
    if as_json:
        emit("resume", campaign=row.id, runs=count)
    say(f"resumed {row.id}, {counted(count, 'run')} queued")


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
    from scenario_tui.cli._output import emit, say
    from scenario_tui.cli._session import Target, find_campaign

    with Target(connect, state).open() as daemon:
        row = find_campaign(daemon, campaign)
        daemon.prioritise(row.id, number)
    if as_json:
        emit("priority", campaign=row.id, priority=number)
    say(f"{row.id} has priority {number}")


def stop(connect: Connect = "", state: State = None) -> None:
    """Ask the daemon to leave.

    Running runs get a while to finish; what is queued goes on with the next daemon.
    """
    from scenario_tui.cli._output import say
    from scenario_tui.cli._session import Target

    target = Target(connect, state)
    # Asked first: once the daemon has left, nothing says where it was.
    endpoint = target.endpoint
    with target.open() as daemon:
        overview = daemon.overview()
        daemon.shutdown()
    waiting = overview.queued + overview.running
    kept = f"; {waiting} unfinished runs go on when it is started again" if waiting else ""
    say(f"the daemon at {endpoint} is leaving{kept}")
