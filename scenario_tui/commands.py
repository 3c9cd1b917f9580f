"""Behind the colon: what can be done on the screen in front, and where one can go."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final, cast

from textual.command import DiscoveryHit, Hit, Hits, Provider
from textual.dom import DOMNode

from daemon.protocol import RunRow
from scenario_tui.asking import Daemon
from scenario_tui.wording import run_label

if TYPE_CHECKING:
    from scenario_tui.base_app import BaseDashboard

_CAMPAIGNS: Final = 5
"""Campaigns offered before anything is typed."""
_RUNS: Final = 10
_PATIENCE: Final = 2.0
_UNUSUAL: Final = ("command_palette", "select_cursor", "cursor_down", "cursor_up", "scroll_top",
                   "scroll_bottom", "back")  # fmt: skip
"""Actions nobody goes to the palette for."""


@dataclass(frozen=True, slots=True)
class Offer:
    """A line of the palette: ``do`` is what choosing it does."""

    name: str
    about: str
    do: Callable[[], object]


class Offers(Provider):
    """Offers whose names fit what is typed."""

    def offers(self) -> Iterator[Offer]:
        """Yield everything there is to offer."""
        raise NotImplementedError

    def first(self) -> Iterator[Offer]:
        """Yield what is offered before anything is typed."""
        return self.offers()

    @property
    def dashboard(self) -> BaseDashboard:
        """The app, as what it is."""
        return cast("BaseDashboard", self.app)

    async def discover(self) -> Hits:
        """Offer something before anything is typed."""
        for offer in self.first():
            yield DiscoveryHit(offer.name, offer.do, help=offer.about)

    async def search(self, query: str) -> Hits:
        """Offer what fits."""
        matcher = self.matcher(query)
        for offer in self.offers():
            score = matcher.match(offer.name)
            if score > 0:
                yield Hit(score, matcher.highlight(offer.name), offer.do, help=offer.about)


class Actions(Offers):
    """What has a key on the screen in front, and what has none."""

    def offers(self) -> Iterator[Offer]:
        """Yield actions and places."""
        from scenario_tui.screens.base import BaseScreen
        from scenario_tui.screens.help import our_bindings

        bound = {active.binding.action: active for active in reversed(our_bindings(self.screen))}
        for action, active in reversed(bound.items()):
            binding = active.binding
            if action.partition("(")[0] not in _UNUSUAL:
                about = f"{self.app.get_key_display(binding)}  {binding.tooltip}"
                yield Offer(binding.description, about, self._doing(action, active.node))
        if isinstance(self.screen, BaseScreen):
            for deed in self.screen.deeds():
                yield Offer(deed.name, deed.about, self._doing(deed.action, self.screen))
        yield Offer("Theme", "Choose other colours, until you leave", self.app.action_change_theme)

    def _doing(self, action: str, node: DOMNode) -> Callable[[], object]:
        return partial(self.app.run_action, action, node)


class Campaigns(Offers):
    """Going to a campaign."""

    def offers(self) -> Iterator[Offer]:
        """Yield a way to each campaign and to its matrix."""
        for row in self.dashboard.picture.campaigns:
            yield Offer(f"go to campaign {row.id}", "its runs", self._to(row.id))
            to_matrix = partial(self.dashboard.open_matrix, row.id)
            yield Offer(f"go to matrix of {row.id}", "the campaign judged", to_matrix)

    def first(self) -> Iterator[Offer]:
        """Yield ways to the newest campaigns."""
        for row in self.dashboard.picture.campaigns[:_CAMPAIGNS]:
            yield Offer(f"go to campaign {row.id}", "its runs", self._to(row.id))

    def _to(self, campaign: str) -> Callable[[], object]:
        return partial(self.dashboard.open_runs, campaign)


class Runs(Offers):
    """Going to a run: those on the screen, and those the daemon finds."""

    def first(self) -> Iterator[Offer]:
        """Yield nothing: there are too many."""
        return iter(())

    def offers(self) -> Iterator[Offer]:
        """Yield ways to the runs that are known here."""
        page = self.dashboard.picture.page
        for row in page.rows if page is not None else ():
            yield self._offer(row)

    def _offer(self, row: RunRow) -> Offer:
        to_run = partial(self.dashboard.open_run, row.id)
        return Offer(f"go to run {run_label(row)}", f"of {row.campaign}", to_run)

    async def search(self, query: str) -> Hits:
        """Offer what fits of the page shown, then what the daemon finds."""
        async for hit in super().search(query):
            yield hit
        if not self.dashboard.picture.connected:
            return
        page = self.dashboard.picture.page
        known = {row.id for row in page.rows} if page is not None else set()
        wanted = query.strip().removeprefix("go to run").strip()
        for row in await self._found(wanted) if wanted else ():
            if row.id not in known:
                offer = self._offer(row)
                yield Hit(0.5, offer.name, offer.do, help=offer.about)

    async def _found(self, wanted: str) -> tuple[RunRow, ...]:
        found: Future[tuple[RunRow, ...]] = Future()
        self.dashboard.feed.do(partial(_look_for, wanted[:200], found))
        try:
            return await asyncio.wait_for(asyncio.wrap_future(found), _PATIENCE)
        except (TimeoutError, asyncio.CancelledError):
            return ()  # the palette was closed, or the daemon has more important things to do


def _look_for(wanted: str, found: Future[tuple[RunRow, ...]], daemon: Daemon) -> str:
    # The future is cancelled when somebody typed on; then nobody needs the answer.
    if found.set_running_or_notify_cancel():
        found.set_result(daemon.runs(text=wanted, limit=_RUNS).rows)
    return ""
