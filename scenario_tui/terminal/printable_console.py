"""The rich console for text of others: it makes their control characters visible."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.text import Text

from grammars.text.terminal_text import printable, unfiltered
from scenario_tui.text.styles import terminal_theme


class PrintableConsole(Console):
    """A console that prints :func:`~grammars.text.terminal_text.printable` text, and no markup.

    Texts name the styles of :mod:`scenario_tui.text.styles`, here in the terminal's own colours.
    Styles and control segments become escape sequences behind this filter.
    """

    def __init__(self, **settings: object) -> None:
        # A name such as "[link=...]" or ":car:" is not markup.
        settings = {"theme": terminal_theme(), **settings}
        super().__init__(markup=False, emoji=False, highlight=False, **settings)  # type: ignore[arg-type]

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Render an object to segments, whose text is printable."""
        # Before the layout: the replacement of a sign without width needs a cell.
        if isinstance(renderable, Text):
            renderable = printable_text(renderable)
        elif isinstance(renderable, str):
            renderable = printable(renderable)
        for segment in super().render(renderable, options):
            plain = segment.text if segment.control else printable(segment.text)
            yield segment if plain == segment.text else segment._replace(text=plain)


def printable_text(text: Text) -> Text:
    """Return a text with the same styles whose characters are printable."""
    plain = printable(text.plain)
    if plain == text.plain:
        return text
    copy = text.copy()
    copy.plain = plain  # as long as before: every style stays where it was
    return copy


def open_console(*, stderr: bool) -> PrintableConsole:
    """Return the console of results, or with ``stderr`` that of messages and progress."""
    stream = sys.stderr if stderr else sys.stdout
    # A pipe has no width; 80 columns would cut identifiers that scripts look for.
    width = None if stream.isatty() or os.environ.get("COLUMNS", "").isdigit() else 160
    # The console itself filters, and its styles must pass. During progress, rich puts its own
    # stream in front.
    file = unfiltered(getattr(stream, "rich_proxied_file", stream))
    return PrintableConsole(file=file, soft_wrap=False, width=width)
