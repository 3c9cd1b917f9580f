"""The runs under way, a line each: how far they are, and the least margin so far."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

from rich.text import Text
from textual.binding import Binding, BindingType
from textual.message import Message
from textual.widget import Widget

from grammars.text.words import count_noun, duration_text
from scenario_tui.dashboard.live_tracks import SILENT
from scenario_tui.text.formatting import glyph_word, keep_end, run_label
from scenario_tui.text.run_text import reached_text, worst_text
from scenario_tui.text.styles import BUSY, QUIET, UNSURE

if TYPE_CHECKING:
    from daemon.model.spec import Snapshot
    from daemon.model.status import CampaignRow, RunPage, RunRow
    from daemon.model.verbs import DaemonClient
    from scenario_tui.dashboard.live_tracks import Tracks
    from scenario_tui.dashboard.state import Known

_CELL: Final = 76
"""Columns of a run at least; more than one stand beside each other where there is room."""
_LABEL: Final = 20
"""Columns of its name at least; longer ones take what the cell has left, and keep their end."""
_REST: Final = _CELL - _LABEL
_BAR: Final = 12
_REACHED: Final = 23
"""Columns of how far a run is; what follows must not move while its time grows."""
_SHORT_BAR: Final = 6
"""Columns of every bar where what follows one does not fit otherwise."""
_ROOM: Final = 4
"""Of the screen's rows, one of so many is for runs under way."""
_FRAME: Final = 2
"""Rows besides the runs: what they are, and the line below them."""
_RUNNING_SHOWN: Final = 200
"""Running runs asked for at a time; there are rarely more slots."""
_LOWEST: Final = 16
"""Rows of a screen that has room for them at all."""


@dataclass(frozen=True, slots=True)
class RunningRun:
    """A run under way: its id, label, last snapshot, if one came, and how old that is [s]."""

    run: str
    label: str
    seen: Snapshot | None = None
    silence: float = 0.0

    @property
    def trouble(self) -> tuple[bool, float]:
        """What orders runs, those in trouble first."""
        least = None if self.seen is None else self.seen.margin
        return least is None, 0.0 if least is None else least


def running_page(daemon: DaemonClient, known: Known, campaign: str = "") -> RunPage:
    """Return the runs under way of a campaign, of all if it is empty."""
    # The first screen does not wait for what only answers need.
    from daemon.model.run_state import RunState
    from daemon.model.status import RunPage

    if known.overview is None or not known.overview.running:
        return RunPage((), 0)
    return daemon.runs(campaign, state=str(RunState.RUNNING), limit=_RUNNING_SHOWN)


def running_runs(
    rows: Iterable[RunRow], tracks: Tracks, campaigns: Mapping[str, CampaignRow] | None = None
) -> list[RunningRun]:
    """Return runs under way with what was heard of them; called with their campaign if
    ``campaigns`` are given.
    """
    found = []
    for row in rows:
        label, track = run_label(row), tracks.get(row.id)
        if campaigns is not None:
            known = campaigns.get(row.campaign)
            label = f"{known.name if known else row.campaign} {label}"
        seen, silence = (track.snapshot, tracks.silence(track)) if track else (None, 0.0)
        found.append(RunningRun(row.id, label, seen, silence))
    return found


def more_to_come(campaigns: Iterable[CampaignRow]) -> bool:
    """Whether others will run when those under way are over."""
    return any(row.queued and not row.paused for row in campaigns)


class RunningGrid(Widget, can_focus=True):
    """Shows runs under way; of more than fit those with the least margin, in their order."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("j", "step(1)", "Down", show=False, id="down", tooltip="Also the arrow"),
        Binding("k", "step(-1)", "Up", show=False, id="up", tooltip="Also the arrow"),
        Binding("down", "step(1)", "Next run", show=False, id="running-next",
                tooltip="Of those under way"),
        Binding("up", "step(-1)", "Run before", show=False, id="running-before",
                tooltip="Of those under way"),
        Binding("enter", "open", "Open", id="open", tooltip="The run, live"),
    ]  # fmt: skip

    class Opened(Message):
        """Somebody wants to see a ``run``."""

        def __init__(self, run: str) -> None:
            super().__init__()
            self.run = run

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.display = False
        self._runs: tuple[RunningRun, ...] = ()
        self._hidden = 0
        self._rows = 0
        self._chosen = ""
        self._drawn = Text()

    @property
    def chosen(self) -> str:
        """The run under the cursor, empty without any."""
        runs = [one.run for one in self._runs]
        return self._chosen if self._chosen in runs else next(iter(runs), "")

    def show(self, runs: Sequence[RunningRun], *, more: bool = False) -> None:
        """Show the runs under way, or nothing without any.

        While ``more`` are to come the place of one that ends is kept: what is beside them must not
        jump whenever a slot is free for a moment.
        """
        height = self.screen.size.height
        lines = max(2, height // _ROOM)
        across = self._across()
        most = lines * across
        # Who is in trouble must be in view; beyond that a run stays in its place.
        worst = {one.run for one in sorted(runs, key=lambda one: one.trouble)[:most]}
        self._runs = tuple(one for one in runs if one.run in worst)
        self._hidden = len(runs) - len(self._runs)
        kept = min(self._rows, lines) if more else 0
        self._rows = max(-(-len(self._runs) // across), kept)
        self.display = self._rows > 0 and height >= _LOWEST
        if not self.display:
            return
        self.styles.height = _FRAME + self._rows
        drawn = self._draw()
        if drawn != self._drawn:
            self._drawn = drawn
            self.refresh()

    def _across(self) -> int:
        return max(1, (self.size.width or self.screen.size.width) // _CELL)

    def _draw(self) -> Text:
        count = len(self._runs) + self._hidden
        text = Text(no_wrap=True, overflow="ellipsis")
        text.append(glyph_word("running"), style="running")
        text.append(f"  {count_noun(count, 'run')}, worst margin so far", style=QUIET)
        if self._hidden:
            text.append(f"  {self._hidden} more in the table", style=QUIET)
        text.append("" if self.has_focus else "  tab to choose", style=QUIET)
        across = self._across()
        width = (self.size.width or self.screen.size.width) // across
        names, bar = _fit_columns(self._runs, width)
        chosen = self.chosen if self.has_focus else ""
        for place, one in enumerate(self._runs):
            text.append("\n" if place % across == 0 else "")
            cell = run_line(one, names, bar)
            cell.truncate(width - 1, overflow="ellipsis", pad=True)
            if one.run == chosen:
                cell.stylize("reverse")
            text.append_text(cell).append(" ")
        return text

    def render(self) -> Text:
        """Return the lines."""
        return self._drawn

    def _redraw(self) -> None:
        self._drawn = self._draw()
        self.refresh()

    def on_focus(self) -> None:
        """Show the cursor."""
        self._redraw()

    def on_blur(self) -> None:
        """Hide the cursor."""
        self._redraw()

    def action_step(self, step: int) -> None:
        """Move the cursor, as far as there are runs."""
        runs = [one.run for one in self._runs]
        if not runs:
            return
        place = runs.index(self.chosen) + step
        if 0 <= place < len(runs):
            self._chosen = runs[place]
            self._redraw()

    def action_open(self) -> None:
        """Open the run under the cursor."""
        if self.chosen:
            self.post_message(self.Opened(self.chosen))


def _fit_columns(runs: Sequence[RunningRun], width: int) -> tuple[int, int]:
    """Return the columns of names and of bars in cells of ``width``.

    Whose margin is the least is worth more than a long bar, and that more than a long name.
    """
    longest = max((len(one.label) for one in runs), default=0)
    names = max(_LABEL, min(longest, width - _REST))

    def too_long(bar: int) -> int:
        return max((run_line(one, names, bar).cell_len for one in runs), default=0) - width + 1

    if too_long(_BAR) <= 0:
        return names, _BAR
    return max(_LABEL, names - max(too_long(_SHORT_BAR), 0)), _SHORT_BAR


def run_line(one: RunningRun, width: int = _LABEL, bar: int = _BAR) -> Text:
    """Return a run under way: its label in ``width`` columns, ``bar`` columns of the time of its
    limit that is over, how far it is, least margin so far.
    """
    text = Text(f"{keep_end(one.label, width)} ", no_wrap=True)
    seen = one.seen
    if seen is None or seen.waiting:
        return text.append(reached_text(seen), style=QUIET)
    share = min(max(seen.time / seen.limit, 0.0), 1.0) if seen.limit > 0.0 else 1.0
    done = round(share * bar)
    text.append("━" * done, style=BUSY).append("─" * (bar - done), style=QUIET)
    text.append(f"  {reached_text(seen):<{_REACHED}}  ")
    if one.silence > SILENT:
        text.append(f"last heard {duration_text(one.silence)} ago  ", style=UNSURE)
    return text.append_text(worst_text(seen.margin, seen.unit, seen.oracle))
