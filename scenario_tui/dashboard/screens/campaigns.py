"""The first screen: all campaigns, the newest first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Final

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, VerticalScroll
from textual.widgets import Static

from grammars.text.words import NOTHING, count_noun, duration_text
from scenario_tui.dashboard.screens.base import show_message_or
from scenario_tui.dashboard.screens.filtering import FilteredScreen
from scenario_tui.dashboard.screens.steering import SteeringScreen, priority_text, schedule_marks
from scenario_tui.dashboard.state import CAMPAIGNS_SHOWN, Known
from scenario_tui.dashboard.widgets.running_grid import (
    RunningGrid,
    more_to_come,
    running_page,
    running_runs,
)
from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.dashboard.widgets.tables import Column, KeyedTable, Row
from scenario_tui.text.formatting import (
    DASHBOARD_STYLES,
    GLYPHS,
    QUIET,
    SEVERITY,
    UNSURE,
    age_text,
    brief_duration,
    margin,
    run_counts,
)
from scenario_tui.text.results import NONE_JUDGED, Conclusion

if TYPE_CHECKING:
    from daemon.model.search_answer import SearchRow
    from daemon.model.status import CampaignRow, RunPage
    from daemon.model.verbs import DaemonClient

_COLUMNS: Final = (
    Column("campaign", 0),
    Column("judged", 24),
    Column("done", 7, right=True),
    Column("✗ fail", 6, right=True),
    Column("‼ err", 5, from_width=100, right=True),
    Column("! lost", 6, from_width=90, right=True),
    Column("? incon", 7, from_width=100, right=True),
    Column("✓ pass", 6, from_width=90, right=True),
    Column("submitted", 10, right=True),
)
_KEYS: Final[dict[str, Callable[[CampaignRow], Any]]] = {
    "submitted": lambda row: row.submitted_at,
    "campaign": lambda row: row.name,
    "done": lambda row: row.ended / max(row.total, 1),
    "✗ fail": lambda row: row.failed,
}
_SEARCHED: Final = {"fail": "found", "pass": "none", "cancelled": "ended", "queued": "waiting"}
"""What became of a search that is over, shortly."""
_COUNTED: Final = ("fail", "error", "lost", "inconclusive", "pass")
_NOTHING: Final = (
    "No campaigns yet. {submit} chooses one, or type in another terminal\n\n"
    "    scenario new my-tests\n"
    "    {line}\n\n"
    "or, to see a short one without the daemon,\n\n"
    "    scenario demo"
)
_LAUNCHING: Final = "No daemon answers here yet: starting one on this machine."
_NOBODY: Final = (
    "No daemon answers here. In another terminal, type\n\n"
    "    {line}\n\n"
    "This screen notices when it is there."
)
_OTHERS: Final = (
    "Somebody answers, but nothing that is understood here. A daemon and its dashboards are of\n"
    "one version: compare\n\n"
    "    scenario --version\n\n"
    "on both machines. After an update the daemon must be started again: scenario daemon --stop"
)


class CampaignsScreen(FilteredScreen["RunPage"], SteeringScreen["RunPage"]):
    """All campaigns; wide terminals show the one under the cursor beside the table."""

    IN_FOOTER = ("open", "matrix", "submit", "pause", "cancel", "retry", "palette", "help", "quit")
    SORTS: ClassVar = {
        "submitted": True, "campaign": False, "judged": False, "done": False, "✗ fail": True,
    }  # fmt: skip
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("m", "matrix", "Matrix", id="matrix", tooltip="The campaign judged, cell by cell"),
        Binding("tab,v", "part", "Under way", show=False, id="view",
                tooltip="To the runs under way, and back to the table"),
    ]  # fmt: skip

    def body(self) -> ComposeResult:
        """Table, and details beside it."""
        yield self.filter_line()
        yield StaticText(id="empty")
        with Horizontal(id="split"):
            yield KeyedTable(_COLUMNS, id="campaigns")
            side = VerticalScroll(id="side", can_focus=False)
            side.border_title = "campaign "
            with side:
                yield StaticText(id="about")
        yield RunningGrid(id="running")

    def fetch(self, daemon: DaemonClient, known: Known) -> RunPage:
        """Return the runs under way of all campaigns."""
        return running_page(daemon, known)

    def trail(self) -> str:
        """Say how many campaigns there are."""
        known = self.dashboard.known
        count = known.overview.campaigns if known.overview else len(known.campaigns)
        more = f", the newest {CAMPAIGNS_SHOWN} shown" if count > CAMPAIGNS_SHOWN else ""
        return f"campaigns ({count}{more})"

    def campaign(self) -> CampaignRow | None:
        """Return the campaign under the cursor."""
        return self.dashboard.known.campaign(self.query_one(KeyedTable).key)

    def show(self, known: Known, news: RunPage | None) -> None:
        """Fill the table."""
        now = self.dashboard.clock()
        table = self.query_one(KeyedTable)
        said, found = known.conclusions, known.searches
        cells = [
            (row, campaign_cells(row, said.get(row.id), now, found.get(row.id)))
            for row in known.campaigns[:CAMPAIGNS_SHOWN]
        ]
        rows = self.arrangement.apply(cells, {**_KEYS, "judged": self._severity})
        message = "" if rows else self.no_match() if cells else self._nothing(known)
        show_message_or(self.query_one("#empty"), self.query_one("#split"), message)
        if self.dashboard.submitted_campaign in (key for key, _ in rows):
            table.begin_at(self.dashboard.submitted_campaign)
            self.dashboard.submitted_campaign = ""
        table.fill(rows)
        # A table that was hidden, because there was no campaign, could not take the keys.
        if not table.has_focus and table.display and self.focused is None:
            table.focus()
        self._describe()
        if news is not None:
            self._show_running(known, news)

    def rearranged(self) -> None:
        """Show the campaigns as they are arranged now."""
        self.update_from_state()

    def _severity(self, row: CampaignRow) -> int:
        """Return how soon a campaign must be looked at."""
        conclusion = self.dashboard.known.conclusions.get(row.id)
        return SEVERITY.index(conclusion.word) if conclusion else len(SEVERITY)

    def _show_running(self, known: Known, page: RunPage) -> None:
        """Show what is under way below the campaigns, which leave most of the screen empty."""
        campaigns = {row.id: row for row in known.campaigns}
        runs = running_runs(page.rows, self.dashboard.tracks, campaigns)
        grid = self.query_one(RunningGrid)
        grid.show(runs, more=more_to_come(known.campaigns))
        if not grid.display and grid.has_focus:
            self.query_one(KeyedTable).focus(scroll_visible=False)

    def on_running_grid_opened(self, event: RunningGrid.Opened) -> None:
        """Open a run under way."""
        self.dashboard.open("run", event.run)

    def action_part(self) -> None:
        """Give the keys to the runs under way, or back to the table."""
        grid, table = self.query_one(RunningGrid), self.query_one(KeyedTable)
        # At once: the next key may wait already, and is not for who had the keys before.
        there = grid.display and self.focused is not grid
        self.set_focus(grid if there else table, scroll_visible=False)

    def _nothing(self, known: Known) -> str:
        lines = self.dashboard.command_lines
        if known.connected:
            line = lines.daemon_line("submit", "my-tests/campaign.yaml")
            return _NOTHING.format(submit=self.key("submit"), line=line)
        if known.refused:
            return f"{known.problem}\n\n{_OTHERS}"
        if self.dashboard.launching and known.problem:
            return _LAUNCHING
        # A daemon is started where its state is, never at an address.
        line = replace(lines, connect="").daemon_line("daemon")
        return _NOBODY.format(line=line) if known.problem else ""

    def on_data_table_row_highlighted(self) -> None:
        """Describe the campaign the cursor came to."""
        self._describe()

    def _describe(self) -> None:
        row = self.campaign()
        if row is not None:
            known = self.dashboard.known
            said, found = known.conclusions.get(row.id), known.searches.get(row.id)
            text = campaign_text(row, said, self.dashboard.clock(), found)
            self.query_one("#about", Static).update(text)

    def on_data_table_row_selected(self) -> None:
        """Open the campaign's runs, or the search that it is."""
        self.dashboard.open_campaign(self.query_one(KeyedTable).key)


def campaign_cells(
    row: CampaignRow, said: Conclusion | None, now: float, search: SearchRow | None = None
) -> Row:
    """Return a campaign as a row of the table; ``said`` is ``None`` when it was not judged.

    Of a ``search`` it says what that does, or that it found a failure, and the smallest margin.
    """
    total = row.total if search is None else max(row.total, search.task.runs)
    counts = run_counts(row)
    said = _up_to_date(row, said)
    judged = _judged(row, said) if search is None else _searched(row, search)
    # Of a search the margin is worth more than the time, and both do not fit.
    if row.seconds_left is not None and not row.paused and search is None:
        judged.append(f"  {brief_duration(row.seconds_left)} left", style="not bold")
    if row.priority:
        judged.append(f"  {priority_text(row.priority)}", style="not bold")
    return row.id, (
        Text(row.id, style="bold"),
        judged,
        Text(f"{row.ended}/{total}"),
        *(_count(counts.get(word, 0), word) for word in _COUNTED),
        Text(age_text(row.submitted_at, now), style=QUIET),
    )


def _up_to_date(row: CampaignRow, said: Conclusion | None) -> Conclusion | None:
    """Return what is said of a campaign; its counts are newer than what was made of them."""
    if said is not None and said.text == NONE_JUDGED and row.done:
        return replace(said, text="running")
    return said


def _judged(row: CampaignRow, said: Conclusion | None) -> Text:
    # What is said of an unfinished campaign is not the last word; that nothing goes on is news.
    if row.paused and not row.finished:
        return Text("‖ paused", style=UNSURE)
    return (
        Text(said.glyph_text, style=DASHBOARD_STYLES[said.word])
        if said
        else Text(NOTHING, style=QUIET)
    )


def _searched(row: CampaignRow, search: SearchRow) -> Text:
    # The first screen is not to wait for what only a search needs.
    from daemon.search.answers.sentences import search_word

    if row.paused and not search.ended:
        return Text("‖ paused", style=UNSURE)
    word = search_word(search)
    if search.state == "running":
        said: str = search.phase
    else:
        said = f"{GLYPHS[word]} {_SEARCHED.get(word, word)}"
    best = search.answer.best if search.answer is not None else None
    least = f" {margin(best.value.margin, best.value.unit)}" if best and best.value else ""
    return Text(f"{said}{least}", style=DASHBOARD_STYLES[word])


def _count(number: int, word: str) -> Text:
    return (
        Text(f"{number:,}", style=DASHBOARD_STYLES[word]) if number else Text(NOTHING, style=QUIET)
    )


def campaign_text(
    row: CampaignRow, said: Conclusion | None, now: float, search: SearchRow | None = None
) -> Text:
    """Return a campaign in words, and what to type about it."""
    said = _up_to_date(row, said)
    text = Text.assemble((row.name, "bold"), "\n")
    if search is not None:
        from daemon.search.answers.sentences import search_word
        from scenario_tui.text.search_text import search_line

        text.append(f"search: {search_line(search)}\n", style=DASHBOARD_STYLES[search_word(search)])
    if said:
        text.append(f"{said.glyph_text}\n", style=DASHBOARD_STYLES[said.word])
    for mark in schedule_marks(row):
        text.append(f"{mark}\n", style=UNSURE)
    if row.about:
        text.append(f"{row.about}\n")
    text.append(f"\n{count_noun(row.total, 'run')}, submitted {age_text(row.submitted_at, now)}")
    if row.seconds_left is not None:
        text.append(f",\n{duration_text(row.seconds_left)} left")
    if row.finished_at is not None:
        text.append(f",\nfinished in {duration_text(row.finished_at - row.submitted_at)}")
    text.append("\n\n")
    for word, count in run_counts(row).items():
        text.append(f"{GLYPHS[word]} {word:<13}{count:>7,}\n", style=DASHBOARD_STYLES[word])
    if search is not None and search.answer is not None:
        text.append("".join(f"\n{sentence}" for sentence in search.answer.sentences))
        text.append("\n")
    text.append(f"\nscenario {'search' if row.search else 'results'} {row.id}\n", style=QUIET)
    return text
