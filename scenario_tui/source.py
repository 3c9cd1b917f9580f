"""Sources of recorded campaigns: a daemon, the ledger of a state directory, traces, a file.

This module finds everything that people name: campaigns, searches, runs and traces. It does not
print: a :class:`DaemonTarget` has functions for messages and progress.
"""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from daemon.batch.errors import DaemonError, Refused, TraceUnavailable, Unreachable
from daemon.model.verdicts import RunState
from grammars.text.diagnostics import Finding, InputError, Where, did_you_mean
from grammars.text.file_kinds import kind_of_file
from grammars.text.words import command_line, count_noun
from scenario_tui.text.run_state import unfinished_text, without_trace_text, without_traces_text

if TYPE_CHECKING:
    from daemon.analysis.recorded import Progress, RecordedCampaign
    from daemon.batch.paths import StatePaths
    from daemon.model.assessments import Mark
    from daemon.model.status import CampaignRow, RunDetail, RunRow
    from daemon.model.verbs import CampaignSource, DaemonClient

_NONE_YET: Final = "there are no campaigns yet: write one with `scenario new my-tests`"
_MCAP: Final = b"\x89MCAP0\r\n"
"""First bytes of every MCAP file."""
_LISTED: Final = 3
"""Traces that a message lists if one is required and several match."""


def _no_progress(*_: object) -> AbstractContextManager[Callable[[int], None]]:
    return nullcontext(lambda _: None)


@dataclass(frozen=True, slots=True)
class DaemonTarget:
    """A daemon: the one at ``connect``, otherwise that of the directory ``state``.

    ``say`` gets messages for people, ``progress`` shows the progress of a transfer or a judgement;
    both are silent by default.
    """

    connect: str = ""
    state: Path | None = None
    say: Callable[[str], None] = lambda _: None
    progress: Progress = _no_progress

    @property
    def endpoint(self) -> str:
        """Present address of the daemon; it may change when the daemon restarts.

        Raises :class:`Unreachable` for a chosen state directory that no daemon keeps, and
        :class:`InputError` if the variable of the environment is not an endpoint.
        """
        from daemon.batch.paths import StatePaths, find_endpoint, is_endpoint

        endpoint = find_endpoint(self.connect, self.state)
        if endpoint.origin == "SCENARIO_CONNECT" and not is_endpoint(endpoint.address):
            message = f"{endpoint.address!r} is not an endpoint"
            hint = "write tcp/<host>:<port> or tls/<host>:<port>"
            raise InputError(Finding(Where(endpoint.origin), message, hint))
        if endpoint.origin == "default" and (self.state or os.environ.get("SCENARIO_STATE")):
            folder = StatePaths.find(self.state).state
            raise Unreachable(
                f"no daemon keeps {folder}: start one with `{self.command('daemon')}`"
            )
        return endpoint.address

    @property
    def paths(self) -> StatePaths:
        """The state directory of the daemon of this machine."""
        from daemon.batch.paths import StatePaths

        return StatePaths.find(self.state)

    @property
    def named(self) -> bool:
        """True if people named a daemon; then no other is started for them."""
        from daemon.batch.paths import find_endpoint

        return find_endpoint(self.connect, self.state).origin in ("--connect", "SCENARIO_CONNECT")

    @property
    def words(self) -> tuple[str, ...]:
        """The command line options for this daemon."""
        state = ("--state", str(self.state)) if self.state is not None else ()
        return (*(("--connect", self.connect) if self.connect else ()), *state)

    def command(self, *words: object) -> str:
        """Return a command about this daemon for people to type, quoted for a shell."""
        # A negative number would be an option, except behind a bare --, which comes last.
        last = ("--", words[-1]) if re.fullmatch(r"-\d+", str(words[-1])) else ()
        return command_line(*(words[:-1] if last else words), *self.words, *last)

    @property
    def may_come_back(self) -> bool:
        """True if the daemon is named or has left a ledger: it may only be away."""
        return self.named or self.paths.ledger.exists()

    def open(self) -> AbstractContextManager[DaemonClient]:
        """Open a client; raises :class:`Unreachable`."""
        from daemon.batch.client import Client

        return Client.open(self.endpoint)

    def read(self) -> AbstractContextManager[CampaignSource]:
        """Open the named daemon, otherwise the ledger here, which needs no daemon.

        Raises :class:`Refused` if there is no ledger.
        """
        if self.named:
            return self.open()
        if not self.paths.ledger.is_file():
            state = self.paths.state
            raise Refused(
                f"no campaign was submitted here, {state} is not a state directory: name a folder "
                "of traces, or choose another directory with --state"
            )
        from daemon.batch.ledger import LedgerReader

        return LedgerReader.open(self.paths)


def open_source(
    name: str, target: DaemonTarget, *, judge: bool = True
) -> AbstractContextManager[CampaignSource]:
    """Open the source of the campaign, the run or the trace ``name``.

    A folder with traces, a trace and a file of results are read from this machine; any other name
    belongs to a daemon or ledger (:meth:`DaemonTarget.read`). Without a name, open that ledger,
    otherwise the newest folder of `scenario run`. With ``judge``, the source judges the traces of
    a folder on demand. Raises :class:`Refused`, :class:`Unreachable` and :class:`InputError`.
    """
    recorded = _read_here(name, target, judge)
    if recorded is not None:
        if recorded.copies:
            copies = count_noun(recorded.copies, "copy of a trace", "copies of traces")
            target.say(f"{name}: {copies} left out, each run counts once")
        return nullcontext(recorded)
    try:
        return target.read()
    except Refused as error:
        if name:
            where = f"no campaign or run in {target.paths.state}"
            raise Refused(
                _why_no_traces(name) or f"{name} is not a trace, not a folder, {where}"
            ) from error
        newest = newest_results()
        if newest is None:
            raise
        return open_source(str(newest), target, judge=judge)


def _read_here(name: str, target: DaemonTarget, judge: bool) -> RecordedCampaign | None:
    """Return the traces or the results of that name on this machine, if any."""
    path = Path(name)
    if trace_files(name):
        from daemon.analysis.recorded import read_traces

        return read_traces(name, progress=target.progress if judge else None)
    if path.suffix == ".mcap":
        raise Refused(_why_no_traces(name) or f"the trace {name} does not exist")
    if path.suffix == ".json" or path.is_fifo():
        from daemon.analysis.recorded import read_results_file

        return read_results_file(name)
    return None


def _why_no_traces(name: str) -> str:
    """Return the kind of a folder or a file that names no campaign; empty for neither."""
    if Path(name).is_dir():
        holds = "is a folder of traces" if trace_files(name) else "holds no traces (.mcap files)"
        return f"{name} {holds}"
    if Path(name).is_file():
        kind = kind_of_file(Path(name))
        other = f"is {kind.title}: {kind.advice}" if kind else "is not a trace (MCAP file)"
        return f"{name} {'is a trace' if trace_files(name) else other}"
    return ""


def newest_results() -> Path | None:
    """Return the folder with the newest traces of `scenario run` here, if any."""
    notes = Path("scenario-results").glob("*/campaign.json")
    newest = max(notes, key=lambda note: note.stat().st_mtime, default=None)
    return None if newest is None else newest.parent


def trace_files(name: str) -> Sequence[Path]:
    """Return the traces in the folder ``name``, or the trace of that name; empty for neither.

    `scenario new patrol` makes a folder with the name of its campaign, without traces.
    """
    path = Path(name)
    if path.is_file():
        with path.open("rb") as file:
            return [path] if file.read(len(_MCAP)) == _MCAP else []
    if not (name and path.is_dir()):
        return []
    from daemon.analysis.results import traces_below

    return traces_below(path)


def find_run(source: CampaignSource, name: str) -> RunDetail:
    """Return the run of an id, or of a campaign as :func:`find_campaign`, a dot and its number.

    Raises :class:`Refused` with the existing runs if it does not exist.
    """
    campaign_name, _, number = name.rpartition(".")
    is_numbered = bool(campaign_name) and number.isdecimal()
    # An id costs one request; any other name needs the list of campaigns.
    with suppress(Refused):
        return source.run(name)
    if files := trace_files(name):
        _refuse_several(name, [str(file) for file in files])
        return source.run(str(files[0]))
    if Path(name).is_file():
        raise Refused(_why_no_campaign(source, name))
    campaign = find_campaign(source, campaign_name if is_numbered else name)
    run = f"{campaign.id}.{number}"
    if is_numbered and run != name:
        with suppress(Refused):
            return source.run(run)
    runs = f"{campaign.id}.0 to {campaign.id}.{campaign.total - 1}"
    raise Refused(f'"{name}" is not a run: those of {campaign.id} are {runs}')


def find_campaign(source: CampaignSource, name: str) -> CampaignRow:
    """Return the campaign of an id, a name (the newest of it) or the beginning of either.

    Without a name, return the newest campaign. The name of a search comes from its campaign file.
    Raises :class:`Refused` if no campaign or several different names match.
    """
    # An id beats a name and both beat a beginning, so a whole word is never ambiguous.
    # One request for each, because there may be thousands of campaigns and these return a few.
    if not name:
        newest = source.campaign_page(limit=1)
        if newest:
            return newest[0]
        raise Refused(_NONE_YET)
    exact = source.campaign_page(id=name, limit=1) or source.campaign_page(name=name, limit=1)
    if exact:
        return exact[0]
    # Ids begin with the name: of several campaigns with one name, take the newest.
    close = source.campaign_page(beginning=name)
    if len({row.name for row in close}) > 1:
        ids = ", ".join(row.id for row in close[:5])
        raise Refused(f'several campaigns begin with "{name}": {ids}')
    if close:
        return close[0]
    for search in source.searches():
        row = source.campaign(search.campaign) if search.task.name == name else None
        if row is not None:
            return row
    raise Refused(_why_no_campaign(source, name))


def _why_no_campaign(source: CampaignSource, name: str) -> str:
    """Return the kind of a word that names no campaign, or a suggestion."""
    from scenario_tui.campaign_files import is_campaign

    text = Path(name).read_text("utf-8", "replace") if is_campaign(Path(name)) else ""
    if match := re.search(r"^campaign\s*:\s*([\w-]+)", text, re.MULTILINE):
        return f'{name} is a file: its submitted campaign is called "{match[1]}"'
    if words := _why_no_traces(name):
        return f"{words}, and no campaign has that name"
    if name.rpartition(".")[2].isdecimal():
        try:
            campaign = find_run(source, name).row.campaign
        except Refused as error:
            return str(error)
        return f"{name} is a run of {campaign}: `scenario show` shows it"
    # Ids have neither (daemon.model.ids).
    if "/" in name or "." in name:
        return f"the folder or file {name} does not exist"
    rows = source.campaign_page()
    for row in rows[:_LISTED]:
        if runs := source.runs(row.id, scenario=name, limit=1).rows:
            return f"{name} is a scenario of {row.id}: name a run of it, such as {runs[0].id}"
    names = {row.name for row in rows} | {row.id for row in rows}
    return f'no campaign is called "{name}": {did_you_mean(name, names)}' if rows else _NONE_YET


def one_trace(run: str, target: DaemonTarget) -> Path:
    """Return the trace of a run, named by its id or as a file; fetch it if it lies elsewhere.

    Raises :class:`Refused` for none or several, and :class:`TraceUnavailable`.
    """
    return _traces_of(run, target, is_alone=True)[0]


def verdict_marks(run: str, target: DaemonTarget) -> Mapping[str, Mark]:
    """Return the marks, by oracle, of the verdicts of a run named as for :func:`one_trace`.

    Empty if the expectations of its campaign are unknown.
    """
    from daemon.analysis.recorded import read_marks

    silent = replace(target, say=lambda _: None, progress=_no_progress)
    with open_source(run, silent) as source:
        (row,) = recorded_runs(source, run, silent)
        expectations = read_marks(source, row)
    return {} if expectations is None else expectations.mark_verdicts(row)


def all_traces(
    names: Sequence[str], target: DaemonTarget, *, one_of_cell: bool = False
) -> tuple[Path, ...]:
    """Return the traces of files, folders, and ids of campaigns and runs.

    Each comes once, in the order of the names, those of a folder by name. As for
    :func:`one_trace`, but a trace that cannot be fetched is left out with a message, unless it is
    the only one. With ``one_of_cell``, a campaign gives the first of each scenario and system.
    """
    traces = [_traces_of(name, target, one_of_cell=one_of_cell) for name in names]
    return tuple(dict.fromkeys(itertools.chain.from_iterable(traces)))


def _traces_of(
    name: str, target: DaemonTarget, *, is_alone: bool = False, one_of_cell: bool = False
) -> Sequence[Path]:
    files = trace_files(name)
    if files:
        if is_alone:
            _refuse_several(name, [file.name for file in files])
        return files
    with open_source(name, target) as source:
        rows = recorded_runs(source, name, target)
        if one_of_cell:
            cells: dict[tuple[str, str], RunRow] = {}
            for row in rows:
                cells.setdefault((row.scenario, row.sut), row)
            rows = tuple(cells.values())
        # Before any transfer: a campaign may have thousands of traces.
        if is_alone:
            _refuse_several(name, [row.id for row in rows])
        brought = bring_traces(rows, source, target)
    files = [trace for trace in brought if isinstance(trace, Path)]
    missing = [trace for trace in brought if not isinstance(trace, Path)]
    if not files:
        raise missing[0]
    # A missing trace must not hide the others of a campaign.
    for problem in missing:
        target.say(str(problem))
    return files


def _refuse_several(name: str, traces: Sequence[str]) -> None:
    if len(traces) > 1:
        names = ", ".join(traces[:_LISTED]) + (", …" if len(traces) > _LISTED else "")
        raise Refused(f"{name} has {len(traces)} traces ({names}): name one of them")


def recorded_runs(source: CampaignSource, name: str, target: DaemonTarget) -> tuple[RunRow, ...]:
    """Return the run, or the runs of the campaign, called ``name``; those with a result.

    Raises :class:`Refused` if the name is unknown, or with the reason why there is no result yet.
    """
    # Ids of campaigns have no dots.
    if "." in name:
        run = find_run(source, name).row
        if run.result is None:
            raise Refused(why_no_trace(run, source, target))
        return (run,)
    campaign = find_campaign(source, name)
    rows = source.all_runs(campaign.id, results=True)
    rows = tuple(row for row in rows if row.result is not None)
    if not rows:
        raise Refused(without_traces_text(with_time_left(campaign, target), target.command))
    if rest := unfinished_text(campaign):
        finished = f"{count_noun(len(rows), 'run')} finished so far"
        target.say(f"{campaign.id} is not finished ({rest}): {finished}")
    return rows


def why_no_trace(run: RunRow, source: CampaignSource, target: DaemonTarget) -> str:
    """Return why a run has no trace (yet), and its place in the queue of its campaign."""
    from daemon.model.messages import LARGEST_PAGE

    campaign = source.campaign(run.campaign)
    if campaign is not None:
        campaign = with_time_left(campaign, target)
    if run.state is not RunState.QUEUED:
        return without_trace_text(run, campaign, None, target.command)
    waiting = source.runs(run.campaign, state=RunState.QUEUED, limit=LARGEST_PAGE)
    before = next((k for k, row in enumerate(waiting.rows) if row.id == run.id), None)
    return without_trace_text(run, campaign, before, target.command)


def with_time_left(campaign: CampaignRow, target: DaemonTarget) -> CampaignRow:
    """Return a campaign with its remaining time, if a daemon answers."""
    with suppress(DaemonError):
        if not campaign.finished and campaign.seconds_left is None:
            with target.open() as daemon:
                return daemon.campaign(campaign.id) or campaign
    return campaign


def bring_traces(
    rows: Sequence[RunRow], source: CampaignSource, target: DaemonTarget, folder: Path | None = None
) -> list[Path | TraceUnavailable]:
    """Return the trace of each run as a local file, or why it is unavailable.

    With ``folder``, each is a verified copy there. Otherwise traces of the ledger here are local
    already, except in stores.
    """
    from daemon.batch.stores import copy_trace, is_url, trace_file, trace_reference
    from daemon.model.ids import trace_name
    from daemon.model.verbs import DaemonClient

    daemon = source if isinstance(source, DaemonClient) else None
    far = [row for row in rows if row.trace and (folder or daemon or is_url(row.trace))]
    size = sum(row.result.trace.size for row in far if row.result)
    traces: list[Path | TraceUnavailable] = []
    with target.progress("fetching traces", size, "bytes") as advance:
        for row in rows:
            try:
                if folder is None:
                    trace = trace_file(row, daemon, progress=advance)
                else:
                    trace = folder / trace_name(row.campaign, row.scenario, row.sut, row.repeat)
                    copy_trace(trace_reference(row), daemon, trace, progress=advance)
                traces.append(trace)
            except TraceUnavailable as error:
                traces.append(error)
    return traces
