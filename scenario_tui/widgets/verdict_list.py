"""The verdicts of a run, one to choose: what was decided against first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.widgets import OptionList
from textual.widgets.option_list import Option

from daemon.verdict import Verdict
from scenario_tui.widgets.run_text import by_severity, verdict_text


class VerdictList(OptionList, inherit_bindings=False):
    """Verdicts in some lines each; the highlighted one is what the rest of the screen is about."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("down", "cursor_down", "Next verdict", show=False, id="verdict-next",
                tooltip="Go to when it was decided"),
        Binding("up", "cursor_up", "Verdict before", show=False, id="verdict-before",
                tooltip="Go to when it was decided"),
        Binding("enter", "select", "To its moment", show=False, id="verdict-moment",
                tooltip="Back to when it was decided"),
    ]  # fmt: skip

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id, compact=True)
        self._verdicts: tuple[Verdict, ...] = ()

    def show(self, verdicts: Sequence[Verdict]) -> None:
        """Show other verdicts; the first of them is chosen."""
        ordered = tuple(by_severity(verdicts))
        if ordered == self._verdicts:
            return
        self._verdicts = ordered
        self.clear_options()
        self.add_options([Option(verdict_text(verdict)) for verdict in ordered])
        self.highlighted = 0 if ordered else None

    def chosen(self) -> Verdict | None:
        """Return the highlighted verdict."""
        if self.highlighted is None or self.highlighted >= len(self._verdicts):
            return None
        return self._verdicts[self.highlighted]
