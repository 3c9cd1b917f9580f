"""The recorded runs a command is about: those of this machine, or brought from where they lie."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from daemon.places import Places
    from daemon.protocol import RunDetail
    from daemon.store import Told
    from scenario_tui.asking import Daemon
    from scenario_tui.cli._session import Target


def one_trace(run: str, target: Target, hint: str) -> Path:
    """Return the trace of a run named by its id or as a file; wrong usage for none or several.

    It is brought here first when it lies in a store, or with a daemon that ``target`` names.
    ``hint`` is the parameter the words came from.
    """
    from daemon.rejudge import find_traces

    if _is_far(run, target):
        return _brought([run], target, hint)[0]
    try:
        traces = find_traces([meant(run, target.places)], target.places)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint=hint) from error
    if len(traces) != 1:
        message = f"{run} means {len(traces)} traces, name one of them"
        raise typer.BadParameter(message, param_hint=hint)
    return traces[0]


def all_traces(named: Sequence[str], target: Target, hint: str) -> tuple[Path, ...]:
    """Return the traces meant: files, folders, and ids of campaigns and runs.

    Like :func:`one_trace`; wrong usage for what names none.
    """
    from daemon.rejudge import find_traces

    far = [name for name in named if _is_far(name, target)]
    if not far:
        try:
            return find_traces([meant(name, target.places) for name in named], target.places)
        except ValueError as error:
            raise typer.BadParameter(str(error), param_hint=hint) from error
    near = [name for name in named if name not in far]
    return (*(all_traces(near, target, hint) if near else ()), *_brought(far, target, hint))


def recorded_runs(daemon: Daemon, name: str) -> tuple[RunDetail, ...]:
    """Return the run, or the runs of the campaign, that ``name`` means; those with a result.

    Raises :class:`daemon.errors.Refused` when it means neither.
    """
    from daemon.errors import Refused
    from scenario_tui.asking import all_runs
    from scenario_tui.cli._session import find_campaign, find_run

    if "." in name:
        return (find_run(daemon, name),)
    try:
        campaign = find_campaign(daemon, name)
    except Refused as error:
        raise Refused(f"{name} is no file and no run: {error}") from error
    rows = all_runs(daemon, campaign.id)
    return tuple(daemon.run(row.id) for row in rows if row.outcome is not None)


@contextmanager
def progress(total: int) -> Iterator[Told]:
    """Show on a terminal how much of ``total`` bytes has come; yields what is to be told."""
    from rich.progress import BarColumn, DownloadColumn, Progress, TransferSpeedColumn

    from scenario_tui.cli._output import err

    console = err()
    columns = ("bringing traces", BarColumn(), DownloadColumn(), TransferSpeedColumn())
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as shown:
        task = shown.add_task("", total=total)
        yield lambda count: shown.advance(task, count)


def _is_far(name: str, target: Target) -> bool:
    """Whether a daemon that was named has to be asked."""
    return target.named and not Path(name).exists() and not name.endswith(".mcap")


def _brought(named: Sequence[str], target: Target, hint: str) -> tuple[Path, ...]:
    from daemon.errors import NotAtHand, Refused
    from daemon.store import Recorded, local_copy, recorded
    from scenario_tui.cli._output import say

    traces: dict[str, Recorded] = {}
    with target.open() as daemon:
        for name in named:
            try:
                runs = recorded_runs(daemon, name)
            except Refused as error:
                raise typer.BadParameter(str(error), param_hint=hint) from error
            for run in runs:
                try:
                    traces[run.row.id] = recorded(run)
                except NotAtHand as error:
                    say(str(error))
        if not traces:
            raise NotAtHand(f"{', '.join(named)}: there are no traces")
        with progress(sum(trace.size for trace in traces.values())) as told:
            return tuple(local_copy(trace, daemon, told=told) for trace in traces.values())


def meant(name: str, places: Places) -> str:
    """Return the id of the campaign or run that ``name`` means here; a file or folder as it is.

    Raises ``ValueError`` for what is none of them.
    """
    from daemon.errors import Refused
    from daemon.report import open_ledger
    from scenario_tui.cli._session import find_campaign, find_run

    if Path(name).exists() or name.endswith(".mcap") or not places.ledger.is_file():
        return name
    try:
        with open_ledger(places) as ledger:
            if "." in name:
                return find_run(ledger, name).row.id
            return find_campaign(ledger, name).id
    except Refused as error:
        # Traces of a campaign the ledger has forgotten may still be there.
        if "/" not in name and (places.traces / name).is_dir():
            return name
        raise ValueError(f"{name} is no trace, no folder and no run: {error}") from error
