"""The runs of a campaign, or of all, by pages; beside them the run under the cursor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Final

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.widgets import Input

from daemon.model.messages import RunQuery
from daemon.model.status import CampaignRow, RunPage, RunRow
from daemon.model.verbs import DaemonClient
from daemon.model.verdicts import RunState
from grammars.text.words import duration_text
from scenario_tui.dashboard.run_watch import RunNews, Track
from scenario_tui.dashboard.screens.filtering import FilteredScreen
from scenario_tui.dashboard.screens.run_panel import RunPanel, expectations_of
from scenario_tui.dashboard.screens.steering import SteeringScreen, schedule_marks, steering_keys
from scenario_tui.dashboard.state import DashboardState
from scenario_tui.dashboard.widgets.static_text import StaticText, show_message_or
from scenario_tui.dashboard.widgets.tables import Column, KeyedTable, Row
from scenario_tui.text.formatting import margin, time_text
from scenario_tui.text.run_text import marked_word, reached_text
from scenario_tui.text.styles import QUIET, SEVERITY

if TYPE_CHECKING:
    from daemon.judging.assessment import Expectations
    from scenario_tui.text.results import Conclusion

PAGE: Final = 100
"""Runs per page; KeyedTable would be slow with the 100,000 of a large campaign."""
_SORTS: Final = {
    "run": "index", "verdict": "outcome", "margin": "margin", "decided by": "oracle",
    "progress": "simulated", "wall": "wall", "scenario": "scenario",
}  # fmt: skip
"""The daemon's names of orders by the titles of columns."""
_COLUMNS: Final = (
    Column("run", 0),
    Column("verdict", 16),
    Column("margin", 10, right=True),
    Column("decided by", 12),
    Column("progress", 13, right=True),
    Column("worker", 14, from_width=100),
    Column("wall", 11, right=True, from_width=120),
)
_CAMPAIGN: Final = (14, 24)
"""Least and most cells of the column of campaigns, if the table shows runs of all campaigns."""


@dataclass(frozen=True, slots=True)
class RunsNews:
    """A page of runs, and the run in front if it is in view.

    The page is the answer to ``query`` at the time of ``campaigns``.
    """

    query: RunQuery
    campaigns: tuple[CampaignRow, ...]
    page: RunPage
    run: RunNews | None


class RunsScreen(FilteredScreen[RunsNews], SteeringScreen[RunsNews]):
    """Runs in a table; wide terminals show the one under the cursor beside it."""

    SORTS: ClassVar = dict.fromkeys(_SORTS, False) | {"progress": True, "wall": True}
    BINDINGS: ClassVar[list[BindingType]] = [
        *steering_keys("retry"),
        Binding("m", "matrix", "Matrix", id="matrix", tooltip="Verdicts cell by cell"),
        Binding("C", "compare", "Compare", show=False, id="compare",
                tooltip="Mark a run, then another one, to see both side by side"),
    ]  # fmt: skip

    def __init__(self, campaign: str = "", scenario: str = "", sut: str = "") -> None:
        super().__init__()
        self.about, self._scenario, self._sut = campaign, scenario, sut
        # Runs of one campaign in the order of its file; runs of all, the newest first.
        self.arrangement = replace(self.arrangement, descending=not campaign)
        self._offset, self._front_run = 0, ""
        self._cache: tuple[RunPage | None, Mapping[str, Conclusion], list[Row]] = (None, {}, [])

    @property
    def _here(self) -> tuple[str, str, str]:
        return self.about, self._scenario, self._sut

    @property
    def _query(self) -> RunQuery:
        """The page of runs to show; a verdict or a state in the filter is not a text."""
        order, words = self.arrangement, self.arrangement.text.split()
        only = next((word for word in words if word in SEVERITY), "")
        return RunQuery(
            self.about,
            offset=self._offset,
            limit=PAGE,
            scenario=self._scenario,
            sut=self._sut,
            text=" ".join(word for word in words if word != only),
            sort=_SORTS[order.sort],
            descending=order.descending,
            state=only if only in tuple(RunState) else "",
            outcome=only if only not in tuple(RunState) else "",
        )

    def body(self) -> ComposeResult:
        """Lay out filter line, table, and the run beside it."""
        columns: tuple[Column, ...] = _COLUMNS
        if not self.about:
            least, most = _CAMPAIGN
            longest = max((len(row.id) for row in self.dashboard.state.campaigns), default=0)
            named = Column("campaign", min(max(longest, least), most))
            columns = (_COLUMNS[0], named, *_COLUMNS[1:])
        table = KeyedTable(columns, id="runs")
        if (view := self.dashboard.run_views.get(self._here)) is not None:
            self.arrangement, self._offset, key = view
            table.begin_at(key)
        yield self.filter_line()
        yield StaticText(id="empty")
        with Horizontal(id="split"):
            yield table
            yield RunPanel(id="side")

    def on_screen_resume(self) -> None:
        """Prepare to open a run, once the runs are shown."""
        self.call_after_refresh(self.dashboard.prepare_playback)

    def _remember(self, key: str = "") -> None:
        """Remember the view of these runs, with the run in front if there is one yet."""
        # At once, because the next screen reads it before this one leaves.
        self.dashboard.run_views[self._here] = (self.arrangement, self._offset, key)

    def fetch(self, daemon: DaemonClient, state: DashboardState) -> RunsNews:
        """Return the page; in wide terminals also the run under the cursor."""
        query, run, last = self._query, self._front_run, self.news
        # A move of the cursor keeps the page; a change replaces the campaigns.
        if last is not None and last.query == query and last.campaigns is state.campaigns:
            page = last.page
        else:
            page = daemon.runs(**asdict(query))
        front = self.dashboard.feed.watch.look(daemon, run) if run else None
        return RunsNews(query, state.campaigns, page, front)

    def _want_run(self) -> None:
        """Fetch the run under the cursor, if it is in view."""
        beside = self.query_one("#side").display and self.has_class("-wide")
        run = self.query_one(KeyedTable).key if beside else ""
        if run != self._front_run:
            self._front_run = run
            self.dashboard.feed.look_at(self)

    def trail(self) -> str:
        """Return the place, the page, its order and its filters."""
        order, page = self.arrangement, self._page()
        parts = [f"campaigns › {self.about}" if self.about else "all runs"]
        if self._scenario:
            parts[0] += f" › {self._scenario}/{self._sut}"
        if page is not None:
            first = self._offset + 1 if page.rows else 0
            parts.append(f"{first}-{self._offset + len(page.rows)} of {page.total}")
        if order.sort != "run":
            parts.append(f"by {order.sort} {'▼' if order.descending else '▲'}")
        if order.text:
            parts.append(f"/{order.text}")
        if self.dashboard.marked_run:
            parts.append(f"{self.dashboard.marked_run} marked")
        return "  ".join((*parts, *(schedule_marks(self.campaign()) if self.about else ())))

    def command(self) -> str:
        """Return the command for the runs of the campaign, with the same filter if possible."""
        row, query = self.campaign(), self._query
        if row is None or not self.about:
            return self.dashboard.target.command("status")
        narrowed = [("--outcome", query.outcome), ("--filter", query.text)]
        options = [word for option in narrowed if option[1] for word in option]
        return self.dashboard.target.command("results", row.id, *(options or ["--runs"]))

    def cursor_command(self) -> str:
        """Return the command about the run under the cursor."""
        run = self.query_one(KeyedTable).key
        return self._line("show", run) if run else self.command()

    def campaign(self) -> CampaignRow | None:
        """Return the campaign of the screen, or that of the run under the cursor."""
        campaign = self.about or self.query_one(KeyedTable).key.rpartition(".")[0]
        return self.dashboard.state.campaign(campaign)

    def _page(self) -> RunPage | None:
        news = self.news
        return news.page if news is not None and news.query == self._query else None

    def show(self, state: DashboardState, news: RunsNews | None) -> None:
        """Fill the table with the page, once it answers the present query."""
        page = self._page()
        if news is None or page is None:
            return
        message = "" if page.rows else self._nothing()
        show_message_or(self.query_one("#empty"), self.query_one("#split"), message)
        table = self.query_one(KeyedTable)
        self.dashboard.tracks.forget_ended(page.rows)
        table.fill(self._rows(state, page))
        # A hidden table has lost the focus. Set it now, not later as focus() does, when the user
        # may be in the filter line.
        if not message and not isinstance(self.focused, Input):
            self.set_focus(table, scroll_visible=False)
        # New rows may have another run under the cursor.
        self._want_run()
        run = news.run if news.run is not None and news.run.detail.row.id == table.key else None
        # The run before stays until the answer comes, a moment later.
        if self.has_class("-wide") and (run or news.run is None or not state.connected):
            self.query_one(RunPanel).show(self.dashboard, run)

    def _rows(self, state: DashboardState, page: RunPage) -> list[Row]:
        """Return the page as rows of the table, from the cache unless they may have changed."""
        last, conclusions, rows = self._cache
        runs = any(row.state is RunState.RUNNING for row in page.rows)
        if runs or page is not last or conclusions is not state.conclusions:
            rows = [self._cells(state, row) for row in page.rows]
            self._cache = (page, state.conclusions, rows)
        return rows

    def _cells(self, state: DashboardState, row: RunRow) -> Row:
        track, expectations = self.dashboard.tracks.get(row.id), expectations_of(state, row)
        key, cells = run_cells(row, track, expectations)
        named = (cells[0], Text(row.campaign, style=QUIET), *cells[1:])
        return key, cells if self.about else named

    def _nothing(self) -> str:
        if self.arrangement.text:
            return self.no_match()
        key = self.key("submit")
        return f"No runs yet. {key} chooses a campaign" if key else "No runs yet."

    def on_data_table_row_highlighted(self) -> None:
        """Fetch the run under the cursor."""
        key = self.query_one(KeyedTable).key
        # A screen that the user has left may still get events of its rows.
        if key and self.is_current:
            self._remember(key)
        self._want_run()

    def on_data_table_row_selected(self) -> None:
        """Open the run."""
        self.dashboard.open("run", self.query_one(KeyedTable).key)

    def rearranged(self) -> None:
        """Show the first page in the new arrangement."""
        self._turn_to(0)

    def _turn_to(self, offset: int) -> None:
        """Show the page that begins with this run."""
        self._offset = offset
        self._remember()
        self.query_one(KeyedTable).begin_at(0)
        self.ask()

    def action_compare(self) -> None:
        """Mark the run under the cursor, or compare it with the marked one."""
        from scenario_tui.dashboard.screens.compare import mark_or_compare

        run = self.query_one(KeyedTable).key
        if run:
            mark_or_compare(self.dashboard, run)

    def on_keyed_table_beyond(self, event: KeyedTable.Beyond) -> None:
        """Turn to the next page or the one before, or to the last or first one."""
        page = self._page()
        if page is None or not page.total:
            return
        last = (page.total - 1) // PAGE * PAGE
        offset = self._offset + event.step * PAGE
        if event.far:
            offset = last if event.step > 0 else 0
        if not 0 <= offset <= last or offset == self._offset:
            return
        self._turn_to(offset)
        # On the page before, and on the last page, the cursor starts at the bottom.
        if (event.step > 0) == event.far:
            self.query_one(KeyedTable).begin_at(-1)


def run_cells(row: RunRow, track: Track | None, expectations: Expectations | None) -> Row:
    """Return a run as a row of the table, marked by ``expectations``."""
    progress = time_text(row.simulated) if row.outcome is not None else ""
    if row.state is RunState.RUNNING:
        snapshot = track.snapshot if track is not None else None
        # The start of a stack does not fit into this column, but stands in the panel.
        progress = reached_text(None if snapshot and snapshot.waiting else snapshot, limit=False)
        if snapshot is not None:
            # Its least margin so far with its oracle, as if it decided.
            row = replace(row, oracle=snapshot.oracle, margin=snapshot.margin, unit=snapshot.unit)
    return row.id, (
        Text(row.label, style="bold"),
        marked_word(row, expectations),
        Text(margin(row.margin, row.unit) if row.oracle else ""),
        Text(row.oracle),
        Text(progress),
        Text(row.worker, style=QUIET),
        Text(duration_text(row.wall) if row.outcome is not None else "", style=QUIET),
    )
