"""What the dashboard knows, and what a screen asks for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, Literal

if TYPE_CHECKING:
    from daemon.analysis.results import CampaignResults
    from daemon.model.messages import RunQuery
    from daemon.model.search_answer import SearchRow
    from daemon.model.status import (
        CampaignRow,
        DaemonOverview,
        RunDetail,
        RunPage,
        RunRow,
        WorkerRow,
    )
    from grammars.model.scene import Scene
    from scenario_tui.dashboard.recorded_traces import TraceSummary, UnavailableTrace
    from scenario_tui.dashboard.searches import SearchTrials
    from scenario_tui.text.results import Conclusion

RUNNING_SHOWN: Final = 200
"""Running runs asked for at a time; there are rarely more slots."""
CAMPAIGNS_SHOWN: Final = 500
"""Campaigns in the table, the newest: a table of thousands is slow to lay out."""


@dataclass(frozen=True, slots=True)
class RunsView:
    """How the runs of a place were looked at last: filter, order, page and the run in front."""

    wanted: RunQuery
    only: int = 0
    key: str = ""


@dataclass(frozen=True, slots=True)
class Query:
    """What the screen in front shows beyond the overview: nothing else is asked for.

    ``judged``: also what the run would be judged by now. ``running``: the runs under way of a
    campaign, of all when it is empty.
    """

    runs: RunQuery | None = None
    run: str = ""
    judged: bool = False
    running: str | None = None
    workers: bool = False
    results: str = ""
    search: str = ""


@dataclass(frozen=True, slots=True)
class DashboardState:
    """The last that is known; ``at`` is when it was true [s since the epoch], 0 for never.

    ``problem`` says why we are not connected; somebody is there but ``refused`` when that is what
    they said, as daemons of other versions do.
    """

    connected: bool = False
    problem: str = ""
    refused: bool = False
    at: float = 0.0
    overview: DaemonOverview | None = None
    campaigns: tuple[CampaignRow, ...] = ()
    workers: tuple[WorkerRow, ...] = ()
    wanted: RunQuery | None = None
    page: RunPage | None = None
    running: RunPage | None = None
    detail: RunDetail | None = None
    scene: Scene | None = None
    recording: TraceSummary | UnavailableTrace | None = None
    conclusions: Mapping[str, Conclusion] = field(default_factory=dict)
    results: CampaignResults | None = None
    searches: Mapping[str, SearchRow] = field(default_factory=dict)
    search: SearchTrials | None = None

    def campaign(self, campaign: str) -> CampaignRow | None:
        """Return the campaign with this id."""
        return next((row for row in self.campaigns if row.id == campaign), None)

    def known_rows(self) -> tuple[RunRow, ...]:
        """Return the rows of the page and of the run that were asked for last."""
        page = self.page.rows if self.page is not None else ()
        return page if self.detail is None else (*page, self.detail.row)

    def page_for(self, query: RunQuery) -> RunPage | None:
        """Return the page of runs asked for; the last one asked for may be another."""
        return self.page if self.wanted == query else None

    def detail_of(self, run: str) -> RunDetail | None:
        """Return the details of a run, if that is the one that was asked for last."""
        return self.detail if self.detail is not None and self.detail.row.id == run else None

    def search_of(self, campaign: str) -> SearchTrials | None:
        """Return a search with its trials, if that is the one that was asked for last."""
        return self.search if self.search and self.search.row.campaign == campaign else None

    def recording_of(self, run: str) -> TraceSummary | UnavailableTrace | None:
        """Return what is known of the trace of a run."""
        return self.recording if self.recording is not None and self.recording.run == run else None


@dataclass(frozen=True, slots=True)
class Notice:
    """The outcome of an action, for people."""

    text: str
    severity: Literal["information", "error"] = "information"
