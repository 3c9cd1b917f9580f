"""Texts that are refreshed with every snapshot; an unchanged text costs nothing."""

from __future__ import annotations

from rich.text import Text
from textual.visual import VisualType
from textual.widget import Widget
from textual.widgets import Static


class StaticText(Static):
    """Like the library's, but without a new layout of the whole screen at every update."""

    def update(self, content: VisualType = "", *, layout: bool = True) -> None:
        """Show ``content``, with a new layout only if its size may have changed."""
        if isinstance(content, Text):
            content = _with_spans_only(content)
        if not _same(content, self.content):
            super().update(content, layout=False)
            if layout and self.styles.auto_dimensions and not self._fits():
                self.refresh(layout=True)

    def _fits(self) -> bool:
        """Return True if the content fills its lines, or a container by ``min-height: 100%``."""
        styles, (width, height) = self.styles, self.content_size
        if styles.width is None or styles.width.is_auto:
            return False
        needed = self.get_content_height(self.container_size, self.screen.size, width)
        fills = styles.min_height is not None and self.size.height == self.container_size.height
        return needed == height or (fills and needed < height)


def _with_spans_only(text: Text) -> Text:
    """Return a text with its base style as a span, because Textual ignores named base styles."""
    if not text.style:
        return text
    copy = text.copy()
    copy.stylize_before(copy.style)
    copy.style = ""
    return copy


def same_text(new: Text, old: Text) -> bool:
    """Return True if two texts look the same; rich does not compare their base styles."""
    return new == old and new.style == old.style


def _same(new: VisualType, old: VisualType) -> bool:
    if isinstance(new, Text) and isinstance(old, Text):
        return same_text(new, old)
    return type(new) is type(old) and new == old


def show_message_or(widget: Widget, table: Widget, message: str) -> None:
    """Show ``message`` instead of the table, or the table without a message."""
    widget.display = bool(message)
    table.display = not message
    if message and isinstance(widget, Static):
        widget.update(Text(message))
