"""The colours of the dashboard: a theme for dark terminals and one for light ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from rich.terminal_theme import TerminalTheme
from textual.color import Color
from textual.filter import DimFilter, LineFilter
from textual.theme import Theme

from scenario_tui.terminal.capabilities import TerminalLimits, light_background, terminal_limits
from scenario_tui.terminal.filters import BrightThemeColours
from scenario_tui.terminal.limited_terminal import LimitedTerminalApp
from scenario_tui.text.styles import dashboard_theme

DARK: Final = "scenario-dark"
LIGHT: Final = "scenario-light"
_DIM: Final = 0.75
"""Share of its colour that a dim word keeps; the rest is background."""


def _ansi(colours: str) -> TerminalTheme:
    """Return eight colours twice: black, red, green, yellow, blue, magenta, cyan, white."""
    eight = [Color.parse(colour).rgb for colour in colours.split()]
    return TerminalTheme(eight[0], eight[-1], eight, eight)


# All words have a contrast of 4.5 to 1 or more, as WCAG requires, on each of their backgrounds; the
# tests measure it. The selection is bright (dark) enough to become reverse video with few colours.
THEMES: Final = (
    Theme(
        DARK,
        primary="#6aa6ff",
        secondary="#7fd5e0",
        accent="#f5c76a",
        warning="#f5c76a",
        error="#ff8f8f",
        success="#7fd88f",
        foreground="#dde1e8",
        background="#12151a",
        surface="#191d24",
        panel="#232933",
        dark=True,
        variables={
            "block-cursor-foreground": "#0b0e13",
            "block-cursor-blurred-background": "#2b3a55",
            "block-cursor-blurred-foreground": "#f2f4f8",
            "border-blurred": "#3a4352",
            "input-selection-background": "#6aa6ff 40%",
            "text-disabled": "auto 62%",
            "scrollbar": "#3a4352",
            "scrollbar-background": "#191d24",
        },
    ),
    Theme(
        LIGHT,
        primary="#0b5cad",
        secondary="#0b6470",
        accent="#7a4b00",
        warning="#7a4b00",
        error="#a31621",
        success="#176b2c",
        foreground="#1c2128",
        background="#fbfbf9",
        surface="#f3f3f0",
        panel="#e9e9e5",
        dark=False,
        variables={
            "block-cursor-foreground": "#ffffff",
            "block-cursor-blurred-background": "#cfdff2",
            "block-cursor-blurred-foreground": "#10151c",
            "border-blurred": "#c4c4be",
            "input-selection-background": "#0b5cad 30%",
            "text-disabled": "auto 66%",
            "scrollbar": "#c4c4be",
            "scrollbar-background": "#f3f3f0",
        },
    ),
)


_ANSI_DARK: Final = _ansi("#12151a #ff8f8f #7fd88f #f5c76a #8ab8ff #e29bff #7fd5e0 #dde1e8")
_ANSI_LIGHT: Final = _ansi("#1c2128 #a31621 #176b2c #7a4b00 #0b5cad #7a2a96 #0b6470 #fbfbf9")
"""Looks of the terminal's sixteen colours, which messages of commands have."""


class ThemedApp(LimitedTerminalApp):
    """An app in our colours, with a light theme for light terminals."""

    def __init__(self) -> None:
        super().__init__()
        for theme in THEMES:
            self.register_theme(theme)
        # Plain assignments would make the library parse all style sheets again.
        self.set_reactive(ThemedApp.ansi_theme_dark, _ANSI_DARK)
        self.set_reactive(ThemedApp.ansi_theme_light, _ANSI_LIGHT)
        self.theme = DARK
        self.console.push_theme(dashboard_theme())

    def get_line_filters(self) -> Sequence[LineFilter]:
        """Return the filters, with darker words for light themes."""
        # The library dims words to half of the contrast, too little to read them.
        dim = DimFilter(_DIM)
        filters = [dim if isinstance(f, DimFilter) else f for f in super().get_line_filters()]
        return filters if self.current_theme.dark else [BrightThemeColours(), *filters]

    def refresh_css(self, animate: bool = True) -> None:
        """Apply the theme to the screens; before the first one, only set its variables."""
        if self.screen_stack:
            super().refresh_css(animate)
        else:
            # All style sheets are parsed with the first screen.
            self.stylesheet.set_variables(self.get_css_variables())

    def apply_limits(self, limits: TerminalLimits) -> None:
        """Draw within limits; with few colours, selections are bright."""
        super().apply_limits(limits)
        self.set_class(limits.colours != "all", "-few-colours")

    def limit_to_terminal(self) -> None:
        """Apply the limits and the background of the terminal of this process."""
        self.apply_limits(terminal_limits(self.console.color_system))
        if light_background():
            self.theme = LIGHT
