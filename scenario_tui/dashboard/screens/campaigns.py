"""The first screen: all campaigns, the newest first, and details of the one under the cursor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Final

from rich.text import Text
from textual import on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.widgets import DataTable, OptionList

from grammars.text.words import NOTHING
from scenario_tui.dashboard.screens.filtering import FilteredScreen
from scenario_tui.dashboard.screens.steering import SteeringScreen, schedule_marks, steering_keys
from scenario_tui.dashboard.state import CAMPAIGNS_SHOWN, DashboardState
from scenario_tui.dashboard.widgets.running_grid import RunningGrid, running_page, running_runs
from scenario_tui.dashboard.widgets.static_text import StaticText, show_message_or
from scenario_tui.dashboard.widgets.tables import Column, KeyedTable, Row
from scenario_tui.text.campaign_text import (
    campaign_text,
    fail_style,
    judged_lines,
    judged_text,
    margin_marks,
    outcome_bar,
    progress_text,
    searched_text,
    when_text,
)
from scenario_tui.text.styles import KNOWN, QUIET, SEVERITY

if TYPE_CHECKING:
    from daemon.analysis.results import CampaignResults
    from daemon.model.search_answer import SearchRow
    from daemon.model.status import CampaignRow, RunPage
    from daemon.model.verbs import DaemonClient
    from scenario_tui.text.results import Conclusion

_PROGRESS, _OUTCOMES, _MARGINS = 12, 10, 16
"""Cells of the columns with bars."""
_COLUMNS: Final = (
    Column("campaign", 0),
    Column("judged", 17),
    Column("done", _PROGRESS, right=True),
    Column("outcomes", _OUTCOMES, from_width=60),
    Column("✗ fail", 6, right=True, from_width=90),
    Column("known", 6, right=True, from_width=90),
    Column("worst margins", _MARGINS, from_width=100),
    Column("submitted", 11, right=True, from_width=50),
)
_KEYS: Final[dict[str, Callable[[CampaignRow], Any]]] = {
    "submitted": lambda row: row.submitted_at,
    "campaign": lambda row: row.name,
    "done": lambda row: row.ended / max(row.total, 1),
    "✗ fail": lambda row: row.failed,
}
_NOTHING: Final = (
    "No campaigns yet. {submit} in another terminal\n\n"
    "    scenario new my-tests\n"
    "    {line}\n\n"
    "or, to see a short one without the daemon,\n\n"
    "    scenario demo"
)
_LAUNCHING: Final = "No daemon answers here yet: starting one on this machine."
_NOBODY: Final = (
    "No daemon answers here. {launch}In another terminal, type\n\n"
    "    {line}\n\n"
    "This screen notices when the daemon answers."
)
_OTHERS: Final = (
    "The daemon answers, but this dashboard does not understand it. Both must have the same\n"
    "version: compare\n\n"
    "    scenario --version\n\n"
    "on both machines. After an update, start the daemon again: scenario daemon --stop"
)


class CampaignsScreen(FilteredScreen["RunPage"], SteeringScreen["RunPage"]):
    """All campaigns in a table, with details of the one under the cursor."""

    SORTS: ClassVar = {
        "submitted": True, "campaign": False, "judged": False, "done": False, "✗ fail": True,
    }  # fmt: skip
    BINDINGS: ClassVar[list[BindingType]] = [
        # Hidden, because it only clears the filter, whose line mentions it.
        Binding("escape", "back", "Back", show=False, id="back", tooltip="Clear the filter"),
        Binding("s", "app.submit", "Submit", id="submit",
                tooltip="Choose, check, submit a campaign"),
        Binding("m", "matrix", "Matrix", id="matrix", tooltip="Verdicts cell by cell"),
        *steering_keys("acknowledge"),
        Binding("tab,v", "part", "Running", show=False, id="view",
                tooltip="To the running runs, and back to the table"),
    ]  # fmt: skip

    def __init__(self) -> None:
        super().__init__()
        self._cells_by_row: dict[str, tuple[tuple[object, ...], Row]] = {}
        self._sources: tuple[object, ...] = ()
        self._rows: list[Row] = []
        self._minute = 0.0

    def body(self) -> ComposeResult:
        """Lay out the table with the running runs below it, and details beside them."""
        yield self.filter_line()
        yield StaticText(id="empty")
        with Horizontal(id="split"):
            with Vertical(id="list"):
                yield KeyedTable(_COLUMNS, id="campaigns")
                yield RunningGrid(id="running")
            yield CampaignPanel(id="side")

    def fetch(self, daemon: DaemonClient, state: DashboardState) -> RunPage:
        """Return the running runs of all campaigns."""
        return running_page(daemon, state)

    def trail(self) -> str:
        """Return the number of campaigns, and unusual facts about the start of runs."""
        state = self.dashboard.state
        count = state.overview.campaigns if state.overview else len(state.campaigns)
        more = f", the newest {CAMPAIGNS_SHOWN} shown" if count > CAMPAIGNS_SHOWN else ""
        parts = [f"campaigns ({count}{more})"]
        if self.arrangement.text:
            parts.append(f"/{self.arrangement.text}  {self.key('back')} clears it")
        return "  ".join((*parts, *schedule_marks(self.campaign())))

    def campaign(self) -> CampaignRow | None:
        """Return the campaign under the cursor."""
        return self.dashboard.state.campaign(self.query_one(KeyedTable).key)

    def show(self, state: DashboardState, news: RunPage | None) -> None:
        """Fill the table."""
        # Ages are drawn once a minute, because one of many changes all the time.
        self._minute = self.dashboard.clock() // 60.0 * 60.0
        table = self.query_one(KeyedTable)
        sources = (
            state.campaigns, state.conclusions, state.searches, self._minute, self.arrangement,
        )  # fmt: skip
        if sources != self._sources:
            self._sources = sources
            cells = [(row, self._cells(row, state)) for row in state.campaigns[:CAMPAIGNS_SHOWN]]
            self._cells_by_row = {row.id: self._cells_by_row[row.id] for row, _ in cells}
            self._rows = self.arrangement.apply(cells, {**_KEYS, "judged": self._severity})
        rows = self._rows
        message = "" if rows else self.no_match() if state.campaigns else self._nothing(state)
        show_message_or(self.query_one("#empty"), self.query_one("#split"), message)
        if self.dashboard.submitted_campaign in (key for key, _ in rows):
            table.begin_at(self.dashboard.submitted_campaign)
            self.dashboard.submitted_campaign = ""
        table.fill(rows)
        # A table that was hidden without campaigns could not get the focus.
        if not table.has_focus and table.display and self.focused is None:
            table.focus()
        self._describe()
        if news is not None:
            self._show_running(state, news)

    def _cells(self, row: CampaignRow, state: DashboardState) -> Row:
        """Return the cells of a campaign, from the cache unless it has changed."""
        # All cells of 300 campaigns take 30 ms, for which every key would wait.
        conclusion, search = state.conclusions.get(row.id), state.searches.get(row.id)
        source = (row, conclusion, search, when_text(row, self._minute))
        cached = self._cells_by_row.get(row.id)
        if cached is None or cached[0] != source:
            cached = self._cells_by_row[row.id] = (source, campaign_cells(*source))
        return cached[1]

    def _severity(self, row: CampaignRow) -> int:
        """Return the rank of a campaign by the severity of its conclusion."""
        conclusion = self.dashboard.state.conclusions.get(row.id)
        return SEVERITY.index(conclusion.word) if conclusion else len(SEVERITY)

    def _show_running(self, state: DashboardState, page: RunPage) -> None:
        """Show the running runs below the campaigns, where most of the screen is empty."""
        campaigns = {row.id: row for row in state.campaigns}
        runs = running_runs(page.rows, self.dashboard.tracks, campaigns)
        grid = self.query_one(RunningGrid)
        grid.show(runs, more=any(row.queued and not row.paused for row in state.campaigns))
        if not grid.display and grid.has_focus:
            self.query_one(KeyedTable).focus(scroll_visible=False)

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        """Open a running run."""
        self.dashboard.open("run", event.option_id or "")

    def action_part(self) -> None:
        """Move the focus to the running runs, or back to the table."""
        grid, table = self.query_one(RunningGrid), self.query_one(KeyedTable)
        # At once, because the next key may wait already, for the new focus.
        there = grid.display and self.focused is not grid
        self.set_focus(grid if there else table, scroll_visible=False)

    def _nothing(self, state: DashboardState) -> str:
        target = self.dashboard.target
        if state.connected:
            line = target.command("submit", "my-tests/campaign.yaml")
            key = self.key("submit")
            return _NOTHING.format(
                submit=f"{key} chooses one, or type" if key else "Type", line=line
            )
        if state.refused:
            return f"{state.problem}\n\n{_OTHERS}"
        if self.dashboard.launching and state.problem:
            return _LAUNCHING
        # A daemon starts by its state directory, never at an address.
        line = replace(target, connect="").command("daemon")
        launch = f"{self.key('launch')} starts one. " if self.key("launch") else ""
        return _NOBODY.format(launch=launch, line=line) if state.problem else ""

    def on_resize(self) -> None:
        """Describe the campaign under the cursor as soon as there is room for it."""
        self.call_after_refresh(self._describe)

    @on(DataTable.RowHighlighted)
    def _describe(self) -> None:
        """Describe the campaign under the cursor, and judge it next."""
        row, panel = self.campaign(), self.query_one(CampaignPanel)
        front = row.id if row is not None and panel.display else ""
        if front != self.about:
            self.about = front
            self.dashboard.feed.look_at(self)
        if row is not None and front:
            panel.show(row, self.dashboard.state, self._minute)

    def on_data_table_row_selected(self) -> None:
        """Open the campaign's runs, or its search."""
        self.dashboard.open_campaign(self.query_one(KeyedTable).key)


class CampaignPanel(VerticalScroll, can_focus=False):
    """The campaign under the cursor: its matrix, last failures and history."""

    BORDER_TITLE = "campaign "

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id)
        self._judged: tuple[CampaignResults, int, Text] | None = None

    def compose(self) -> ComposeResult:
        """Lay out the text."""
        yield StaticText(id="about")

    def show(self, row: CampaignRow, state: DashboardState, now: float) -> None:
        """Show a campaign."""
        text = campaign_text(
            row,
            state.conclusions.get(row.id),
            state.campaigns,
            now,
            self._judged_lines(state.results.get(row.id)),
            search=state.searches.get(row.id),
            marks=schedule_marks(row),
        )
        self.query_one(StaticText).update(text)

    def _judged_lines(self, results: CampaignResults | None) -> Text:
        """Return the judged lines of a campaign, the same ones for the same results."""
        width = self.scrollable_content_region.width
        if results is None:
            return Text()
        # By identity: results are replaced and never changed, and a comparison costs more.
        if self._judged is None or self._judged[0] is not results or self._judged[1] != width:
            self._judged = results, width, judged_lines(results, width)
        return self._judged[2]


def campaign_cells(
    row: CampaignRow, conclusion: Conclusion | None, search: SearchRow | None, when: Text
) -> Row:
    """Return a campaign as a row of the table; without a ``conclusion`` it is not judged yet.

    A ``search`` shows its phase or its end, and the smallest margin that it has found.
    """
    total = row.total if search is None else max(row.total, search.task.runs)
    fail, expected = fail_style(row, conclusion), conclusion.known if conclusion else 0
    return row.id, (
        Text(row.id, style=QUIET if row.acknowledged else "bold"),
        judged_text(row, conclusion) if search is None else searched_text(row, search),
        progress_text(row, total, _PROGRESS),
        outcome_bar(row, _OUTCOMES, fail),
        Text(f"{row.failed:,}", fail) if row.failed else Text(NOTHING, QUIET),
        Text(f"{expected:,}", KNOWN) if expected else Text(NOTHING, QUIET),
        margin_marks(conclusion, _MARGINS),
        when,
    )
