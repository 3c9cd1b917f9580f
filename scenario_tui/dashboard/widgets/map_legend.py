"""The legend of a map: what its signs mean, never cut."""

from __future__ import annotations

from rich.text import Text

from scenario_tui.dashboard.widgets.map_style import legend_lines
from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.dashboard.widgets.top_view import TopView


class MapLegend(StaticText):
    """Says what the signs on the maps of a screen mean: of those that are on one of them."""

    def on_resize(self) -> None:
        """Follow the maps, which are all there by now, and break the lines anew."""
        for top in self.screen.query(TopView):
            self.watch(top, "signs", self.show_signs, init=False)
        self.show_signs()

    def show_signs(self) -> None:
        """Show what is on the maps now."""
        signs, height = [top.signs for top in self.screen.query(TopView)], self.screen.size.height
        self.update(Text("\n").join(legend_lines(signs, self.size.width, height)))
