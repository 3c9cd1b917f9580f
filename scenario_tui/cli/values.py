"""Values that only the command line answers with.

Their fields are of types that take pydantic to load, so commands import this when they run: help
and completion do without.
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
    """A daemon and everything it has; ``searches`` are those that have not ended."""

    endpoint: str
    overview: DaemonOverview
    campaigns: tuple[CampaignRow, ...]
    workers: tuple[WorkerRow, ...]
    searches: tuple[SearchRow, ...] = ()


@dataclass(frozen=True, slots=True)
class RunSummary:
    """Everything about one run; ``task`` is the search that it belongs to, if any.

    ``standing`` says why there is no trace of it (yet), empty when there is one; ``live`` is how
    far one is that runs, if it told within half a second. ``marks`` are those of its verdicts, by
    the oracle's name: news, and known failures with their reason.
    """

    run: RunDetail
    task: SearchTask | None = None
    standing: str = ""
    live: Snapshot | None = None
    marks: Mapping[str, Mark] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class RunStep:
    """A step in the life of a run: the state it came to, when, and why if there is a reason."""

    at: float
    state: str
    note: str


@dataclass(frozen=True, slots=True)
class RunLog:
    """Log of a run: the ``steps`` of its attempts, their ``output``, events that it recorded.

    ``printed`` is what an external system under test wrote while it ran, by name. Of a trace
    alone only what it recorded and printed is known. ``standing`` says why there is no trace of it
    (yet), empty when there is one.
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

    ``references`` are what others found of the same beside what was found here.
    """

    campaign: str
    runs: int
    answer: str
    exit_code: int
    written: dict[str, str]
    references: tuple[ReferenceComparison, ...] = ()


@dataclass(frozen=True, slots=True)
class ShownSut:
    """A system under test; ``places`` says where each of its parameters was written.

    ``layers`` are the SUT files it is made of. ``ros`` has topics, wiring, planners and costmaps
    of the ROS 1 stack, and is empty for others.
    """

    reference: SutReference
    layers: tuple[str, ...]
    places: dict[str, str]
    defaults: dict[str, dict[str, Any]]
    without_effect: dict[str, str]
    warnings: tuple[Finding, ...]
    ros: dict[str, Any]
