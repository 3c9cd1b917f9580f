"""The command that gives space back: gc."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from scenario_tui.cli._options import AsJson, State

if TYPE_CHECKING:
    from daemon.operation import Swept


def gc(
    keep: Annotated[
        int | None,
        typer.Option("--keep", min=0, help="Keep the traces of this many finished campaigns."),
    ] = None,
    older_than: Annotated[
        str, typer.Option("--older-than", metavar="AGE", help="Remove older ones: 30d, 12h.")
    ] = "",
    max_size: Annotated[
        str, typer.Option("--max-size", metavar="SIZE", help="Remove until they fit: 20GiB.")
    ] = "",
    dry_run: Annotated[
        bool, typer.Option("--dry-run", "-n", help="Say what would go; remove nothing.")
    ] = False,
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Remove traces of finished campaigns, the oldest first.

    Results stay, and say that the trace is gone; a daemon may be running. A trace goes when any
    of the options says so.
    """
    import time

    from daemon.operation import Keeping, sweep
    from daemon.places import Places
    from scenario_tui.cli._amounts import age, size
    from scenario_tui.cli._output import emit

    if keep is None and not older_than and not max_size:
        raise typer.BadParameter("say what to keep: --keep, --older-than or --max-size")
    keeping = Keeping(
        keep, age(older_than) if older_than else None, size(max_size) if max_size else None
    )
    places = Places.find(state)
    swept = sweep(places, keeping, time.time(), dry=dry_run)
    if as_json:
        emit("gc", state=str(places.state), dry_run=dry_run, freed=swept.freed, kept=swept.kept,
             campaigns=_by_campaign(swept))  # fmt: skip
        return
    _print(swept, dry_run)


def _by_campaign(swept: Swept) -> list[dict[str, Any]]:
    found: dict[str, dict[str, Any]] = {}
    for trace in swept.gone:
        entry = {"campaign": trace.campaign, "finished_at": trace.finished_at}
        one = found.setdefault(trace.campaign, {**entry, "traces": 0, "bytes": 0})
        one["traces"] += 1
        one["bytes"] += trace.size
    return list(found.values())


def _print(swept: Swept, dry_run: bool) -> None:
    from scenario_tui.cli._amounts import size_text
    from scenario_tui.cli._output import out
    from scenario_tui.wording import counted

    console = out()
    for one in _by_campaign(swept):
        line = f"{one['campaign']}  {counted(one['traces'], 'trace')}  {size_text(one['bytes'])}"
        console.print(line, markup=False, soft_wrap=True)
    verb = "would remove" if dry_run else "removed"
    console.print(
        f"{verb} {counted(len(swept.gone), 'trace')}, {size_text(swept.freed)}; "
        f"{size_text(swept.kept)} of traces stay",
        soft_wrap=True,
    )
