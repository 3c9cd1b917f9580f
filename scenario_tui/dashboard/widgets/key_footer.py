"""The line of keys at the bottom, made anew only when another key or name stands in it."""

from __future__ import annotations

from typing import Final, TypeAlias

from textual.app import ComposeResult
from textual.binding import Binding
from textual.screen import Screen
from textual.widgets import Footer
from textual.widgets._footer import FooterKey  # whose face leaves it out

_ROOMY: Final = 80
"""Columns in which the keys of most screens have room."""

_Offered: TypeAlias = tuple[Binding, bool, str]
"""A key of the screen: whether it can do something now, and its tooltip."""


class KeyFooter(Footer):
    """The keys of a screen.

    Screens tell of their keys whenever the focus moves, five times before the first one is there;
    each time textual replaces every key by a new widget and lays out the whole screen. Measured:
    0.70 CPU s to the first screen instead of 0.45, 110 to 160 ms for a tab instead of 50. Keys keep
    their widgets where some only become grey or black, as another row under the cursor has them:
    36 CPU ms for a row down instead of 54.
    """

    _shown: list[_Offered] | None = None

    def __init__(self) -> None:
        super().__init__(compact=True, show_command_palette=False)

    def bindings_changed(self, screen: Screen[object]) -> None:
        """Show the keys that a screen has now."""
        shown = _offered(screen)
        if not self._takes_over(screen):
            # Textual shows nothing then either; what comes afterwards is new.
            self._shown = None
        elif shown == self._shown:
            return
        elif self._shown is not None and [b for b, *_ in shown] == [b for b, *_ in self._shown]:
            self._shown = shown
            self._grey(shown)
            return
        else:
            self._shown = shown
        super().bindings_changed(screen)

    def _grey(self, shown: list[_Offered]) -> None:
        """Show which keys can do something now."""
        offered = {
            binding.action: (enabled, tooltip) for binding, enabled, tooltip in reversed(shown)
        }
        for key in self.query(FooterKey):
            if key.action in offered:
                enabled, key.tooltip = offered[key.action]
                key.set_class(not enabled, "-disabled")

    def compose(self) -> ComposeResult:
        """Yield the keys as they are now, which may be others than when they were told of."""
        if self._shown is not None:
            self._shown = _offered(self.screen)
        for key in super().compose():
            key.set_class(isinstance(key, FooterKey) and key.action == "keys", "-help")
            yield key

    def on_resize(self) -> None:
        """Show the key of the help first where not all keys have room."""
        self.set_class(self.size.width < _ROOMY, "-short")

    def _takes_over(self, screen: Screen[object]) -> bool:
        return screen.app.app_focus and self.is_attached and screen is self.screen


def _offered(screen: Screen[object]) -> list[_Offered]:
    found = screen.active_bindings.values()
    return [(one.binding, one.enabled, one.tooltip) for one in found if one.binding.show]
