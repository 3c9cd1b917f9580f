"""The matrix of a campaign: scenarios by systems under test, with notes on the cells."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from rich.text import Text
from textual import on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Container, VerticalScroll
from textual.events import Resize
from textual.widgets import DataTable, Static

from scenario_tui.dashboard.screens.steering import SteeringScreen, schedule_marks, steering_keys
from scenario_tui.dashboard.state import DashboardState
from scenario_tui.dashboard.widgets.cell_table import COMFORTABLE, CellTable
from scenario_tui.dashboard.widgets.static_text import StaticText, show_message_or
from scenario_tui.text.assessment_text import campaign_notes, cell_notes
from scenario_tui.text.heat_text import heat_legend
from scenario_tui.text.results import NONE_JUDGED

if TYPE_CHECKING:
    from daemon.analysis.results import CampaignResults


class MatrixScreen(SteeringScreen[None]):
    """The matrix of a campaign; below or beside it, notes on the cell under the cursor."""

    AUTO_FOCUS = "CellTable"
    BINDINGS: ClassVar[list[BindingType]] = [
        *steering_keys("retry"),
        Binding("n", "next(1)", "Next !", id="next-unexpected",
                tooltip="The next unexpected cell"),
        Binding("N", "next(-1)", "Previous !", show=False, id="previous-unexpected",
                tooltip="The unexpected cell before"),
        Binding("a", "runs", "All runs", id="all-runs", tooltip="Every run of the campaign"),
    ]  # fmt: skip

    def __init__(self, campaign: str) -> None:
        super().__init__()
        self.about = campaign
        self._results: CampaignResults | None = None
        self._rest = Text()

    def body(self) -> ComposeResult:
        """Lay out the matrix and the notes."""
        yield StaticText(id="empty")
        with Container(id="grid"):
            yield CellTable(id="matrix")
            notes = VerticalScroll(id="notes")
            notes.border_title = "cell "
            with notes:
                yield StaticText(id="about")
        yield StaticText(id="legend")

    def cursor_command(self) -> str:
        """Return the command for the runs of the cell."""
        cell = self.query_one(CellTable).cell
        if cell is None:
            return self.command()
        runs = f"{cell.scenario}/{cell.sut}/"
        return self._line("results", self.about, "--filter", runs)

    def trail(self) -> str:
        """Return the campaign, its conclusion, and its progress."""
        parts = [f"campaigns › {self.about} › matrix"]
        row = self.campaign()
        conclusion = self.dashboard.state.conclusions.get(self.about)
        if conclusion is not None and conclusion.text != NONE_JUDGED:
            parts.append(conclusion.glyph_text)
        if row is not None and not row.finished:
            parts.append(f"{row.ended}/{row.total} runs")
            parts += schedule_marks(row)
        return "  ".join(parts)

    def show(self, state: DashboardState, news: None) -> None:
        """Show the results once they exist, and again after they have changed."""
        results = state.results.get(self.about)
        message = "" if results and results.assessment.cells else self._nothing(results)
        show_message_or(self.query_one("#empty"), self.query_one("#grid"), message)
        # By identity: results are replaced and never changed, and a comparison would cost more than
        # a new drawing.
        if results is None or results is self._results:
            return
        self._results = results
        self._arrange()
        self.query_one(CellTable).show(results)
        self.query_one("#legend", Static).update(heat_legend(results))
        self._rest = campaign_notes(results)
        self._describe()
        if self.focused is None:
            self.query_one(CellTable).focus()

    @on(Resize)
    def _arrange(self) -> None:
        """Put the notes below the matrix, or beside it if there is room."""
        # Beside the matrix they take two fifths, and only on -wide screens.
        suts = {cell.sut for cell in self._results.assessment.cells} if self._results else ()
        self.set_class(len(suts) * COMFORTABLE <= self.size.width * 3 // 5, "-beside")

    def _nothing(self, results: CampaignResults | None) -> str:
        if results is not None:
            return "This campaign has no runs."
        return "… judging" if self.dashboard.state.connected else ""

    @on(DataTable.CellHighlighted)
    def _describe(self) -> None:
        """Describe the cell under the cursor."""
        cell, results = self.query_one(CellTable).cell, self._results
        about = cell_notes(cell, results.expectations) if cell and results else Text()
        self.query_one("#about", Static).update(about + self._rest)

    def on_data_table_cell_selected(self) -> None:
        """Open the runs of the cell."""
        cell = self.query_one(CellTable).cell
        if cell is not None:
            self.dashboard.open("runs", self.about, cell.scenario, cell.sut)

    def action_next(self, step: int) -> None:
        """Go to the next unexpected cell, or the one before; round at the end."""
        if not self.query_one(CellTable).go_to_news(step):
            self.notify("every cell is as expected")
