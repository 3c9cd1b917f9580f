"""What the command line and the dashboard ask of a daemon: the client as they see it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Protocol, TypeAlias

from daemon.assessment import Declared, RunRecord
from daemon.messages import Piece
from daemon.protocol import (
    CampaignRow,
    Disk,
    Event,
    Live,
    Overview,
    Receipt,
    RunDetail,
    RunPage,
    RunRow,
    Submission,
    WorkerRow,
)
from grammars.scene import Scene

PAGE: int = 500
"""Runs asked for at once when all of them are wanted."""


class Subscription(Protocol):
    """A running subscription to events and telemetry."""

    def close(self) -> None:
        """Stop listening."""


class Daemon(Protocol):
    """The questions; :class:`daemon.client.Client` answers them over the bus."""

    def overview(self) -> Overview: ...  # noqa: D102
    def submit(self, submission: Submission) -> Receipt: ...  # noqa: D102
    def campaigns(self) -> tuple[CampaignRow, ...]: ...  # noqa: D102
    def runs(  # noqa: D102
        self,
        campaign: str = "",
        *,
        state: str = "",
        outcome: str = "",
        text: str = "",
        sort: str = "index",
        descending: bool = False,
        offset: int = 0,
        limit: int = 200,
        scenario: str = "",
        sut: str = "",
    ) -> RunPage: ...
    def run(self, run: str) -> RunDetail: ...  # noqa: D102
    def declared(self, campaign: str) -> Declared: ...  # noqa: D102
    def records(self, campaign: str) -> tuple[RunRecord, ...]: ...  # noqa: D102
    def piece(self, run: str, offset: int) -> Piece: ...  # noqa: D102
    def scene(self, digest: str) -> Scene: ...  # noqa: D102
    def workers(self) -> tuple[WorkerRow, ...]: ...  # noqa: D102
    def disk(self) -> Disk: ...  # noqa: D102
    def cancel(self, campaign: str) -> int: ...  # noqa: D102
    def retry(self, campaign: str, *, only: str = ...) -> int: ...  # noqa: D102
    def pause(self, campaign: str) -> int: ...  # noqa: D102
    def resume(self, campaign: str) -> int: ...  # noqa: D102
    def prioritise(self, campaign: str, priority: int) -> None: ...  # noqa: D102
    def shutdown(self) -> None: ...  # noqa: D102
    def events(  # noqa: D102
        self, on_event: Callable[[Event], None], on_live: Callable[[Live], None] | None = None
    ) -> Subscription: ...
    def watch(self, run: str, on_live: Callable[[Live], None]) -> Subscription: ...  # noqa: D102


Opener: TypeAlias = Callable[[], AbstractContextManager[Daemon]]


def all_runs(daemon: Daemon, campaign: str, *, state: str = "", outcome: str = "",
             text: str = "") -> tuple[RunRow, ...]:  # fmt: skip
    """Return every run of a campaign the filter admits, page by page, in order."""
    rows: list[RunRow] = []
    while True:
        page = daemon.runs(
            campaign, state=state, outcome=outcome, text=text, offset=len(rows), limit=PAGE
        )
        rows.extend(page.rows)
        if not page.rows or len(rows) >= page.total:
            return tuple(rows)
