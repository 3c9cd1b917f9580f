"""Apps for slow lines and poor terminals: what the dashboard and the replay are made from."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, ClassVar

from textual.app import App
from textual.binding import Binding, BindingType
from textual.driver import Driver
from textual.filter import LineFilter, Monochrome

from scenario_tui.colours import FewColours
from scenario_tui.glyphs import PlainGlyphs
from scenario_tui.limits import Limits, terminal_limits
from scenario_tui.thrift import Shadow

_SETTLED = 0.25
"""Seconds after which a window that was dragged has its size."""


class SparingApp(App[None]):
    """An app that sends little, and that shows itself in what its terminal has."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding(
            "ctrl+l", "redraw", "Redraw", show=False, id="redraw", tooltip="Draw the screen again"
        ),
        Binding(
            "ctrl+z", "suspend_process", "Suspend", show=False, id="suspend", tooltip="Back with fg"
        ),
    ]

    def __init__(self, limits: Limits | None = None) -> None:
        super().__init__()
        self._sparing: tuple[LineFilter, ...] = ()
        self._drawn = False
        if "TEXTUAL_ANIMATIONS" not in os.environ:
            self.animation_level = "none"
        self.limit(limits or Limits())

    def limit(self, limits: Limits) -> None:
        """Show everything within these limits."""
        self.ascii_only = limits.ascii_only
        colours = "none" if self.no_color else limits.colours
        filters: list[LineFilter] = []
        if colours != "all":
            filters.append(FewColours(colours=colours == "few"))
        if limits.ascii_only:
            filters.append(PlainGlyphs())
        self._sparing = tuple(filters)

    def limit_to_terminal(self) -> None:
        """Show everything within what the terminal of this process can do."""
        self.limit(terminal_limits(self.console.color_system))

    def get_line_filters(self) -> Sequence[LineFilter]:
        """Return ours behind the library's, in place of its shades of grey."""
        theirs = super().get_line_filters()
        if not self._sparing:
            return theirs
        return [*(one for one in theirs if not isinstance(one, Monochrome)), *self._sparing]

    def get_key_display(self, binding: Binding) -> str:
        """Name keys in words where there are no signs for them."""
        shown = super().get_key_display(binding)
        return {"⏎": "Enter", "⌫": "Bksp"}.get(shown, shown) if self.ascii_only else shown

    def get_driver_class(self) -> type[Driver]:
        """Return a driver that sends only what changed on the screen."""
        return _thrifty(super().get_driver_class())

    def on_resize(self) -> None:
        """Draw everything again: what terminals keep of a screen when its size changes differs."""
        if self._drawn:
            self._forget()
            self.set_timer(_SETTLED, self.action_redraw)
        self._drawn = True

    def action_redraw(self) -> None:
        """Draw everything again, over whatever stands on the screen."""
        self._forget()
        # The timer may still fire while the screens are being taken down.
        if self.screen_stack:
            self.screen.refresh()

    def _forget(self) -> None:
        shadow = getattr(self._driver, "shadow", None)
        if shadow is not None:
            shadow.forget()


def _thrifty(base: type[Driver]) -> type[Driver]:
    """Return a driver like ``base`` that sends only what changed on the screen."""

    class ThriftyDriver(base):  # type: ignore[misc, valid-type]
        """Thins out frames; everything else goes through."""

        def __init__(self, *arguments: Any, **settings: Any) -> None:
            super().__init__(*arguments, **settings)
            self.shadow = Shadow()

        def write(self, data: str) -> None:
            """Send what of it is news.

            The mouse reports clicks and drags: every move of it would travel up the line, too.
            """
            if news := self.shadow.thin(data.replace("\x1b[?1003", "\x1b[?1002")):
                super().write(news)

    return ThriftyDriver
