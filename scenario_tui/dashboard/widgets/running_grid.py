"""The running runs of all campaigns: their progress, and the least margin so far."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

from rich.text import Text
from textual.binding import Binding, BindingType

from grammars.text.words import count_noun, duration_text
from scenario_tui.dashboard.run_watch import SILENT
from scenario_tui.dashboard.widgets.tables import KeyedList
from scenario_tui.text.formatting import glyph_word, keep_end
from scenario_tui.text.run_text import reached_text, worst_text
from scenario_tui.text.styles import QUIET

if TYPE_CHECKING:
    from daemon.model.spec import Snapshot
    from daemon.model.status import CampaignRow, RunPage, RunRow
    from daemon.model.verbs import DaemonClient
    from scenario_tui.dashboard.run_watch import Tracks
    from scenario_tui.dashboard.state import DashboardState

_BAR: Final = 6
_LABEL: Final = 16
"""Least columns of a name; a longer one takes the rest of the line, and keeps its end."""
_REACHED: Final = 14
"""Columns of the progress, constant so that the rest of the line does not move."""
_REST: Final = 1 + _BAR + 2 + _REACHED + 2 + 22
"""Columns behind the name."""
_ROOM: Final = 4
"""Rows of the screen per row of the list."""
_RUNNING_SHOWN: Final = 200
"""Most running runs to fetch; there are rarely more slots."""
_LOWEST: Final = 16
"""Least rows of a screen with the list."""


@dataclass(frozen=True, slots=True)
class RunningRun:
    """A running run: its id, label, last snapshot, if any, and the age of that [s]."""

    run: str
    label: str
    snapshot: Snapshot | None = None
    silence: float = 0.0

    @property
    def trouble(self) -> tuple[bool, float]:
        """Sort key that puts runs in trouble first."""
        least = None if self.snapshot is None else self.snapshot.margin
        return least is None, 0.0 if least is None else least


def running_page(daemon: DaemonClient, state: DashboardState) -> RunPage:
    """Return the running runs of all campaigns."""
    # Imported here, because the first screen does not need it.
    from daemon.model.status import RunPage
    from daemon.model.verdicts import RunState

    if state.overview is None or not state.overview.running:
        return RunPage((), 0)
    return daemon.runs(state=str(RunState.RUNNING), limit=_RUNNING_SHOWN)


def running_runs(
    rows: Iterable[RunRow], tracks: Tracks, campaigns: Mapping[str, CampaignRow]
) -> list[RunningRun]:
    """Return running runs with their last snapshots, named with their campaign."""
    runs = []
    for row in rows:
        campaign, track = campaigns.get(row.campaign), tracks.get(row.id)
        label = f"{campaign.name if campaign else row.campaign} {row.label}"
        snapshot, silence = (track.snapshot, tracks.silence(track)) if track else (None, 0.0)
        runs.append(RunningRun(row.id, label, snapshot, silence))
    return runs


class RunningGrid(KeyedList):
    """List of running runs; if they do not fit, those with the least margins."""

    BINDING_GROUP_TITLE = "in the list"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("j", "cursor_down", "Down", show=False, id="down", tooltip="Also the arrow"),
        Binding("k", "cursor_up", "Up", show=False, id="up", tooltip="Also the arrow"),
        Binding("enter", "select", "Open", id="open", tooltip="The run, live"),
    ]

    DEFAULT_CSS = "RunningGrid { display: none; }"

    _places = 0

    def show(self, runs: Sequence[RunningRun], *, more: bool = False) -> None:
        """Show the running runs, or nothing without any.

        While ``more`` are queued, the place of an ended one stays free, so that the rest of the
        screen does not jump.
        """
        height, width = self.screen.size.height, self.size.width or self.screen.size.width
        most = max(2, height // _ROOM)
        # The runs in trouble must be in view, in the order of all runs.
        worst = {one.run for one in sorted(runs, key=lambda one: one.trouble)[:most]}
        visible = [one for one in runs if one.run in worst]
        self._places = max(len(visible), min(self._places, most) if more else 0)
        self.display = self._places > 0 and height >= _LOWEST
        if not self.display:
            return
        self.styles.height = 1 + self._places
        self._entitle(len(runs), len(runs) - len(visible))
        longest = max((len(one.label) for one in visible), default=0)
        names = max(_LABEL, min(longest, width - _REST))
        self.fill({one.run: run_line(one, names) for one in visible})

    def _entitle(self, count: int, hidden: int) -> None:
        title = f"{glyph_word('running')}  {count_noun(count, 'run')}, worst margin so far"
        title += f", {hidden} more" if hidden else ""
        title += "" if self.has_focus else "  tab to choose"
        if title != self.border_title:
            self.border_title = title


def run_line(one: RunningRun, names: int = _LABEL) -> Text:
    """Return a running run: label in ``names`` columns, time bar, progress, least margin so far."""
    text, snapshot = Text(f"{keep_end(one.label, names)} "), one.snapshot
    if snapshot is None or snapshot.waiting:
        return text.append(reached_text(snapshot), style=QUIET)
    text.append_text(progress_bar(snapshot))
    text.append(f"  {reached_text(snapshot, limit=False):<{_REACHED}}  ")
    if one.silence > SILENT:
        text.append(f"last report {duration_text(one.silence)} ago  ", style="inconclusive")
    return text.append_text(worst_text(snapshot.margin, snapshot.unit, snapshot.oracle))


def progress_bar(snapshot: Snapshot) -> Text:
    """Return the used share of a running run's time limit as a bar."""
    share = min(max(snapshot.time / snapshot.limit, 0.0), 1.0) if snapshot.limit > 0.0 else 1.0
    done = round(share * _BAR)
    return Text.assemble(("━" * done, "running"), ("─" * (_BAR - done), QUIET))
