"""What keys do to the maps of a screen; which keys these are is for the screen to say."""

from __future__ import annotations

from textual.screen import Screen

from scenario_tui.dashboard.widgets.top_view import TopView


class MapActions(Screen[None]):
    """A screen with a :class:`TopView`, or several, that all do the same."""

    def action_zoom(self) -> None:
        """Come nearer to the robot on the map."""
        for top in self.query(TopView):
            top.zoom()

    def action_fit(self) -> None:
        """Show all of the map again."""
        for top in self.query(TopView):
            top.fit()

    def action_follow(self) -> None:
        """Follow the robot on the map, or stay where it is now."""
        followed = [top.follow() for top in self.query(TopView)]
        self.notify("following the robot" if any(followed) else "staying here")

    def action_pan(self, right: int, up: int) -> None:
        """Look to a side on the map."""
        panned = [top.pan(right, up) for top in self.query(TopView)]
        if not any(panned):
            self.notify("everything is in view: z comes nearer")
