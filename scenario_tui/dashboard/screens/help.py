"""What can be done on the screen below: its keys, read off its bindings, and the palette."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, ClassVar, Final, cast

from rich.text import Text
from textual.app import App, ComposeResult, SystemCommand
from textual.binding import ActiveBinding, Binding, BindingType
from textual.command import DiscoveryHit, Hit, Hits, Provider
from textual.containers import VerticalScroll
from textual.dom import DOMNode
from textual.screen import ModalScreen, Screen
from textual.widgets import Static

import scenario_tui
from scenario_tui.text.styles import QUIET

if TYPE_CHECKING:
    from daemon.model.status import CampaignRow
    from scenario_tui.dashboard.base_app import BaseDashboard

Lines = list[tuple[str, str]]
_CAMPAIGNS: Final = 5
"""Campaigns offered before anything is typed."""
_UNUSUAL: Final = ("command_palette", "select_cursor", "cursor_down", "cursor_up", "scroll_top",
                   "scroll_bottom", "back")  # fmt: skip
"""Actions nobody goes to the palette for."""


_GROUPS: Final = (
    "here", "in the list", "while it plays", "about the campaign", "everywhere",
)  # fmt: skip
"""Where keys belong, in the order they are told."""
_ROOMS: Final = {
    "steering": "about the campaign", "playing": "while it plays", "base": "everywhere",
    "tables": "in the list", "cell_table": "in the list", "limited_terminal": "everywhere",
}  # fmt: skip
"""Where the keys of a module belong, those of apps everywhere and others here."""


class Help(ModalScreen[None]):
    """The keys that do something now, as the user has them, by where they belong."""

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
            text.append(f"{title}\n", style=QUIET)
            for keys, words in lines:
                name, colon, more = words.partition(":")
                text.append(f"{keys:>{width}}  ", style="bold")
                text.append(name)
                text.append(f"{colon}{more}\n", style=QUIET)
            text.append("\n")
        text.append("choose other keys: scenario tui --bindings", style=QUIET)
        dialog = VerticalScroll(classes="dialog")
        dialog.border_title = "Keys"
        with dialog:
            yield Static(text)


def key_groups(screen: Screen[object]) -> list[tuple[str, Lines]]:
    """Return the keys that work on a screen and what they do, by where they belong."""
    groups: dict[str, dict[str, tuple[list[str], str]]] = {title: {} for title in _GROUPS}
    for active in our_bindings(screen):
        group = groups[_group(active)]
        keys, _ = group.setdefault(active.binding.action, ([], ""))
        shown = screen.app.get_key_display(active.binding)
        if shown not in keys:
            keys.append(shown)
        group[active.binding.action] = (keys, binding_meaning(active.binding))
    return [
        (title, [(" ".join(keys), words) for keys, words in group.values()])
        for title, group in groups.items()
        if group
    ]


def _group(active: ActiveBinding) -> str:
    if isinstance(active.node, App) or active.binding.id in ("help", "leave"):
        return "everywhere"  # screens that also stand alone bind these themselves
    kinds = our_classes(type(active.node))
    kind = next(k for k in kinds if active.binding.id in {one.id for one in own_bindings(k)})
    return _ROOMS.get(kind.__module__.rpartition(".")[2], "here")


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


def binding_meaning(binding: Binding) -> str:
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


class PaletteProvider(Provider):
    """Offers whose names fit what is typed."""

    def offers(self) -> Iterator[SystemCommand]:
        """Yield everything there is to offer."""
        raise NotImplementedError

    def first(self) -> Iterator[SystemCommand]:
        """Yield what is offered before anything is typed."""
        return self.offers()

    @property
    def dashboard(self) -> BaseDashboard:
        """The app, as what it is."""
        return cast("BaseDashboard", self.app)

    async def discover(self) -> Hits:
        """Offer something before anything is typed."""
        for offer in self.first():
            yield DiscoveryHit(offer.title, offer.callback, help=offer.help)

    async def search(self, query: str) -> Hits:
        """Offer what fits."""
        matcher = self.matcher(query)
        for offer in self.offers():
            score = matcher.match(offer.title)
            if score > 0:
                yield Hit(score, matcher.highlight(offer.title), offer.callback, help=offer.help)


class ActionCommands(PaletteProvider):
    """What has a key on the screen in front, and what has none."""

    def offers(self) -> Iterator[SystemCommand]:
        """Yield actions and places."""
        # Replays show their keys by this module as well, without the rest of the dashboard.
        from scenario_tui.dashboard.screens.base import BaseScreen

        # An action with several keys is offered once, under the first of them.
        bound = {active.binding.action: active for active in reversed(our_bindings(self.screen))}
        for action, active in reversed(bound.items()):
            binding = active.binding
            if action.partition("(")[0] not in _UNUSUAL:
                about = f"{self.app.get_key_display(binding)}  {binding.tooltip}"
                do = partial(self.app.run_action, action, active.node)
                yield SystemCommand(binding.description, about, do)
        if isinstance(self.screen, BaseScreen):
            yield from self.screen.palette_commands()
        yield SystemCommand(
            "Theme", "Choose other colours, until you leave", self.app.action_change_theme
        )


class CampaignCommands(PaletteProvider):
    """Going to a campaign."""

    def offers(self) -> Iterator[SystemCommand]:
        """Yield a way to each campaign and to its matrix."""
        for row in self.dashboard.known.campaigns:
            yield self._to(row)
            if row.search:
                continue  # its runs are there to fail: nothing was expected of them
            to_matrix = partial(self.dashboard.open, "matrix", row.id)
            yield SystemCommand(f"go to matrix of {row.id}", "the campaign judged", to_matrix)

    def first(self) -> Iterator[SystemCommand]:
        """Yield ways to the newest campaigns."""
        for row in self.dashboard.known.campaigns[:_CAMPAIGNS]:
            yield self._to(row)

    def _to(self, row: CampaignRow) -> SystemCommand:
        there = partial(self.dashboard.open_campaign, row.id)
        about = "a search, what it found" if row.search else "its runs"
        return SystemCommand(f"go to campaign {row.id}", about, there)
