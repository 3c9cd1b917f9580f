"""The line of keys at the bottom, made anew only when another key or name stands in it."""

from __future__ import annotations

from textual.screen import Screen
from textual.widgets import Footer


class KeyFooter(Footer):
    """The keys of a screen.

    Screens tell of their keys whenever the focus moves, three times before the first one is there;
    each time textual replaces every key by a new widget and lays out the whole screen.
    """

    _shown: object = None

    def __init__(self) -> None:
        super().__init__(compact=True, show_command_palette=False)

    def bindings_changed(self, screen: Screen[object]) -> None:
        """Show the keys that a screen has now."""
        found = screen.active_bindings.values()
        shown = [(one.binding, one.enabled, one.tooltip) for one in found if one.binding.show]
        if not self._takes_over(screen):
            # Textual shows nothing then either; what comes afterwards is new.
            self._shown = None
        elif shown == self._shown:
            return
        else:
            self._shown = shown
        super().bindings_changed(screen)

    def _takes_over(self, screen: Screen[object]) -> bool:
        return screen.app.app_focus and self.is_attached and screen is self.screen
