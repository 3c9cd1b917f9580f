"""Values of answers that only the command line has.

The types of their fields load pydantic, so commands import this module when they run: help and
completion do not need it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from daemon.model.assessments import Mark, ReferenceComparison
from daemon.model.live_judgement import LogLine
from daemon.model.search import SearchTask
from daemon.model.search_answer import SearchRow
from daemon.model.spec import Snapshot, SutReference
from daemon.model.status import CampaignRow, DaemonOverview, RunDetail, RunRow, WorkerRow
from grammars.text.diagnostics import Finding


@dataclass(frozen=True, slots=True)
class DaemonStatus:
    """State of a daemon; ``searches`` are those that have not ended."""

    endpoint: str
    overview: DaemonOverview
    campaigns: tuple[CampaignRow, ...]
    workers: tuple[WorkerRow, ...]
    searches: tuple[SearchRow, ...] = ()


@dataclass(frozen=True, slots=True)
class RunSummary:
    """Everything about one run; ``task`` is the search that it belongs to, if any.

    ``standing`` explains a missing trace and is empty otherwise. ``live`` is the progress of a
    running run, if it came within half a second. ``marks`` of verdicts by the oracle's name tell
    new failures from known ones, with their reason.
    """

    run: RunDetail
    task: SearchTask | None = None
    standing: str = ""
    live: Snapshot | None = None
    marks: Mapping[str, Mark] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class RunStep:
    """A step in the life of a run: its new state, the time, and a note with the reason, if any."""

    at: float
    state: str
    note: str


@dataclass(frozen=True, slots=True)
class RunLog:
    """Log of a run: the ``steps`` of its attempts, their ``output``, ``recorded`` events.

    ``printed`` is the output of an external system under test by its name. A trace alone has only
    ``recorded`` and ``printed``. ``standing`` explains a missing trace and is empty otherwise.
    """

    run: str
    attempts: int
    reason: str
    steps: tuple[RunStep, ...] = ()
    output: tuple[str, ...] = ()
    recorded: tuple[LogLine, ...] = ()
    printed: dict[str, str] = field(default_factory=dict)
    standing: str = ""


@dataclass(frozen=True, slots=True)
class SearchResult:
    """A search with its answer and its runs; ``found`` is the campaign file of the failure."""

    search: SearchRow
    proposals: tuple[RunRow, ...]
    found: str = ""


@dataclass(frozen=True, slots=True)
class Searches:
    """The searches of a daemon, the newest first; answers have no campaign file."""

    searches: tuple[SearchRow, ...]


@dataclass(frozen=True, slots=True)
class WrittenReport:
    """Outcome of a campaign or a search, and the files ``written`` about it by their kind.

    ``references`` compare it with published results.
    """

    campaign: str
    runs: int
    answer: str
    exit_code: int
    written: dict[str, str]
    references: tuple[ReferenceComparison, ...] = ()


@dataclass(frozen=True, slots=True)
class ShownSut:
    """A system under test, with the ``places`` where its parameters were written.

    ``layers`` are its SUT files. ``ros`` has topics, wiring, planners and costmaps of the ROS 1
    stack, and is empty for others.
    """

    reference: SutReference
    layers: tuple[str, ...]
    places: dict[str, str]
    defaults: dict[str, dict[str, Any]]
    without_effect: dict[str, str]
    warnings: tuple[Finding, ...]
    ros: dict[str, Any]
