"""The matrix of a campaign as a table with a cursor on one cell: a heat map of margins."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Final

from rich.cells import cell_len
from rich.text import Text
from textual.binding import Binding, BindingType
from textual.coordinate import Coordinate
from textual.geometry import Size
from textual.widgets import DataTable

from scenario_tui.dashboard.widgets.static_text import same_text
from scenario_tui.text.heat_text import CELL_LINES, heat_cell

if TYPE_CHECKING:
    from daemon.analysis.results import CampaignResults
    from daemon.model.assessments import CellAssessment

_NARROWEST: Final = 16
"""Least columns of a cell, for a verdict and its margin; the table scrolls if they do not fit."""
COMFORTABLE: Final = 36
"""Most columns of a cell, so that the cells are seen as one picture."""


class CellTable(DataTable[Text]):
    """Scenarios by systems under test, with a cursor on one cell."""

    BINDING_GROUP_TITLE = "in the list"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("h", "cursor_left", "Left", show=False, id="left", tooltip="Also the arrow"),
        Binding("j", "cursor_down", "Down", show=False, id="down", tooltip="Also the arrow"),
        Binding("k", "cursor_up", "Up", show=False, id="up", tooltip="Also the arrow"),
        Binding("l", "cursor_right", "Right", show=False, id="right", tooltip="Also the arrow"),
        Binding("enter", "select_cursor", "Runs", id="open", tooltip="The runs of the cell"),
    ]

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(cursor_type="cell", id=id)
        self._results: CampaignResults | None = None
        self._cells: dict[tuple[str, str], CellAssessment] = {}
        self._news: set[tuple[str, str]] = set()
        self._labels: tuple[str, ...] = ()
        self._titles: tuple[str, ...] = ()
        self._width = 0

    @property
    def cell(self) -> CellAssessment | None:
        """The cell under the cursor, if any."""
        row, column = self.cursor_coordinate
        if row < len(self._labels) and column < len(self._titles):
            return self._cells.get((self._labels[row], self._titles[column]))
        return None

    def show(self, results: CampaignResults) -> None:
        """Show the matrix; the cursor stays on its cell, and unchanged cells are not drawn."""
        before = self.cell
        self._results = results
        self._cells = {(cell.scenario, cell.sut): cell for cell in results.assessment.cells}
        marks = results.expectations
        self._news = {
            place for place, cell in self._cells.items() if marks.mark_cells([cell]).kind == "news"
        }
        labels = tuple(dict.fromkeys(scenario for scenario, _ in self._cells))
        titles = tuple(dict.fromkeys(sut for _, sut in self._cells))
        if (labels, titles) != (self._labels, self._titles):
            self._labels, self._titles, self._width = labels, titles, 0
        self._fill()
        if before is not None and before != self.cell:
            self.go_to(before.scenario, before.sut)

    def go_to(self, scenario: str, sut: str) -> None:
        """Move the cursor to a cell, or to the first one if that does not exist."""
        is_here = scenario in self._labels and sut in self._titles
        place = (self._labels.index(scenario), self._titles.index(sut)) if is_here else (0, 0)
        self.move_cursor(row=place[0], column=place[1], animate=False)

    def go_to_news(self, step: int) -> bool:
        """Move the cursor to the next unexpected cell, or with -1 to the one before.

        The first one follows the last. Return True if there is one.
        """
        places = [(label, title) for label in self._labels for title in self._titles]
        row, column = self.cursor_coordinate
        here = row * len(self._titles) + column
        ahead = [places[(here + step * i) % len(places)] for i in range(1, len(places) + 1)]
        news = [place for place in ahead if place in self._news]
        if news:
            self.go_to(*news[0])
        return bool(news)

    def on_resize(self) -> None:
        """Fit the cells to the new width."""
        self._fill()

    def _around(self) -> int:
        """Return the columns that labels, gaps and scroll bar take."""
        labels = max(map(cell_len, self._labels), default=0)
        return labels + 2 * self.cell_padding * (len(self._titles) + 1) + 1

    def _fill(self) -> None:
        if self._results is None or not self._titles:
            return
        room = (self.size.width or self.app.size.width) - self._around()
        width = min(max(room // len(self._titles), _NARROWEST), COMFORTABLE)
        if width != self._width:
            self._begin(width)
        for row, label in enumerate(self._labels):
            for column, title in enumerate(self._titles):
                cell = heat_cell(self._cells.get((label, title)), self._results, width)
                # Setting a cell draws its row and measures its column again, so an unchanged one is
                # skipped, for slow lines.
                place = Coordinate(row, column)
                if not same_text(cell, self.get_cell_at(place)):
                    self.update_cell_at(place, cell)

    def _begin(self, width: int) -> None:
        """Replace all cells by empty ones."""
        cursor = self.cursor_coordinate
        self.clear(columns=True)
        self._width = width
        for title in self._titles:
            self.add_column(Text(title, no_wrap=True, overflow="ellipsis"), key=title, width=width)
        for label in self._labels:
            empty = (Text(),) * len(self._titles)
            name = Text(label, style="bold")
            self.add_row(*empty, key=label, label=name, height=CELL_LINES)
        self.move_cursor(row=cursor.row, column=cursor.column, animate=False)

    def get_content_height(self, container: Size, viewport: Size, width: int) -> int:
        """Return the height of titles and rows, including new rows that are not drawn yet."""
        return 1 + CELL_LINES * len(self._labels)
