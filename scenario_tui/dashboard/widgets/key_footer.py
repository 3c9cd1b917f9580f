"""The line of keys at the bottom, drawn anew only when another key or name stands in it."""

from __future__ import annotations

from typing import ClassVar, Final, NamedTuple

from rich.text import Text
from textual import events
from textual.screen import Screen
from textual.widget import Widget

_ROOMY: Final = 80
"""Columns in which the keys of most screens have room."""
_GAP: Final = 2
"""Columns between two keys."""


class _Key(NamedTuple):
    """A key as it is shown, and what it does."""

    face: str
    name: str
    action: str
    key: str
    enabled: bool
    tooltip: str

    @property
    def width(self) -> int:
        return Text(f"{self.face} {self.name}").cell_len


class KeyFooter(Widget):
    """The keys of a screen; those under the pointer can be clicked on.

    Textual's own line of keys has a widget for each, which it replaces whenever the focus moves and
    for which it lays out the whole screen: most of the time that a screen took to be there.
    """

    ALLOW_SELECT = False
    COMPONENT_CLASSES: ClassVar[set[str]] = {
        "key-footer--key",
        "key-footer--name",
        "key-footer--disabled",
        "key-footer--hover",
    }
    DEFAULT_CSS = """
    KeyFooter {
        dock: bottom;
        height: 1;
        text-wrap: nowrap;
        background: $footer-background;
        & > .key-footer--key {
            color: $footer-key-foreground;
            text-style: bold;
        }
        & > .key-footer--name {
            color: $footer-description-foreground;
        }
        /* The colour of keys, dimmed, is too weak to be read on bright backgrounds. */
        & > .key-footer--disabled {
            color: $footer-description-foreground;
            text-style: dim;
        }
        & > .key-footer--hover {
            background: $block-hover-background;
        }
    }
    """

    _keys: tuple[_Key, ...] = ()
    _pointed: _Key | None = None

    def on_mount(self) -> None:
        """Subscribe to changes of the keys."""
        self.screen.bindings_updated_signal.subscribe(self, self.show_keys)

    def on_unmount(self) -> None:
        """Unsubscribe from changes of the keys."""
        self.screen.bindings_updated_signal.unsubscribe(self)

    def show_keys(self, screen: Screen[object]) -> None:
        """Show the keys that a screen has now."""
        # Without the focus of the terminal there are none of what has it here: that comes back.
        if screen is self.screen and self.app.app_focus:
            keys = self._offered(screen)
            if keys != self._keys:
                self._keys = keys
                self.refresh()

    def _offered(self, screen: Screen[object]) -> tuple[_Key, ...]:
        offered: dict[str, _Key] = {}
        for _, binding, enabled, tooltip in screen.active_bindings.values():
            if binding.show and binding.action not in offered:
                face = self.app.get_key_display(binding)
                offered[binding.action] = _Key(
                    face, binding.description, binding.action, binding.key, enabled, tooltip
                )
        return tuple(offered.values())

    def _shown(self) -> tuple[_Key, ...]:
        """Return the keys in their order: that of the help first where not all have room."""
        if self.size.width >= _ROOMY:
            return self._keys
        return tuple(sorted(self._keys, key=lambda one: one.action != "keys"))

    def render(self) -> Text:
        """Draw the keys one beside the other."""
        text = Text(no_wrap=True)
        name = self.get_component_rich_style("key-footer--name")
        for key in self._shown():
            if text:
                text.append(" " * _GAP)
            start = len(text)
            text.append(key.face, self.get_component_rich_style("key-footer--key"))
            text.append(f" {key.name}", name)
            if not key.enabled:
                disabled = self.get_component_rich_style("key-footer--disabled")
                text.stylize(disabled, start)
            if key == self._pointed:
                text.stylize(self.get_component_rich_style("key-footer--hover"), start)
        return text

    def _at(self, column: int) -> _Key | None:
        start = 0
        for key in self._shown():
            if start <= column < start + key.width:
                return key
            start += key.width + _GAP
        return None

    def on_mouse_down(self, event: events.MouseDown) -> None:
        """Do what the key under the pointer does."""
        key = self._at(event.x)
        if key is not None and key.enabled:
            self.app.simulate_key(key.key)
        elif key is not None:
            self.app.bell()

    def on_mouse_move(self, event: events.MouseMove) -> None:
        """Say more of the key under the pointer."""
        self._point(self._at(event.x))

    def on_leave(self) -> None:
        """Point at nothing any more."""
        self._point(None)

    def _point(self, key: _Key | None) -> None:
        if key != self._pointed:
            self._pointed = key
            self.tooltip = key.tooltip if key is not None else None
            self.refresh()
