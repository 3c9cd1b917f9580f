"""The top view: a map as a whole, or a zoomed part that follows the robot or is panned."""

from __future__ import annotations

import math
from typing import ClassVar, Final

import numpy as np
from rich.style import Style
from rich.text import Text
from textual import on
from textual.events import MouseEvent, MouseScrollDown, MouseScrollUp
from textual.reactive import reactive

from grammars.model.geometry import Point2
from scenario_tui.dashboard.widgets.cell_view import CellView, Codes
from scenario_tui.dashboard.widgets.map_frame import View, draw_view
from scenario_tui.dashboard.widgets.map_projection import MapProjection
from scenario_tui.dashboard.widgets.map_style import STYLES, MapSigns, legend_lines
from scenario_tui.dashboard.widgets.static_text import StaticText

_ZOOMS: Final = (1, 2, 4, 8)
_MARGIN: Final = 0.3
"""Distance of the robot from the edge at which a following view moves on, as a share of its size.
Rare moves send less to the terminal.
"""
_STRIDE: Final = 0.25
"""Share of the view by which a key pans."""


class TopView(CellView):
    """Draws a :class:`View`, or a part that follows the robot or is panned by hand."""

    STYLES: ClassVar[tuple[Style, ...]] = STYLES

    signs: reactive[MapSigns] = reactive(MapSigns(), layout=False, repaint=False)
    """The signs on the map, for its legend."""

    _view: View | None = None
    _zoom = 1
    _middle: Point2 | None = None
    _follows = True
    _projection: MapProjection | None = None
    _costmap: str | None = None

    def show(self, view: View | None) -> None:
        """Show another view, or nothing."""
        if view is None or self._view is None or view.mission is not self._view.mission:
            self.signs = MapSigns()
        self._view = view
        self.redraw()

    def zoom(self) -> None:
        """Zoom in to the robot, and after the last step out to the whole map."""
        self._show_at(_ZOOMS[(_ZOOMS.index(self._zoom) + 1) % len(_ZOOMS)])

    def fit(self) -> None:
        """Show the whole map again."""
        self._show_at(1)

    @on(MouseScrollUp)
    @on(MouseScrollDown)
    def _zoom_by_wheel(self, event: MouseEvent) -> None:
        """Zoom in to the robot, or out."""
        event.stop()
        nearer = isinstance(event, MouseScrollUp)
        self._show_at(min(self._zoom * 2, _ZOOMS[-1]) if nearer else max(self._zoom // 2, 1))

    def _show_at(self, zoom: int) -> None:
        self._zoom, self._follows, self._middle = zoom, True, None
        self.redraw()

    def follow(self) -> bool:
        """Follow the robot, or stop following it; return True if it is followed now."""
        self._follows = not self._follows or self._zoom == 1
        if self._follows:
            self._middle = None
        self.redraw()
        return self._follows

    def next_costmap(self) -> str | None:
        """Show the next costmap, after the last one none; return its name, ``None`` without any."""
        costmaps = self._view.costmaps if self._view is not None else {}
        names = list(dict.fromkeys([*costmaps, ""]))
        if len(names) == 1:
            return None
        index = names.index(self._costmap) if self._costmap in names else 0
        self._costmap = names[(index + 1) % len(names)]
        self.redraw()
        return self._costmap

    def pan(self, right: int, up: int) -> bool:
        """Pan to one side of the screen; return False if the whole map is in view."""
        if self._zoom == 1 or self._projection is None:
            return False
        width, height = 2 * self.size.width, 4 * self.size.height
        way = self._projection.metres(_STRIDE * right * width, _STRIDE * up * height)
        x, y = self._projection.middle
        self._middle, self._follows = (x + way[0], y + way[1]), False
        self.redraw()
        return True

    def _keep_up(self, here: Point2) -> None:
        """Move the visible part to the robot if it is followed."""
        # Not centred all the time, because every shift sends the whole map over the line.
        if self._middle is None or self._projection is None:
            # A recording may have poses that are not finite, which cannot be zoomed to.
            self._middle = here if all(map(math.isfinite, here)) else None
        elif self._follows:
            (away,) = self._projection.dots(np.array([here])) - self._projection.centre
            size = np.array([2 * self.size.width, 4 * self.size.height])
            if (np.abs(away) > (0.5 - _MARGIN) * size).any():
                self._middle = here

    def cells(self, columns: int, rows: int) -> tuple[Codes, Codes] | None:
        """Return the view as cells."""
        view = self._view
        if view is None:
            return None
        if self._zoom > 1:
            self._keep_up((view.where.x, view.where.y))
        frame = draw_view(
            view, columns, rows, zoom=self._zoom, middle=self._middle, costmap=self._costmap
        )
        self._projection = frame.still.projection
        # A sign stays in the legend, because the map should not change its height with every
        # contact.
        decisive = view.decisive.name if view.decisive else self.signs.decisive
        self.signs = MapSigns(self.signs.layers | frame.layers, view.limit, decisive)
        return frame.cells()


class MapLegend(StaticText):
    """Explains the signs on the maps of a screen, in lines that cut none of them."""

    def on_resize(self) -> None:
        """Watch the maps, which all exist now, and break the lines anew."""
        for top in self.screen.query(TopView):
            self.watch(top, "signs", self.show_signs, init=False)
        self.show_signs()

    def show_signs(self) -> None:
        """Show the present signs of the maps."""
        signs, height = [top.signs for top in self.screen.query(TopView)], self.screen.size.height
        self.update(Text("\n").join(legend_lines(signs, self.size.width, height)))
