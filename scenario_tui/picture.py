"""What the dashboard knows and what its screens want to know, as values.

:mod:`scenario_tui.feed` makes one out of the other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from daemon.protocol import CampaignRow, Overview, RunDetail, RunPage, WorkerRow
from grammars.scene import Scene
from scenario_tui.recordings import Recording, Unseen
from scenario_tui.summary import Conclusion, Results


@dataclass(frozen=True, slots=True)
class RunsWanted:
    """A page of runs, as :meth:`scenario_tui.asking.Daemon.runs` takes it."""

    campaign: str = ""
    state: str = ""
    outcome: str = ""
    text: str = ""
    sort: str = "index"
    descending: bool = False
    offset: int = 0
    limit: int = 100
    scenario: str = ""
    sut: str = ""


@dataclass(frozen=True, slots=True)
class Want:
    """What the screen in front shows beyond the overview: nothing else is asked for."""

    runs: RunsWanted | None = None
    run: str = ""
    workers: bool = False
    results: str = ""


@dataclass(frozen=True, slots=True)
class Picture:
    """The last that is known; ``at`` is when it was true [s since the epoch], 0 for never.

    ``problem`` says why we are not connected; somebody is there but ``refused`` when that is what
    they said, as daemons of other versions do.
    """

    connected: bool = False
    problem: str = ""
    refused: bool = False
    at: float = 0.0
    overview: Overview | None = None
    campaigns: tuple[CampaignRow, ...] = ()
    workers: tuple[WorkerRow, ...] = ()
    wanted: RunsWanted | None = None
    page: RunPage | None = None
    detail: RunDetail | None = None
    scene: Scene | None = None
    recording: Recording | Unseen | None = None
    conclusions: Mapping[str, Conclusion] = field(default_factory=dict)
    results: Results | None = None


@dataclass(frozen=True, slots=True)
class Notice:
    """The outcome of an action, for people."""

    text: str
    severity: Literal["information", "error"] = "information"
