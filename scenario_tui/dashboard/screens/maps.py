"""Keys of the maps of a screen: zoom, pan, follow the robot, choose a costmap."""

from __future__ import annotations

from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.screen import Screen

from scenario_tui.dashboard.widgets.timeline import TimelineView
from scenario_tui.dashboard.widgets.top_view import TopView


class MapActions(Screen[None]):
    """A screen with one :class:`TopView` or more, which move together."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("z", "zoom", "Zoom", show=False, id="zoom",
                tooltip="Nearer to the robot, then the whole map"),
        Binding("Z", "fit", "Fit", show=False, id="fit",
                tooltip="The whole map and the whole time again"),
        Binding("F", "follow", "Follow", show=False, id="follow",
                tooltip="Follow the robot when zoomed, or stay"),
        Binding("H", "pan(-1, 0)", "Pan left", show=False, id="pan-left", tooltip="When zoomed"),
        Binding("J", "pan(0, -1)", "Pan down", show=False, id="pan-down", tooltip="When zoomed"),
        Binding("K", "pan(0, 1)", "Pan up", show=False, id="pan-up", tooltip="When zoomed"),
        Binding("L", "pan(1, 0)", "Pan right", show=False, id="pan-right", tooltip="When zoomed"),
        Binding("O", "costmap", "Costmap", show=False, id="costmap",
                tooltip="The next costmap of the stack on the map, or none"),
    ]  # fmt: skip

    def action_zoom(self) -> None:
        """Zoom to the robot on the map."""
        for top in self.query(TopView):
            top.zoom()

    def action_fit(self) -> None:
        """Show the whole map and the whole time again."""
        for top in self.query(TopView):
            top.fit()
        for signals in self.query(TimelineView):
            signals.fit_time()

    def action_follow(self) -> None:
        """Follow the robot on the map, or stay at its present place."""
        followed = [top.follow() for top in self.query(TopView)]
        self.notify("following the robot" if any(followed) else "staying here")

    def action_costmap(self) -> None:
        """Show another costmap on the map, or none."""
        names = [name for top in self.query(TopView) if (name := top.next_costmap()) is not None]
        if not names:
            self.notify("no costmap was recorded")
        else:
            self.notify(f"{names[0]} costmap" if names[0] else "no costmap")

    def action_pan(self, right: int, up: int) -> None:
        """Look to a side on the map."""
        panned = [top.pan(right, up) for top in self.query(TopView)]
        if not any(panned):
            self.notify("the whole map is in view: z zooms in")
