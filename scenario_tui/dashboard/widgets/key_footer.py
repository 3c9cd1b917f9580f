"""The line of keys at the bottom, drawn anew only after a change of a key or name."""

from __future__ import annotations

from typing import ClassVar, Final, NamedTuple

from rich.text import Text
from textual import events
from textual.screen import Screen
from textual.widget import Widget

_ROOMY: Final = 80
"""Columns that hold the keys of most screens."""
_GAP: Final = 2
"""Columns between two keys."""


class _Key(NamedTuple):
    """A key with its display, and its action."""

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
    """The clickable keys of a screen.

    Textual's own line of keys has a widget for each key. It replaces them at each move of the focus
    and lays out the whole screen, which took most of the time to open a screen.
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
        """Show the present keys of a screen."""
        # A terminal without focus has no keys of a focused widget, but these come back.
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
        """Return the keys in their order, in a narrow line with the key of the help first."""
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
        """Press the key under the pointer."""
        key = self._at(event.x)
        if key is not None and key.enabled:
            self.app.simulate_key(key.key)
        elif key is not None:
            self.app.bell()

    def on_mouse_move(self, event: events.MouseMove) -> None:
        """Explain the key under the pointer."""
        self._point(self._at(event.x))

    def on_leave(self) -> None:
        """Remove the explanation."""
        self._point(None)

    def _point(self, key: _Key | None) -> None:
        if key != self._pointed:
            self._pointed = key
            self.tooltip = key.tooltip if key is not None else None
            self.refresh()
