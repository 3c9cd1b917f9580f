"""Names that moved to :mod:`scenario_tui.source`, until every command imports them from there."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from scenario_tui import source
from scenario_tui.cli.output import show_progress

if TYPE_CHECKING:
    from daemon.model.status import RunRow
    from daemon.model.verbs import CampaignSource
    from scenario_tui.source import DaemonTarget

transfer_progress = partial(show_progress, "bringing traces", unit="bytes")


def one_trace(run: str, target: DaemonTarget, hint: str) -> Path:
    """See :func:`scenario_tui.source.one_trace`."""
    return source.one_trace(run, target)


def all_traces(
    named: Sequence[str], target: DaemonTarget, hint: str, *, one_of_cell: bool = False
) -> tuple[Path, ...]:
    """See :func:`scenario_tui.source.all_traces`."""
    return source.all_traces(named, target, one_of_cell=one_of_cell)


def names_traces(name: str) -> bool:
    """See :func:`scenario_tui.source.trace_files`."""
    return bool(source.trace_files(name))


def open_records(
    name: str, target: DaemonTarget, hint: str
) -> AbstractContextManager[CampaignSource]:
    """See :func:`scenario_tui.source.open_source`."""
    return target.read()


def refuse_other_files(named: Sequence[str], hint: str) -> None:
    """Do nothing: :func:`scenario_tui.source.all_traces` refuses them."""


def recorded_runs(
    source_: CampaignSource, name: str, target: DaemonTarget, hint: str
) -> tuple[RunRow, ...]:
    """See :func:`scenario_tui.source.recorded_runs`."""
    return source.recorded_runs(source_, name, target)
