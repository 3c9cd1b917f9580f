"""The traces that a command's words name: of this machine, or brought here from where they lie."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

import typer

from daemon.batch.errors import DaemonError, Refused, TraceUnavailable, Unreachable
from daemon.model.run_state import RunState
from grammars.text.words import count_noun
from scenario_tui.cli.output import open_progress, say
from scenario_tui.cli.target import DaemonTarget, find_campaign, find_run
from scenario_tui.text.run_state import unfinished_text, without_trace_text, without_traces_text

if TYPE_CHECKING:
    from daemon.batch.stores import ByteProgress
    from daemon.model.status import CampaignRow, RunRow
    from daemon.model.verbs import CampaignSource

_MCAP: Final = b"\x89MCAP0\r\n"
"""What every MCAP file begins with."""
_NAMED: Final = 3
"""Traces that are named when several are meant and one is wanted."""


def newest_results() -> Path | None:
    """Return the folder in which `scenario run` left the newest traces here, if it did."""
    notes = Path("scenario-results").glob("*/campaign.json")
    newest = max(notes, key=lambda note: note.stat().st_mtime, default=None)
    return None if newest is None else newest.parent


@contextmanager
def pointing_to_traces(command: str, named: str, hint: str) -> Iterator[None]:
    """Name the commands that read traces where a daemon does not know what was ``named``.

    ``command`` is the one that asks a daemon, ``hint`` its parameter. A trace or a folder of this
    machine is wrong usage; without a daemon the newest folder of `scenario run` is named.
    """
    try:
        yield
    except (Refused, Unreachable) as error:
        path = Path(named)
        if named.endswith(".mcap") or (named and path.is_dir()):
            readers = "`scenario report` and `scenario judge`"
            if not path.is_dir():
                readers = "`scenario show --log`, `scenario replay` and `scenario judge`"
            message = f"`scenario {command}` asks a daemon about its runs; {named} is read by"
            raise typer.BadParameter(f"{message} {readers}", param_hint=hint) from error
        newest = newest_results()
        if isinstance(error, Refused) or newest is None:
            raise
        message = f"{error}; what `scenario run` left in {newest} is read by"
        raise Unreachable(f"{message} `scenario report {shlex.quote(str(newest))}`") from error


def one_trace(run: str, target: DaemonTarget, hint: str) -> Path:
    """Return the trace of a run named by its id or as a file; wrong usage for none or several.

    It is brought here first when it lies in a store, or with a daemon that ``target`` names.
    ``hint`` is the parameter the words came from.
    """
    if files := _trace_files(run):
        _refuse_several(run, [file.name for file in files], hint)
        return files[0]
    with open_records(run, target, hint) as source:
        rows = recorded_runs(source, run, target, hint)
        # Before anything is brought: a campaign may have thousands of traces.
        _refuse_several(run, [row.id for row in rows], hint)
        return _bring_traces(rows, source)[0]


def all_traces(
    named: Sequence[str], target: DaemonTarget, hint: str, *, one_of_cell: bool = False
) -> tuple[Path, ...]:
    """Return the traces meant: files, folders, and ids of campaigns and runs.

    Each once, in the order named, those of a folder by name. Otherwise as :func:`one_trace`; a
    trace that cannot be brought is left out with a message, unless there is no other. With
    ``one_of_cell`` only the first of each scenario and system comes from a campaign.
    """
    traces: dict[Path, None] = {}
    for name in named:
        files = _trace_files(name)
        if not files:
            with open_records(name, target, hint) as source:
                rows = recorded_runs(source, name, target, hint)
                if one_of_cell:
                    cells: dict[tuple[str, str], RunRow] = {}
                    for row in rows:
                        cells.setdefault((row.scenario, row.sut), row)
                    rows = tuple(cells.values())
                files = _bring_traces(rows, source)
        traces |= dict.fromkeys(files)
    return tuple(traces)


def _trace_files(name: str) -> Sequence[Path]:
    """Return the file of that name, or the traces in the folder of that name."""
    path = Path(name)
    if path.is_file():
        return [path]
    return sorted(path.rglob("*.mcap")) if name and path.is_dir() else []


def names_traces(name: str) -> bool:
    """Return True if ``name`` is a file here, or a folder with traces in it.

    `scenario new patrol` makes a folder that is called like its campaign and holds none.
    """
    return bool(_trace_files(name))


def _refuse_several(name: str, traces: Sequence[str], hint: str) -> None:
    if len(traces) > 1:
        names = ", ".join(traces[:_NAMED]) + (", …" if len(traces) > _NAMED else "")
        message = f"{name} means {len(traces)} traces ({names}): name one of them"
        raise typer.BadParameter(message, param_hint=hint)


@contextmanager
def open_records(name: str, target: DaemonTarget, hint: str) -> Iterator[CampaignSource]:
    """Open the daemon that people named, otherwise the ledger, to ask it about ``name``.

    Its refusals are wrong usage of the parameter ``hint``.
    """
    from daemon.batch.ledger import LedgerReader

    try:
        if name.endswith(".mcap") or not (target.named or target.paths.ledger.is_file()):
            state = target.paths.state
            raise Refused(f"{name} is no trace, no folder, and no campaign or run in {state}")
        with target.open() if target.named else LedgerReader.open(target.paths) as source:
            yield source
    except Refused as error:
        is_folder = bool(name) and Path(name).is_dir()
        message = f"{name} holds no traces (.mcap files)" if is_folder else str(error)
        raise typer.BadParameter(message, param_hint=hint) from error


def refuse_other_files(named: Sequence[str], hint: str) -> None:
    """Refuse files that were named and are no traces, as wrong usage: by what they begin with.

    A trace that breaks off is one all the same.
    """
    for name in named:
        path = Path(name)
        if not path.is_file():
            continue
        with path.open("rb") as file:
            if file.read(len(_MCAP)) != _MCAP:
                raise typer.BadParameter(f"{name} is no trace (MCAP file)", param_hint=hint)


def recorded_runs(
    source: CampaignSource, name: str, target: DaemonTarget, hint: str
) -> tuple[RunRow, ...]:
    """Return the run, or the runs of the campaign, that ``name`` means; those with a result.

    Wrong usage of the parameter ``hint``, with the reason, when there is none with a result (yet).
    Raises :class:`Refused` when it means neither.
    """
    # Ids of campaigns have no dots.
    if "." in name:
        run = find_run(source, name).row
        if run.result is None:
            campaign = find_campaign(source, run.campaign)
            message = why_no_trace(run, _with_time_left(campaign, target), source)
            raise typer.BadParameter(message, param_hint=hint)
        return (run,)
    try:
        campaign = find_campaign(source, name)
    except Refused as error:
        raise Refused(f"{name} is no trace, no folder and no run: {error}") from error
    rows = source.all_runs(campaign.id, results=True)
    rows = tuple(row for row in rows if row.result is not None)
    if not rows:
        message = without_traces_text(_with_time_left(campaign, target))
        raise typer.BadParameter(message, param_hint=hint)
    if rest := unfinished_text(campaign):
        say(f"{campaign.id} goes on ({rest}): {count_noun(len(rows), 'run')} finished so far")
    return rows


def why_no_trace(run: RunRow, campaign: CampaignRow | None, source: CampaignSource) -> str:
    """Return why a run has no trace (yet), and where it stands in the queue of its campaign."""
    from daemon.model.messages import LARGEST_PAGE

    if run.state is not RunState.QUEUED:
        return without_trace_text(run, campaign)
    waiting = source.runs(run.campaign, state=RunState.QUEUED, limit=LARGEST_PAGE)
    before = next((k for k, row in enumerate(waiting.rows) if row.id == run.id), None)
    return without_trace_text(run, campaign, before)


def _with_time_left(campaign: CampaignRow, target: DaemonTarget) -> CampaignRow:
    """Return a campaign with the time it takes, which only a daemon that runs can say."""
    with suppress(DaemonError):
        if not campaign.finished and campaign.seconds_left is None:
            with target.open() as daemon:
                return daemon.campaign(campaign.id) or campaign
    return campaign


@contextmanager
def transfer_progress(total: int) -> Iterator[ByteProgress]:
    """Show on a terminal how much of ``total`` bytes has come; yields what counts further bytes."""
    if not total:
        yield lambda _: None
        return
    from rich.progress import BarColumn, DownloadColumn, TransferSpeedColumn

    columns = ("bringing traces", BarColumn(), DownloadColumn(), TransferSpeedColumn())
    with open_progress(*columns) as progress:
        task = progress.add_task("", total=total)
        yield lambda count: progress.advance(task, count)


def _bring_traces(rows: Sequence[RunRow], source: CampaignSource) -> Sequence[Path]:
    """Return the traces of runs as files of this machine.

    Those of the ledger here are files already, except in stores. Raises :class:`TraceUnavailable`
    when there is none.
    """
    from daemon.batch.stores import is_url, trace_file
    from daemon.model.verbs import DaemonClient

    daemon = source if isinstance(source, DaemonClient) else None
    far = [row for row in rows if daemon or is_url(row.trace)]
    traces: list[Path] = []
    problems: list[str] = []
    with transfer_progress(sum(row.result.trace.size for row in far if row.result)) as advance:
        for row in rows:
            try:
                traces.append(trace_file(row, daemon, progress=advance))
            except TraceUnavailable as error:
                problems.append(str(error))
    if not traces:
        raise TraceUnavailable(problems[0])
    # One trace that is gone must not keep the others of a campaign.
    for problem in problems:
        say(problem)
    return traces
