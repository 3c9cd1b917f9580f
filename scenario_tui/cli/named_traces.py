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
from scenario_tui.cli.exit_codes import wrong_usage
from scenario_tui.cli.output import open_progress, say
from scenario_tui.cli.target import DaemonTarget, find_campaign, find_run
from scenario_tui.text.run_state import unfinished_text, without_trace_text, without_traces_text

if TYPE_CHECKING:
    from daemon.batch.paths import StatePaths
    from daemon.batch.stores import ByteProgress, TraceReference
    from daemon.model.status import CampaignRow, RunDetail, RunRow
    from daemon.model.verbs import CampaignSource, DaemonClient

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


def _find_named(source: CampaignSource, name: str) -> CampaignRow | RunDetail:
    """Return what a name means: with a dot in it a run, else a campaign.

    Ids of campaigns have no dots; files and folders are told apart before anybody is asked.
    """
    return find_run(source, name) if "." in name else find_campaign(source, name)


def one_trace(run: str, target: DaemonTarget, hint: str) -> Path:
    """Return the trace of a run named by its id or as a file; wrong usage for none or several.

    It is brought here first when it lies in a store, or with a daemon that ``target`` names.
    ``hint`` is the parameter the words came from.
    """
    if _is_on_named_daemon(run, target):
        return _fetch_traces([run], target, hint)[0]
    traces = _find_local_traces([run], target, hint)
    if len(traces) != 1:
        message = f"{run} means {_few(traces)}: name one of them"
        raise typer.BadParameter(message, param_hint=hint)
    return traces[0]


def _few(traces: Sequence[Path]) -> str:
    """Return how many traces there are, and the names of the first ones."""
    count = count_noun(len(traces), "trace")
    if not traces:
        return count
    names = ", ".join(trace.name for trace in traces[:_NAMED])
    return f"{count} ({names}{', …' if len(traces) > _NAMED else ''})"


def all_traces(named: Sequence[str], target: DaemonTarget, hint: str) -> tuple[Path, ...]:
    """Return the traces meant: files, folders, and ids of campaigns and runs.

    Like :func:`one_trace`; wrong usage for what names none.
    """
    far = [name for name in named if _is_on_named_daemon(name, target)]
    near = [name for name in named if name not in far]
    traces = _find_local_traces(near, target, hint) if near else ()
    return (*traces, *_fetch_traces(far, target, hint)) if far else traces


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


def _find_local_traces(named: Sequence[str], target: DaemonTarget, hint: str) -> tuple[Path, ...]:
    from daemon.analysis.rejudge import find_traces

    with wrong_usage(hint):
        paths: dict[Path, None] = {}
        for name in named:
            resolved = resolve_recorded(name, target.paths)
            try:
                traces = find_traces([resolved], target.paths)
            except ValueError as error:
                raise ValueError(why_without_traces(resolved, target) or str(error)) from error
            if not names_traces(name):
                _say_what_is_missing(resolved, len(traces), target)
            paths |= dict.fromkeys(traces)
        return tuple(paths)


def _say_what_is_missing(campaign: str, traces: int, target: DaemonTarget) -> None:
    """Say that a campaign goes on, and how much of it is there."""
    from daemon.batch.ledger import LedgerReader

    if not target.paths.ledger.is_file():
        return
    with LedgerReader.open(target.paths) as ledger:
        for row in ledger.campaign_page(id=campaign, limit=1):
            _say_progress(row, traces)


def _say_progress(campaign: CampaignRow, traces: int) -> None:
    if rest := unfinished_text(campaign):
        say(f"{campaign.id} goes on ({rest}): {count_noun(traces, 'run')} finished so far")


def why_without_traces(name: str, target: DaemonTarget) -> str:
    """Return why the campaign or run of that id has no trace, empty when there is none of it."""
    from daemon.batch.ledger import LedgerReader
    from daemon.model.status import RunDetail

    if not target.paths.ledger.is_file():
        return ""
    with LedgerReader.open(target.paths) as ledger, suppress(Refused):
        subject = _find_named(ledger, name)
        if isinstance(subject, RunDetail):
            campaign = find_campaign(ledger, subject.row.campaign)
            return why_no_trace(subject.row, _as_daemon_sees(campaign, target), ledger)
        return without_traces_text(_as_daemon_sees(subject, target))
    return ""


def why_no_trace(run: RunRow, campaign: CampaignRow | None, source: CampaignSource) -> str:
    """Return why a run has no trace (yet), and where it stands in the queue of its campaign."""
    from daemon.model.messages import LARGEST_PAGE

    if run.state is not RunState.QUEUED:
        return without_trace_text(run, campaign)
    waiting = source.runs(run.campaign, state=RunState.QUEUED, limit=LARGEST_PAGE)
    before = next((k for k, row in enumerate(waiting.rows) if row.id == run.id), None)
    return without_trace_text(run, campaign, before)


def _as_daemon_sees(campaign: CampaignRow, target: DaemonTarget) -> CampaignRow:
    """Return a campaign with the time it takes, which only a daemon that runs can say."""
    with suppress(DaemonError):
        if not campaign.finished:
            with target.open() as daemon:
                return daemon.campaign(campaign.id) or campaign
    return campaign


def recorded_runs(daemon: DaemonClient, name: str, hint: str) -> tuple[RunRow, ...]:
    """Return the run, or the runs of the campaign, that ``name`` means; those with a result.

    Wrong usage of the parameter ``hint``, with the reason, when there is none with a result (yet).
    Raises :class:`Refused` when it means neither.
    """
    from daemon.model.status import RunDetail

    try:
        subject = _find_named(daemon, name)
    except Refused as error:
        if "." in name:
            raise
        raise Refused(f"{name} is no file and no run: {error}") from error
    if isinstance(subject, RunDetail):
        if subject.row.result is None:
            campaign = daemon.campaign(subject.row.campaign)
            message = why_no_trace(subject.row, campaign, daemon)
            raise typer.BadParameter(message, param_hint=hint)
        return (subject.row,)
    rows = daemon.all_runs(subject.id, results=True)
    rows = tuple(row for row in rows if row.result is not None)
    if not rows:
        raise typer.BadParameter(without_traces_text(subject), param_hint=hint)
    _say_progress(subject, len(rows))
    return rows


@contextmanager
def transfer_progress(total: int) -> Iterator[ByteProgress]:
    """Show on a terminal how much of ``total`` bytes has come; yields what counts further bytes."""
    from rich.progress import BarColumn, DownloadColumn, TransferSpeedColumn

    columns = ("bringing traces", BarColumn(), DownloadColumn(), TransferSpeedColumn())
    with open_progress(*columns) as progress:
        task = progress.add_task("", total=total)
        yield lambda count: progress.advance(task, count)


def _is_on_named_daemon(name: str, target: DaemonTarget) -> bool:
    """Return True if a daemon that was named has to be asked."""
    return target.named and not name.endswith(".mcap") and not names_traces(name)


def names_traces(name: str) -> bool:
    """Return True if ``name`` is a file here, or a folder with traces in it.

    `scenario new patrol` makes a folder that is called like its campaign and holds none.
    """
    path = Path(name)
    return path.is_file() or (bool(name) and path.is_dir() and any(path.rglob("*.mcap")))


def _fetch_traces(named: Sequence[str], target: DaemonTarget, hint: str) -> tuple[Path, ...]:
    from daemon.batch.stores import local_copy, trace_reference

    traces: dict[str, TraceReference] = {}
    with target.open() as daemon:
        for name in named:
            try:
                runs = recorded_runs(daemon, name, hint)
            except Refused as error:
                raise typer.BadParameter(str(error), param_hint=hint) from error
            for row in runs:
                try:
                    traces[row.id] = trace_reference(row)
                except TraceUnavailable as error:
                    # One trace that is gone must not keep the others of a campaign.
                    say(str(error))
        if not traces:
            raise TraceUnavailable(f"{', '.join(named)}: there are no traces")
        with transfer_progress(sum(trace.size for trace in traces.values())) as advance:
            return tuple(local_copy(trace, daemon, progress=advance) for trace in traces.values())


def resolve_recorded(name: str, paths: StatePaths) -> str:
    """Return the id of the campaign or run that ``name`` means here; a file or folder as it is.

    Raises ``ValueError`` for what is none of them.
    """
    from daemon.batch.ledger import LedgerReader
    from daemon.model.status import RunDetail

    # Whether a folder holds traces is asked last: that may be a walk through a whole tree.
    if name.endswith(".mcap") or not paths.ledger.is_file() or names_traces(name):
        return name
    try:
        with LedgerReader.open(paths) as ledger:
            subject = _find_named(ledger, name)
            return subject.row.id if isinstance(subject, RunDetail) else subject.id
    except Refused as error:
        # Traces of a campaign the ledger has forgotten may still be there.
        if Path(name).exists() or ("/" not in name and (paths.traces / name).is_dir()):
            return name
        raise ValueError(f"{name} is no trace, no folder and no run: {error}") from error
