"""What keys do to the maps and parts of a screen; which keys these are is for the screen to say."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from textual.screen import Screen

from scenario_tui.dashboard.widgets.top_view import TopView


class MapActions(Screen[None]):
    """A screen with a :class:`TopView`, or several, that all do the same.

    Where there is room for one of its parts only, that one is shown.
    """

    VIEWS: ClassVar[Sequence[str]] = ()
    """Parts of the screen; the class of the one shown alone, where there is room for one."""

    _part = 0

    def show_view(self, part: int) -> None:
        """Show one part of the screen where there is room for one only."""
        if self.VIEWS:
            self._part = part % len(self.VIEWS)
            others = {f"-{name}" for name in self.VIEWS}
            self.set_classes([*(self.classes - others), f"-{self.VIEWS[self._part]}"])
            self.call_after_refresh(self.view_changed)

    def view_changed(self) -> None:
        """Give the part that came the keys, if it takes any."""

    def tabs(self) -> str:
        """Return the parts of the screen, the one shown in brackets."""
        names = (f"[{n}]" if i == self._part else f" {n} " for i, n in enumerate(self.VIEWS))
        return "".join(names)

    def action_view(self, step: int) -> None:
        """Show the next part of the screen, or the one before."""
        self.show_view(self._part + step)

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
            self.notify("everything is in view: z comes nearer")
