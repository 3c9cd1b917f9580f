"""State that all screens of the dashboard share, and messages for people."""

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
"""Newest campaigns in the table; thousands would be slow to lay out."""


@dataclass(frozen=True, slots=True)
class RunsView:
    """The last view of a table of runs: filter, order, page, and the run under the cursor."""

    arrangement: Arrangement
    offset: int = 0
    key: str = ""


@dataclass(frozen=True, slots=True)
class DashboardState:
    """Last state of the daemon; ``at`` is its time [s since the epoch], 0 before the first one.

    ``problem`` tells why the dashboard is not connected; with ``refused`` a daemon answered but
    refused, as other versions do. ``results`` are those of the campaigns last in front, as soon as
    they are judged.
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
