"""Questions and help, over the screen they are about."""

from __future__ import annotations

from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical, VerticalScroll
from textual.dom import DOMNode
from textual.screen import ModalScreen, Screen
from textual.widgets import Static

from scenario_tui.palette import QUIET


class Question(ModalScreen[bool]):
    """A yes-or-no question; ``command`` is what to type to do the same."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("y", "answer(True)", "Yes"),
        Binding("n,escape,q", "answer(False)", "No"),
    ]

    def __init__(self, text: str, command: str) -> None:
        super().__init__()
        self._text, self._command = text, command

    def compose(self) -> ComposeResult:
        """Lay out the question."""
        text = Text(self._text + "\n\n")
        text.append("y", style="bold")
        text.append(" yes   ")
        text.append("n", style="bold")
        text.append(" no\n\n")
        text.append(f"same as: {self._command}", style=QUIET)
        with Vertical(classes="dialog"):
            yield Static(text)

    def action_answer(self, yes: bool) -> None:
        """Leave with the answer."""
        self.dismiss(yes)


class Help(ModalScreen[None]):
    """The keys of the screen below, made from its bindings."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape,question_mark,q", "dismiss", "Close"),
    ]

    def __init__(self, about: Screen[object]) -> None:
        super().__init__()
        self._lines = key_lines(about)

    def compose(self) -> ComposeResult:
        """Lay out the list of keys."""
        text = Text("Keys here\n\n", style="bold")
        width = max((len(keys) for keys, _ in self._lines), default=0)
        for keys, meaning in self._lines:
            text.append(f"{keys:<{width}}", style="bold")
            text.append(f"  {meaning}\n", style="not bold")
        with VerticalScroll(classes="dialog"):
            yield Static(text)


def key_lines(screen: Screen[object]) -> list[tuple[str, str]]:
    """Return keys and what they do on a screen, one line for each action."""
    lines: dict[str, tuple[list[str], str]] = {}
    for active in screen.active_bindings.values():
        binding = active.binding
        if not active.enabled or binding.action not in _own_actions(active.node):
            continue
        keys, _ = lines.setdefault(binding.action, ([], ""))
        keys.append(screen.app.get_key_display(binding))
        meaning = binding.description
        if binding.tooltip:
            meaning += f": {binding.tooltip}"
        lines[binding.action] = (keys, meaning)
    return [(" ".join(keys), meaning) for keys, meaning in lines.values()]


def _own_actions(node: DOMNode) -> set[str]:
    """Return the actions that classes of ours bind on a node: what comes with the library, like
    scrolling, nobody needs to be told.
    """
    bindings = [
        binding
        for kind in type(node).__mro__
        if kind.__module__.startswith("scenario_tui.")
        for binding in kind.__dict__.get("BINDINGS", ())
    ]
    return {b.action for b in bindings if isinstance(b, Binding) and b.description}
