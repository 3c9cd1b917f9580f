"""State of the dashboard that all screens share, and messages for people."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, Literal

if TYPE_CHECKING:
    from daemon.analysis.results import CampaignResults
    from daemon.model.search_answer import SearchRow
    from daemon.model.status import CampaignRow, DaemonOverview
    from scenario_tui.dashboard.widgets.tables import Arrangement
    from scenario_tui.text.results import Conclusion

CAMPAIGNS_SHOWN: Final = 500
"""Campaigns in the table, the newest: a table of thousands is slow to lay out."""


@dataclass(frozen=True, slots=True)
class RunsView:
    """Filter, order, page and the run in front with which the runs of a place were shown last."""

    arrangement: Arrangement
    offset: int = 0
    key: str = ""


@dataclass(frozen=True, slots=True)
class Known:
    """The last that is known; ``at`` is when it was true [s since the epoch], 0 for never.

    ``problem`` says why we are not connected; somebody is there but ``refused`` when that is what
    they said, as daemons of other versions do. ``results`` are those of the campaigns that screens
    in front were about last, as soon as they are judged.
    """

    connected: bool = False
    problem: str = ""
    refused: bool = False
    at: float = 0.0
    overview: DaemonOverview | None = None
    campaigns: tuple[CampaignRow, ...] = ()
    conclusions: Mapping[str, Conclusion] = field(default_factory=dict)
    results: Mapping[str, CampaignResults] = field(default_factory=dict)
    searches: Mapping[str, SearchRow] = field(default_factory=dict)

    def campaign(self, campaign: str) -> CampaignRow | None:
        """Return the campaign with this id."""
        return next((row for row in self.campaigns if row.id == campaign), None)


@dataclass(frozen=True, slots=True)
class Notice:
    """The outcome of an action, for people."""

    text: str
    severity: Literal["information", "error"] = "information"
