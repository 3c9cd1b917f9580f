"""The top view, which shows a map as a whole or follows the robot, zooms and pans."""

from __future__ import annotations

import math
from typing import ClassVar, Final

import numpy as np
from rich.style import Style
from textual import on
from textual.events import MouseEvent, MouseScrollDown, MouseScrollUp
from textual.reactive import reactive

from grammars.model.geometry import Point2
from scenario_tui.dashboard.widgets.cell_view import CellView, Codes
from scenario_tui.dashboard.widgets.map_frame import View, draw_view
from scenario_tui.dashboard.widgets.map_projection import MapProjection
from scenario_tui.dashboard.widgets.map_style import STYLES, MapSigns

_ZOOMS: Final = (1, 2, 4, 8)
_MARGIN: Final = 0.3
"""A view that follows moves on when the robot comes this near to its edge, a share of its size:
moving it less often keeps the terminal quiet.
"""
_STRIDE: Final = 0.25
"""How far one key pans, a share of the view."""


class TopView(CellView):
    """Draws a :class:`View`: all of it, or a part that follows the robot or is panned by hand."""

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
        """Come nearer to the robot, after the nearest back to everything."""
        self._show_at(_ZOOMS[(_ZOOMS.index(self._zoom) + 1) % len(_ZOOMS)])

    def fit(self) -> None:
        """Show all of the map again."""
        self._show_at(1)

    @on(MouseScrollUp)
    @on(MouseScrollDown)
    def _zoom_by_wheel(self, event: MouseEvent) -> None:
        """Come nearer to the robot, or go further away."""
        event.stop()
        nearer = isinstance(event, MouseScrollUp)
        self._show_at(min(self._zoom * 2, _ZOOMS[-1]) if nearer else max(self._zoom // 2, 1))

    def _show_at(self, zoom: int) -> None:
        self._zoom, self._follows, self._middle = zoom, True, None
        self.redraw()

    def follow(self) -> bool:
        """Follow the robot, or stop following it; return whether it is followed now."""
        self._follows = not self._follows or self._zoom == 1
        if self._follows:
            self._middle = None
        self.redraw()
        return self._follows

    def next_costmap(self) -> str | None:
        """Show the next costmap, after the last none; return its name, ``None`` without any."""
        costmaps = self._view.costmaps if self._view is not None else {}
        names = list(dict.fromkeys([*costmaps, ""]))
        if len(names) == 1:
            return None
        index = names.index(self._costmap) if self._costmap in names else 0
        self._costmap = names[(index + 1) % len(names)]
        self.redraw()
        return self._costmap

    def pan(self, right: int, up: int) -> bool:
        """Look further to one side of the screen; return whether there is anything to pan."""
        if self._zoom == 1 or self._projection is None:
            return False
        width, height = 2 * self.size.width, 4 * self.size.height
        way = self._projection.metres(_STRIDE * right * width, _STRIDE * up * height)
        x, y = self._projection.middle
        self._middle, self._follows = (x + way[0], y + way[1]), False
        self.redraw()
        return True

    def _keep_up(self, here: Point2) -> None:
        """Have the part seen hold the robot when it is to be followed."""
        # Not centred all the time: every shift of the map sends all of it over the line.
        if self._middle is None or self._projection is None:
            # A recording may have poses that are no numbers: there is nothing to come nearer to.
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
        # What was there once stays in the legend: a map that changes its height with every contact
        # could not be watched.
        decisive = view.decisive.name if view.decisive else self.signs.decisive
        self.signs = MapSigns(self.signs.layers | frame.layers, view.limit, decisive)
        return frame.cells()
