"""A text that is told again with every snapshot: while it is the same, that costs nothing."""

from __future__ import annotations

from rich.text import Text
from textual.visual import VisualType
from textual.widgets import Static


class StaticText(Static):
    """Like the library's, which lays out the whole screen anew whatever it is told."""

    def update(self, content: VisualType = "", *, layout: bool = True) -> None:
        """Show ``content``; what lies around it is placed anew only where it may have moved."""
        if not _same(content, self.content):
            super().update(content, layout=layout and self.styles.auto_dimensions)


def _same(new: VisualType, shown: VisualType) -> bool:
    if isinstance(new, Text) and isinstance(shown, Text):
        # Texts are equal whatever the style below that of their parts is.
        return new == shown and new.style == shown.style
    return type(new) is type(shown) and new == shown
