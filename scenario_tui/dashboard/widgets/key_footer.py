"""The line of keys at the bottom, drawn anew only after a change of a key or name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from textual import events
from textual.binding import ActiveBinding
from textual.content import Content
from textual.screen import Screen
from textual.style import Style
from textual.widget import Widget

_NAME: Final = "$footer-description-foreground"
"""Colour of the names of keys."""
_ROOMY: Final = 80
"""Columns that hold the keys of most screens."""


class KeyFooter(Widget):
    """The clickable keys of a screen.

    Textual's own line of keys has a widget for each key. It replaces them at each move of the focus
    and lays out the whole screen, which took most of the time to open a screen.
    """

    ALLOW_SELECT = False
    DEFAULT_CSS = """
    KeyFooter {
        dock: bottom;
        height: 1;
        text-wrap: nowrap;
        background: $footer-background;
    }
    """

    _keys: Mapping[str, ActiveBinding] = {}
    """The shown keys by their actions."""
    _pointed = ""
    """The action under the pointer."""

    def on_mount(self) -> None:
        """Subscribe to changes of the keys."""
        self.screen.bindings_updated_signal.subscribe(self, self.show_keys)

    def on_unmount(self) -> None:
        """Unsubscribe from changes of the keys."""
        self.screen.bindings_updated_signal.unsubscribe(self)

    def show_keys(self, screen: Screen[object]) -> None:
        """Show the present keys of a screen."""
        # A terminal without focus has no keys of a focused widget, but these come back.
        if screen is self.screen and self.app.app_focus:
            keys: dict[str, ActiveBinding] = {}
            for active in screen.active_bindings.values():
                if active.binding.show:
                    keys.setdefault(active.binding.action, active)
            if keys != self._keys:
                self._keys = keys
                self.refresh()

    def render(self) -> Content:
        """Draw the keys one beside the other, in a narrow line with the key of the help first."""
        keys = list(self._keys.values())
        if self.size.width < _ROOMY:
            keys.sort(key=lambda active: active.binding.action != "keys")
        words = []
        for active in keys:
            binding = active.binding
            face = (self.app.get_key_display(binding), "bold $footer-key-foreground")
            word = Content.assemble(face, (f" {binding.description}", _NAME))
            if not active.enabled:
                # The colour of keys, dimmed, is too weak to be read on bright backgrounds.
                word = word.stylize(f"dim {_NAME}")
            if binding.action == self._pointed:
                word = word.stylize("on $block-hover-background")
            words.append(word.stylize(Style.from_meta({"key": binding.action})))
        return Content("  ").join(words)

    def on_mouse_down(self, event: events.MouseDown) -> None:
        """Press the key under the pointer."""
        active = self._keys.get(event.style.meta.get("key", ""))
        if active is not None and active.enabled:
            self.app.simulate_key(active.binding.key)
        elif active is not None:
            self.app.bell()

    def on_mouse_move(self, event: events.MouseMove) -> None:
        """Explain the key under the pointer."""
        self._point(event.style.meta.get("key", ""))

    def on_leave(self) -> None:
        """Remove the explanation."""
        self._point("")

    def _point(self, action: str) -> None:
        if action != self._pointed:
            self._pointed = action
            active = self._keys.get(action)
            self.tooltip = active.tooltip if active is not None else None
            self.refresh()
