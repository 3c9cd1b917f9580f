"""The legend of a map: what its signs mean, never cut."""

from __future__ import annotations

from rich.text import Text

from scenario_tui.dashboard.widgets.map_style import legend_lines
from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.dashboard.widgets.top_view import TopView


class MapLegend(StaticText):
    """Says what the signs on the maps of a screen mean: of those that are on one of them."""

    def __init__(self, maps: str = "#map", *, id: str = "legend") -> None:
        """Make the legend of the :class:`TopView` that the selector ``maps`` finds, or several."""
        super().__init__(id=id)
        self._selector = maps

    def on_mount(self) -> None:
        """Follow the maps from now on."""
        for top in self.screen.query(self._selector).results(TopView):
            self.watch(top, "signs", self.show_signs)

    def on_resize(self) -> None:
        """Break the lines anew."""
        self.show_signs()

    def show_signs(self) -> None:
        """Show what is on the maps now."""
        maps = self.screen.query(self._selector).results(TopView)
        height = self.screen.size.height
        lines = legend_lines([top.signs for top in maps], self.size.width, height)
        self.update(Text("\n").join(lines))
