"""A search while it runs and afterwards: margins over runs, findings, maps, parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Final

from rich.text import Text
from textual import on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Container, Vertical, VerticalScroll
from textual.widgets import DataTable, Static

from daemon.model.trials import smallest_margin
from daemon.model.verbs import DaemonClient
from daemon.search.answers.sentences import margin_words, phase_words, search_word
from grammars.text.words import NOTHING, count_noun
from scenario_tui.dashboard.run_watch import RunNews
from scenario_tui.dashboard.screens.parts import Parts
from scenario_tui.dashboard.screens.playing import MapActions
from scenario_tui.dashboard.screens.run_panel import RunMap
from scenario_tui.dashboard.screens.steering import SteeringScreen, schedule_marks
from scenario_tui.dashboard.searches import NotableTrial, SearchTrials, TrialReader, notable_trials
from scenario_tui.dashboard.state import DashboardState
from scenario_tui.dashboard.widgets.search_curve import LEGEND, SearchCurveView
from scenario_tui.dashboard.widgets.static_text import StaticText, show_message_or
from scenario_tui.dashboard.widgets.tables import Column, KeyedTable, Row
from scenario_tui.text.formatting import margin
from scenario_tui.text.search_text import answer_lines, parameters_text
from scenario_tui.text.styles import GLYPHS, QUIET

_COLUMNS: Final = (
    Column("what to look at", 15),
    Column("margin", 11, right=True),
    Column("decided by", 0),
    Column("run", 6, right=True),
)


@dataclass(frozen=True, slots=True)
class SearchNews:
    """A search with its trials, and its run in front if that is in view."""

    search: SearchTrials
    run: RunNews | None


class SearchScreen(SteeringScreen[SearchNews], MapActions, Parts):
    """A search by its id; one of its runs is in front: its parameters, its map, its replay."""

    VIEWS: ClassVar = ("found", "values", "answer", "map", "curve")
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("enter", "open", "Open", id="open",
                tooltip="The run in front, at its decisive moment"),
        Binding("n", "found(1)", "Next", id="next-found",
                tooltip="The next of best, first, nearest, findings, as written"),
        Binding("N", "found(-1)", "Before", show=False, id="previous-found",
                tooltip="The one before"),
        Binding("x", "rerun", "Rerun", id="rerun",
                tooltip="Copy the command that executes the run in front again"),
        Binding("a", "runs", "All runs", id="all-runs", tooltip="Every run of the search"),
    ]  # fmt: skip

    def __init__(self, campaign: str) -> None:
        super().__init__()
        self.about = campaign
        self._search: SearchTrials | None = None
        self._notable: tuple[NotableTrial, ...] = ()
        self._reader = TrialReader()
        self._front_run = ""

    def body(self) -> ComposeResult:
        """Lay out curve and table on the left; parameters and map on the right, or below."""
        yield StaticText(id="now")
        yield StaticText(id="empty")
        with Container(id="searched"):
            with Vertical(id="course", classes="part in-found in-answer in-curve"):
                yield SearchCurveView(id="curve").add_class("part", "in-curve")
                yield StaticText(LEGEND, id="curve-legend").add_class("part", "in-curve")
                yield KeyedTable(_COLUMNS, id="notable").add_class("part", "in-found")
                answer = VerticalScroll(id="answer", classes="part in-answer")
                answer.border_title = "answer "
                with answer:
                    yield StaticText(id="answer-text")
            with Vertical(id="point", classes="part in-values in-map"):
                with VerticalScroll(id="parameters", classes="part in-values"):
                    yield StaticText(id="parameters-text")
                yield RunMap().add_class("part", "in-map")

    def on_resize(self) -> None:
        """Lay out lines and parameters for the new size."""
        self.call_after_refresh(self.update_from_state)

    def view_changed(self) -> None:
        """Bring the new part up to date."""
        self.update_from_state()

    def fetch(self, daemon: DaemonClient, state: DashboardState) -> SearchNews | None:
        """Return the search with its trials, and the run in front if its map is in view."""
        row, run = state.searches.get(self.about), self._front_run
        if row is None:
            return None
        search = self._reader.read(daemon, row)
        return SearchNews(search, self.dashboard.feed.watch.look(daemon, run) if run else None)

    def _want_run(self) -> None:
        """Fetch the run in front, if its map is in view."""
        is_in_view = self.has_class("-wide") or self.part == "map"
        front = self._front()
        run = front.trial.run if front is not None and is_in_view else ""
        if run != self._front_run:
            self._front_run = run
            self.ask()

    def command(self) -> str:
        """Return the command that shows the search."""
        return self._line("search", self.about)

    def cursor_command(self) -> str:
        """Return the command about the run in front."""
        front = self._front()
        return self.command() if front is None else self._line("show", front.trial.run)

    def trail(self) -> str:
        """Return the campaign, its question and its phase."""
        parts = [f"campaigns › {self.about} › search"]
        row = self.dashboard.state.searches.get(self.about)
        if row is not None:
            parts.append(f"{row.task.minimise} of {row.task.scenario}  {phase_words(row)}")
        return "  ".join((*parts, *schedule_marks(self.campaign())))

    def show(self, state: DashboardState, news: SearchNews | None) -> None:
        """Show the search once its trials are fetched."""
        message = "" if news is not None else self._nothing(state)
        show_message_or(self.query_one("#empty"), self.query_one("#searched"), message)
        if news is None:
            return
        if news.search is not self._search:
            self._search = news.search
            self._notable = tuple(notable_trials(news.search))
            table = self.query_one(KeyedTable)
            table.fill([_cells(one) for one in self._notable])
            if table.display and self.focused is None:
                table.focus()
            self.query_one(SearchCurveView).show(news.search)
            answer = Text("\n").join(answer_lines(news.search.row))
            self.query_one("#answer-text", Static).update(answer)
        self._say(news.search)
        self._show_front(news)
        self._want_run()

    def _nothing(self, state: DashboardState) -> str:
        if not state.connected:
            return ""
        row = self.campaign()
        return "This search does not exist any more." if row is None else "… reading its runs"

    def _front(self) -> NotableTrial | None:
        """Return the run in front."""
        if not self._notable:
            return None
        key = self.query_one(KeyedTable).key
        return next((one for one in self._notable if one.key == key), None)

    def _say(self, search: SearchTrials) -> None:
        """Show the state of the search, and the part of the screen in view."""
        row, explored = search.row, search.explored
        word, failed = search_word(row), sum(one.fails for one in explored)
        settled = sum(one.outcome is not None for one in explored)
        line = Text.assemble((GLYPHS[word], word))
        line.append(f" {settled}/{row.task.runs} {row.phase}")
        line.append(f"  {failed} fail", style="fail" if failed else QUIET)
        best = smallest_margin(explored)
        if best is not None and best.value is not None:
            line.append(f"  best {margin(best.value.margin, best.value.unit)}")
        after = len(search.trials) - len(explored)
        line.append(f"  and {count_noun(after, 'run')} after" if after else "", style=QUIET)
        self.query_one("#now", Static).update(self.with_tabs(line))

    def _show_front(self, news: SearchNews) -> None:
        """Show the parameters of the run in front, and the run from above."""
        front, above = self._front(), self.query_one(RunMap)
        if front is None:
            above.show_run(self.dashboard, None)
            above.explain("No run has a result yet.")
            return
        run = news.run
        is_front = run is not None and run.detail.row.id == front.trial.run
        value = front.trial.value
        above.show_run(self.dashboard, run if is_front else None, value.oracle if value else "")
        width = (self.query_one("#parameters").size.width or self.size.width) - 2
        text = Text.assemble((front.what, "bold"), f"  {front.trial.label}\n", overflow="ellipsis")
        text.append(parameters_text(news.search.row.task, front.trial.point, width))
        self.query_one("#parameters-text", Static).update(text)

    def on_data_table_row_highlighted(self) -> None:
        """Show the run under the cursor."""
        self.update_from_state()

    def why_not(self, action: str, *parameters: object) -> str:
        """Return why an action is impossible now, empty if it is possible."""
        if action in ("open", "rerun", "found") and self._front() is None:
            return "No run of this search has a result yet."
        return super().why_not(action, *parameters)

    @on(DataTable.RowSelected)
    def action_open(self) -> None:
        """Open the run in front."""
        if (front := self._front()) is not None:
            self.dashboard.open("run", front.trial.run)

    def action_rerun(self) -> None:
        """Copy the command that executes the run in front again."""
        if (front := self._front()) is not None:
            self.dashboard.copy(self._line("verify", front.trial.run))

    def action_found(self, step: int) -> None:
        """Go to the next run of the table, or the one before."""
        table = self.query_one(KeyedTable)
        table.move_cursor(row=(table.cursor_row + step) % len(self._notable), animate=False)


def _cells(one: NotableTrial) -> Row:
    """Return a run to look at as a row of the table."""
    words = margin_words(one.trial, signed=True)
    word = "fail" if one.trial.fails else "pass"
    return one.key, (
        Text(f"{one.what} ×{one.count:,}" if one.count else one.what),
        Text(words or NOTHING, style=word if words else QUIET),
        Text(one.about),
        Text(f"{one.trial.number:,}", style=QUIET),
    )
