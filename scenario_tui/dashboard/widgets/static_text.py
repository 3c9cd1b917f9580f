"""Texts that are refreshed with every snapshot: while they are the same, that costs nothing."""

from __future__ import annotations

from rich.text import Text
from textual.visual import VisualType
from textual.widgets import Static


class StaticText(Static):
    """Like the library's, which lays out the whole screen anew whatever it is told."""

    def update(self, content: VisualType = "", *, layout: bool = True) -> None:
        """Show ``content``; what lies around it is placed anew only where it may have moved."""
        if isinstance(content, Text):
            content = _with_spans_only(content)
        if not _same(content, self.content):
            super().update(content, layout=False)
            if layout and self.styles.auto_dimensions and not self._fits():
                self.refresh(layout=True)

    def _fits(self) -> bool:
        """Return whether the content fills the lines it has, or is in a container it fills anyway.

        The latter is what ``min-height: 100%`` is for.
        """
        styles, (width, height) = self.styles, self.content_size
        if styles.width is None or styles.width.is_auto:
            return False
        needed = self.get_content_height(self.container_size, self.screen.size, width)
        fills = styles.min_height is not None and self.size.height == self.container_size.height
        return needed == height or (fills and needed < height)


def _with_spans_only(text: Text) -> Text:
    """Return a text whose base style is one of its parts: Textual knows no names of base styles."""
    if not text.style:
        return text
    copy = text.copy()
    copy.stylize_before(copy.style)
    copy.style = ""
    return copy


def same_text(new: Text, shown: Text) -> bool:
    """Return whether two texts look the same; rich compares all except their base styles."""
    return new == shown and new.style == shown.style


def _same(new: VisualType, shown: VisualType) -> bool:
    if isinstance(new, Text) and isinstance(shown, Text):
        return same_text(new, shown)
    return type(new) is type(shown) and new == shown
