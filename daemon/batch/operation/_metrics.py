"""The daemon's numbers in the text format of Prometheus (exposition format 0.0.4).

Names and units follow Prometheus' conventions: base units in the name, seconds and bytes. The
ledger's counts go down when runs are queued again, so they are gauges.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

from daemon.model.run_state import RunState
from daemon.model.status import CampaignRow, DaemonOverview, DiskUsage, WorkerRow
from grammars.text.terminal_text import printable

Samples: TypeAlias = Sequence[tuple[Mapping[str, str], float]]

_STATES: Final = tuple(state.value for state in RunState)
_OUTCOMES: Final = {
    "pass": "passed", "fail": "failed", "inconclusive": "inconclusive", "error": "errors",
}  # fmt: skip
"""Fields of the overview by outcome."""


@dataclass(frozen=True, slots=True)
class DaemonStatus:
    """What a daemon answered, at about one time."""

    overview: DaemonOverview
    campaigns: tuple[CampaignRow, ...]
    workers: tuple[WorkerRow, ...]
    disk: DiskUsage


def prometheus_text(status: DaemonStatus) -> str:
    """Return the metrics as text; campaigns are named while they are unfinished."""
    lines: list[str] = []
    for name, about, samples in _families(status):
        lines += [f"# HELP {name} {_escaped(about)}", f"# TYPE {name} gauge"]
        lines += [f"{name}{_labelled(labels)} {value!r}" for labels, value in samples]
    return "\n".join(lines) + "\n"


def _families(status: DaemonStatus) -> Iterator[tuple[str, str, Samples]]:
    overview, disk = status.overview, status.disk
    unfinished = [row for row in status.campaigns if not row.finished]
    yield "scenario_info", "The daemon, by version.", [({"version": overview.version}, 1)]
    yield "scenario_start_time_seconds", "When the daemon started.", _one(overview.started_at)
    yield "scenario_trouble", "1 while no run can start.", _one(int(bool(overview.trouble)))
    yield "scenario_runs", "Runs in the ledger, by state.", _fields(overview, "state", _STATES)
    outcomes = [({"outcome": word}, getattr(overview, field)) for word, field in _OUTCOMES.items()]
    yield "scenario_outcomes", "Runs that are done, by outcome.", outcomes
    yield "scenario_campaigns", "Campaigns in the ledger.", _one(overview.campaigns)
    runs: Samples = [
        ({"campaign": row.id, **labels}, value)
        for row in unfinished
        for labels, value in _fields(row, "state", _STATES)
    ]
    yield "scenario_campaign_runs", "Runs of unfinished campaigns, by state.", runs
    paused: Samples = [({"campaign": row.id}, int(row.paused)) for row in unfinished]
    yield "scenario_campaign_paused", "1 while an unfinished campaign is paused.", paused
    yield "scenario_run_rate_hertz", "Runs finished lately.", _one(overview.rate / 60.0)
    yield from _workers(status.workers, overview.now)
    yield "scenario_disk_bytes", "Size of the state directory's disk.", _one(disk.total)
    yield "scenario_disk_free_bytes", "Free space on that disk.", _one(disk.free)
    yield "scenario_ledger_bytes", "Size of the ledger.", _one(disk.ledger)
    yield "scenario_traces_bytes", "Size of the traces there.", _one(disk.traces)
    yield "scenario_traces_quota_bytes", "What they may take; 0: no limit.", _one(disk.quota)


def _one(value: float) -> Samples:
    return [({}, value)]


def _fields(row: DaemonOverview | CampaignRow, label: str, fields: tuple[str, ...]) -> Samples:
    return [({label: field}, getattr(row, field)) for field in fields]


def _workers(workers: tuple[WorkerRow, ...], now: float) -> Iterator[tuple[str, str, Samples]]:
    named = [({"worker": row.id, "host": row.host}, row) for row in workers]
    here = sum(not row.away for row in workers)
    yield "scenario_workers", "Workers connected.", _one(here)
    yield "scenario_worker_slots", "Slots, by worker.", [(n, row.slots) for n, row in named]
    yield "scenario_worker_busy", "Busy slots, by worker.", [(n, row.busy) for n, row in named]
    away = [(n, int(row.away)) for n, row in named]
    yield "scenario_worker_away", "1 while a worker's connection is lost, by worker.", away
    silences = [(n, max(0.0, now - row.last_seen_at)) for n, row in named]
    yield "scenario_worker_silence_seconds", "Time since a worker was last heard of.", silences


def _labelled(labels: Mapping[str, str]) -> str:
    if not labels:
        return ""
    quote = str.maketrans({'"': r"\""})  # in labels, not in help texts
    pairs = (f'{name}="{_escaped(text).translate(quote)}"' for name, text in labels.items())
    return "{" + ",".join(pairs) + "}"


def _escaped(text: str) -> str:
    # The format has escapes for these two and for quotes alone.
    return printable(text).replace("\\", "\\\\").replace("\n", "\\n")
