"""The runs of a campaign, or of all, a page at a time; beside them the run under the cursor."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any, ClassVar, Final

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.widgets import Input

from daemon.model.messages import RunQuery
from daemon.model.run_state import RunState
from daemon.model.status import CampaignRow, RunPage, RunRow
from daemon.model.verbs import DaemonClient
from scenario_tui.dashboard.live_tracks import Track
from scenario_tui.dashboard.run_watch import RunNews
from scenario_tui.dashboard.screens.base import show_message_or
from scenario_tui.dashboard.screens.run_panel import RunPanel
from scenario_tui.dashboard.screens.steering import SteeringScreen, schedule_marks
from scenario_tui.dashboard.state import Known, RunsView
from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.dashboard.widgets.tables import Column, KeyedTable, Row
from scenario_tui.text.formatting import (
    glyph_word,
    margin,
    run_counts,
    run_label,
    run_word,
    time_text,
)
from scenario_tui.text.run_text import reached_text
from scenario_tui.text.styles import QUIET

PAGE: Final = 100
"""Runs asked for at a time, out of 100,000 in a large campaign: KeyedTable says why not all."""
SORTS: Final = ("index", "outcome", "margin", "oracle", "scenario", "wall", "simulated")
FILTERS: Final[tuple[tuple[str, dict[str, str]], ...]] = (
    ("all", {}),
    ("fail", {"outcome": "fail"}),
    ("inconclusive", {"outcome": "inconclusive"}),
    ("error", {"outcome": "error"}),
    ("lost", {"state": "lost"}),
    ("running", {"state": "running"}),
    ("queued", {"state": "queued"}),
    ("cancelled", {"state": "cancelled"}),
    ("pass", {"outcome": "pass"}),
)
_COLUMNS: Final = (
    Column("run", 0),
    Column("verdict", 14),
    Column("margin", 9, right=True),
    Column("decided by", 14),
    Column("progress", 13, right=True),
    Column("worker", 14, from_width=100),
)
_CAMPAIGN: Final = Column("campaign", 14)
"""Stands behind the run where runs of all campaigns are shown."""


@dataclass(frozen=True, slots=True)
class RunsNews:
    """The page of runs that was ``wanted``, and the run in front where it is seen."""

    wanted: RunQuery
    page: RunPage
    run: RunNews | None


class RunsScreen(SteeringScreen[RunsNews]):
    """Runs in a table; wide terminals show the one under the cursor beside it."""

    # More than twenty methods: thirteen are keys and messages, which Textual calls by name, and
    # change one field of the query; the daemon filters, sorts and pages.

    IN_FOOTER = (
        "open", "back", "filter", "only", "matrix", "retry", "palette", "help", "quit",
    )  # fmt: skip
    BINDINGS: ClassVar[list[BindingType]] = [
        # At once, or what is typed right behind it would still be taken for keys of the table.
        Binding("slash", "filter", "Filter", id="filter", priority=True,
                tooltip="Only runs that mention a text"),
        Binding("f", "only", "Only", id="only", tooltip="Of one verdict or state, the next one"),
        Binding("m", "matrix", "Matrix", id="matrix", tooltip="The campaign judged, cell by cell"),
        Binding("greater_than_sign", "sort(1)", "Sort", show=False, id="sort-next",
                tooltip="By the next column"),
        Binding("less_than_sign", "sort(-1)", "Sort back", show=False, id="sort-previous",
                tooltip="By the column before"),
        Binding("i", "reverse", "Invert", show=False, id="sort-invert",
                tooltip="Sort the other way round"),
        Binding("right_square_bracket", "page(1)", "Next page", show=False, id="next-page",
                tooltip="The runs after these"),
        Binding("left_square_bracket", "page(-1)", "Page before", show=False,
                id="previous-page", tooltip="The runs before these"),
        Binding("C", "compare", "Compare", show=False, id="compare",
                tooltip="Mark a run, then another one to see both side by side"),
    ]  # fmt: skip

    def __init__(self, campaign: str = "", scenario: str = "", sut: str = "") -> None:
        super().__init__()
        # Of one campaign in the order of its file; of all, what was submitted last is looked for.
        self._wanted = RunQuery(
            campaign, limit=PAGE, scenario=scenario, sut=sut, descending=not campaign
        )
        self._only = 0
        self._here = (campaign, scenario, sut)
        self._wanted_run = ""

    def body(self) -> ComposeResult:
        """Filter line, table, and the run beside it."""
        view = self.dashboard.run_views.get(self._here)
        if view is not None:
            self._wanted, self._only = view.wanted, view.only
        hint, text = "text in run, oracle or reason", self._wanted.text
        # With its text from the start: an empty line would tell that it changed, and be obeyed.
        yield Input(text, placeholder=hint, id="filter", compact=True)
        yield StaticText(id="empty")
        with Horizontal(id="split"):
            columns = (_COLUMNS[0], _CAMPAIGN, *_COLUMNS[1:])
            yield KeyedTable(_COLUMNS if self._wanted.campaign else columns, id="runs")
            side = Vertical(id="side")
            side.border_title = "run "
            with side:
                yield RunPanel(id="panel")

    def on_mount(self) -> None:
        """Start as these runs were looked at last, the first time without a filter."""
        line, view = self.query_one(Input), self.dashboard.run_views.get(self._here)
        if view is not None:
            self.query_one(KeyedTable).begin_at(view.key)
        line.display = bool(line.value)
        super().on_mount()

    def on_screen_resume(self) -> None:
        """Make ready for a run to be opened, once the runs are shown."""
        self.call_after_refresh(self.dashboard.prepare_playback)

    def _remember(self, key: str = "") -> None:
        """Remember how these runs are looked at, with the run in front if there is one yet."""
        # At once and not when the screen goes: what comes in its place asks before.
        self.dashboard.run_views[self._here] = RunsView(self._wanted, self._only, key)

    @property
    def about(self) -> str:
        """The campaign shown, empty for all."""
        return self._wanted.campaign

    def fetch(self, daemon: DaemonClient, known: Known) -> RunsNews:
        """Return the page; in wide terminals also the run under the cursor."""
        wanted, run = self._wanted, self._wanted_run
        page = daemon.runs(**asdict(wanted))
        return RunsNews(wanted, page, self.dashboard.feed.watch.look(daemon, run) if run else None)

    def _want_run(self) -> None:
        """Ask for the run under the cursor, if it is seen."""
        beside = self.query_one("#side").display and self.has_class("-wide")
        wanted = self.query_one(KeyedTable).key if beside else ""
        if wanted != self._wanted_run:
            self._wanted_run = wanted
            self.ask()

    def trail(self) -> str:
        """Where we are, which page, sorted and filtered how."""
        wanted, page = self._wanted, self._page()
        parts = [f"campaigns › {wanted.campaign}" if wanted.campaign else "all runs"]
        if wanted.scenario:
            parts[0] += f" › {wanted.scenario}/{wanted.sut}"
        if page is not None:
            last = wanted.offset + len(page.rows)
            first = wanted.offset + 1 if page.rows else 0
            parts.append(f"{first}-{last} of {page.total}")
        parts.append(_order(wanted))
        if self._only:
            parts.append(f"only {FILTERS[self._only][0]}")
        if wanted.text:
            parts.append(f"/{wanted.text}")
        if self.dashboard.marked_run:
            parts.append(f"{self.dashboard.marked_run} marked")
        row = self.campaign() if wanted.campaign else None
        parts += schedule_marks(row) if row is not None else []
        return "  ".join(parts)

    def command(self) -> str:
        """Return what to type for the runs of the campaign, the same ones where that can be."""
        row, wanted = self.campaign(), self._wanted
        if row is None or not wanted.campaign:
            return self.dashboard.command_lines.daemon_line("status")
        narrowed = [("--outcome", wanted.outcome), ("--filter", wanted.text)]
        options = [word for option in narrowed if option[1] for word in option]
        return self.dashboard.command_lines.daemon_line("results", row.id, *(options or ["--runs"]))

    def cursor_command(self) -> str:
        """Return what to type about the run under the cursor."""
        run = self.query_one(KeyedTable).key
        return self._line("show", run) if run else self.command()

    def campaign(self) -> CampaignRow | None:
        """Return the campaign shown, or that of the run under the cursor."""
        wanted = self._wanted.campaign
        if not wanted:
            wanted = self.query_one(KeyedTable).key.rpartition(".")[0]
        return self.dashboard.known.campaign(wanted)

    def _page(self) -> RunPage | None:
        news = self.news
        return news.page if news is not None and news.wanted == self._wanted else None

    def show(self, known: Known, news: RunsNews | None) -> None:
        """Fill the table with the page, once it is the one wanted."""
        page = self._page()
        if news is None or page is None:
            return
        message = "" if page.rows else self._nothing()
        show_message_or(self.query_one("#empty"), self.query_one("#split"), message)
        table = self.query_one(KeyedTable)
        tracks = self.dashboard.tracks
        tracks.forget_ended(page.rows)
        named = not self._wanted.campaign
        table.fill([run_cells(row, tracks.get(row.id), named) for row in page.rows])
        # A table that was hidden because it was empty has lost the keys to its neighbour. Now, not
        # later as focus() does: then somebody may have gone to the filter line.
        if not message and not isinstance(self.focused, Input):
            self.set_focus(table, scroll_visible=False)
        # The cursor may be on another run now that the rows are others.
        self._want_run()
        run = news.run if news.run is not None and news.run.detail.row.id == table.key else None
        if self.has_class("-wide"):
            self.query_one(RunPanel).show(self.dashboard, run)

    def _nothing(self) -> str:
        if self._only or self._wanted.text:
            keys = (("filter", "change the text"), ("only", "show others"), ("back", "back"))
            ways = "      ".join(f"{self.key(id)}  {words}" for id, words in keys)
            return f"No run matches.\n\n    {ways}"
        return f"No runs yet. {self.key('submit')} chooses a campaign"

    def on_data_table_row_highlighted(self) -> None:
        """Ask for the run the cursor came to."""
        key = self.query_one(KeyedTable).key
        # A screen that was left may still hear of its rows.
        if key and self.is_current:
            self._remember(key)
        self._want_run()

    def on_data_table_row_selected(self) -> None:
        """Open the run."""
        self.dashboard.open("run", self.query_one(KeyedTable).key)

    def _change(self, **changes: Any) -> None:
        self._wanted = replace(self._wanted, **({"offset": 0} | changes))
        self._remember()
        self.query_one(KeyedTable).from_top()
        self.ask()

    def action_filter(self) -> None:
        """Open the filter line."""
        line = self.query_one(Input)
        line.display = True
        self.set_focus(line)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Let a slash be a slash in the filter line."""
        if action == "filter" and isinstance(self.focused, Input):
            return False
        return super().check_action(action, parameters)

    def on_input_changed(self, event: Input.Changed) -> None:
        """Filter while typing."""
        if event.value != self._wanted.text:
            self._change(text=event.value[:200])

    def on_input_submitted(self) -> None:
        """Go back to the table, the filter stays."""
        line = self.query_one(Input)
        line.display = bool(line.value)
        self.query_one(KeyedTable).focus()

    def action_back(self) -> None:
        """Leave the filter first, then the screen."""
        line = self.query_one(Input)
        if line.display:
            line.value = ""
            line.display = False
            self.query_one(KeyedTable).focus()
            return
        super().action_back()

    def action_only(self) -> None:
        """Show runs of the next verdict or state only that there are any of."""
        known, wanted = self.dashboard.known, self._wanted.campaign
        counted = known.campaign(wanted) if wanted else known.overview
        counts = run_counts(counted) if counted is not None else {}
        for _ in FILTERS:
            self._only = (self._only + 1) % len(FILTERS)
            if not self._only or not counts or FILTERS[self._only][0] in counts:
                break
        self._change(**({"state": "", "outcome": ""} | FILTERS[self._only][1]))

    def action_sort(self, step: int) -> None:
        """Sort by the next column, or the one before."""
        following = SORTS[(SORTS.index(self._wanted.sort) + step) % len(SORTS)]
        self._change(sort=following, descending=False)

    def action_compare(self) -> None:
        """Mark the run under the cursor, or compare it with the one that is marked."""
        from scenario_tui.dashboard.screens.compare import mark_or_compare

        run = self.query_one(KeyedTable).key
        if run:
            mark_or_compare(self.dashboard, run)

    def action_reverse(self) -> None:
        """Sort the other way round."""
        self._change(descending=not self._wanted.descending)

    def on_keyed_table_beyond(self, event: KeyedTable.Beyond) -> None:
        """Go on to the page behind, or to the very last one."""
        page = self._page()
        if page is None or not page.total:
            return
        last = (page.total - 1) // PAGE * PAGE
        offset = self._wanted.offset + event.step * PAGE
        if event.far:
            offset = last if event.step > 0 else 0
        if not 0 <= offset <= last or offset == self._wanted.offset:
            return
        self._change(offset=offset)
        # Up to the page before, or to the very end: the cursor goes on from the bottom.
        if (event.step > 0) == event.far:
            self.query_one(KeyedTable).from_bottom()

    def action_page(self, step: int) -> None:
        """Turn the page."""
        page = self._page()
        offset = self._wanted.offset + step * PAGE
        if page is not None and 0 <= offset < page.total:
            self._change(offset=offset)


def _order(wanted: RunQuery) -> str:
    """Return what runs are sorted by, in words."""
    if wanted.sort == "index":
        last = "newest" if not wanted.campaign else "last"
        return f"{last} first" if wanted.descending else "as submitted"
    return f"by {wanted.sort} {'▼' if wanted.descending else '▲'}"


def run_cells(row: RunRow, track: Track | None, named: bool = False) -> Row:
    """Return a run as a row of the table; ``named``, with its campaign."""
    word = run_word(row)
    row = so_far(row, track)
    return row.id, (
        Text(run_label(row), style="bold"),
        *([Text(row.campaign, style=QUIET)] if named else []),
        Text(glyph_word(word), style=word),
        Text(margin(row.margin, row.unit) if row.oracle else ""),
        Text(row.oracle),
        Text(progress(row, track)),
        Text(row.worker, style=QUIET),
    )


def so_far(row: RunRow, track: Track | None) -> RunRow:
    """Return a run that goes on with its least margin so far and whose it is, as if it decided."""
    if row.state is not RunState.RUNNING or track is None:
        return row
    seen = track.snapshot
    return replace(row, oracle=seen.oracle, margin=seen.margin, unit=seen.unit)


def progress(row: RunRow, track: Track | None) -> str:
    """Return how far a run is, or how long it took, in simulated time."""
    if row.state is RunState.RUNNING:
        # A stack's start takes more room than this column; the run itself, beside it, says it.
        seen = track.snapshot if track is not None and not track.snapshot.waiting else None
        return reached_text(seen, limit=False)
    return time_text(row.simulated) if row.outcome is not None else ""
