"""The keys of the screen below, made from its bindings."""

from __future__ import annotations

from typing import ClassVar

from rich.text import Text
from textual.app import App, ComposeResult
from textual.binding import ActiveBinding, Binding, BindingType
from textual.containers import VerticalScroll
from textual.dom import DOMNode
from textual.screen import ModalScreen, Screen
from textual.widgets import Static

import scenario_tui
from scenario_tui.palette import QUIET

Lines = list[tuple[str, str]]


class Help(ModalScreen[None]):
    """Keys that work here, then those that work everywhere."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape,question_mark,f1,q", "dismiss", "Close", id="close", tooltip="Back"),
    ]

    def __init__(self, about: Screen[object]) -> None:
        super().__init__()
        self._groups = key_groups(about)

    def compose(self) -> ComposeResult:
        """Lay out the list of keys."""
        text = Text()
        width = max((len(keys) for _, lines in self._groups for keys, _ in lines), default=0)
        for title, lines in self._groups:
            text.append(f"Keys {title}\n", style="bold")
            for keys, words in lines:
                text.append(f"{keys:>{width}}", style="bold")
                text.append(f"  {words}\n", style="not bold")
            text.append("\n")
        text.append("other keys: scenario tui --bindings", style=QUIET)
        with VerticalScroll(classes="dialog"):
            yield Static(text)


def key_groups(screen: Screen[object]) -> list[tuple[str, Lines]]:
    """Return the keys of a screen and what they do: those here, and those of the whole app."""
    here: dict[str, tuple[list[str], str]] = {}
    everywhere: dict[str, tuple[list[str], str]] = {}
    for active in our_bindings(screen):
        group = everywhere if isinstance(active.node, App) else here
        keys, _ = group.setdefault(active.binding.action, ([], ""))
        keys.append(screen.app.get_key_display(active.binding))
        group[active.binding.action] = (keys, meaning(active.binding))
    groups = (("here", here), ("everywhere", everywhere))
    return [
        (title, [(" ".join(keys), words) for keys, words in group.values()])
        for title, group in groups
        if group
    ]


def our_bindings(screen: Screen[object]) -> list[ActiveBinding]:
    """Return the active bindings of ours: what comes with the library, like scrolling, nobody
    needs to be told.
    """
    found = []
    for active in screen.active_bindings.values():
        ours = {b.id for b in all_bindings(type(active.node))}
        if active.enabled and active.binding.id in ours - {None}:
            found.append(active)
    return found


def meaning(binding: Binding) -> str:
    """Return what a key does, in a few words."""
    more = f": {binding.tooltip}" if binding.tooltip else ""
    return f"{binding.description}{more}"


def own_bindings(kind: type[DOMNode]) -> list[Binding]:
    """Return what a class itself binds."""
    return [b for b in vars(kind).get("BINDINGS", ()) if isinstance(b, Binding)]


def all_bindings(kind: type[DOMNode]) -> list[Binding]:
    """Return what a class and those of ours it is made of bind."""
    return [binding for k in our_classes(kind) for binding in own_bindings(k)]


def our_classes(kind: type[DOMNode]) -> list[type[DOMNode]]:
    """Return the classes of ours that one is made of, those that bind keys."""
    ours = (k for k in kind.__mro__ if k.__module__.startswith(f"{scenario_tui.__name__}."))
    return [k for k in ours if "BINDINGS" in vars(k)]
