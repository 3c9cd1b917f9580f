"""The command that stays until a campaign is over."""

from __future__ import annotations

from typing import Annotated

import typer

from scenario_tui.cli._exits import ExitCode
from scenario_tui.cli._options import AsJson, CampaignName, Connect, State


def wait(
    campaign: CampaignName,
    timeout: Annotated[
        str, typer.Option("--timeout", metavar="AGE", help="At most so long: 30s, 10min, 2h.")
    ] = "",
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Wait until a campaign is over, and leave with its exit code.

    Leaves with 4 when the time is up before. Ctrl-C ends the waiting only.
    """
    from math import inf

    from scenario_tui.cli._amounts import age
    from scenario_tui.cli._output import say
    from scenario_tui.cli._progress import watch
    from scenario_tui.cli._session import Target, find_campaign
    from scenario_tui.cli._told import emit_results
    from scenario_tui.summary import conclude, gather
    from scenario_tui.wording import counted

    limit = age(timeout) if timeout else inf
    target = Target(connect, state)
    with target.open() as daemon:
        found = find_campaign(daemon, campaign)
    try:
        row = watch(target.open, found.id, limit=limit)
    except KeyboardInterrupt:
        say(f"\n{found.id} goes on; come back with `scenario wait {found.id}`")
        raise typer.Exit(ExitCode.INTERRUPTED) from None
    with target.open() as daemon:
        results = gather(daemon, row)
    if as_json:
        emit_results(results)
    said = conclude(results.assessment, finished=row.finished).said
    if not row.finished:
        left = counted(row.queued + row.running, "run")
        say(f"{row.id}: {left} left after {timeout}, {said}")
        raise typer.Exit(ExitCode.INCONCLUSIVE)
    say(f"{row.id}: {said}")
    raise typer.Exit(results.assessment.exit_code)
