"""What the command line and the dashboard ask of a daemon: the client as they see it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Protocol, TypeAlias

from daemon.model.assessments import AssessmentRules, RunRecord
from daemon.model.messages import DownloadChunk
from daemon.model.status import (
    CampaignRow,
    ChangeEvent,
    DaemonOverview,
    DiskUsage,
    LiveSnapshot,
    RunDetail,
    RunPage,
    RunRow,
    Submission,
    SubmissionReceipt,
    WorkerRow,
)
from grammars.model.scene import Scene

RUNS_PER_QUERY: int = 500
"""Runs asked for at once when all of them are wanted."""


class Closeable(Protocol):
    """A running subscription to events and telemetry."""

    def close(self) -> None:
        """Stop listening."""


class DaemonClient(Protocol):
    """The questions; :class:`daemon.batch.client.Client` answers them over the bus."""

    def overview(self) -> DaemonOverview: ...  # noqa: D102
    def submit(self, submission: Submission) -> SubmissionReceipt: ...  # noqa: D102
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
    def declared(self, campaign: str) -> AssessmentRules: ...  # noqa: D102
    def records(self, campaign: str) -> tuple[RunRecord, ...]: ...  # noqa: D102
    def piece(self, run: str, offset: int) -> DownloadChunk: ...  # noqa: D102
    def scene(self, digest: str) -> Scene: ...  # noqa: D102
    def workers(self) -> tuple[WorkerRow, ...]: ...  # noqa: D102
    def disk(self) -> DiskUsage: ...  # noqa: D102
    def cancel(self, campaign: str) -> int: ...  # noqa: D102
    def retry(self, campaign: str, *, only: str = ...) -> int: ...  # noqa: D102
    def pause(self, campaign: str) -> int: ...  # noqa: D102
    def resume(self, campaign: str) -> int: ...  # noqa: D102
    def prioritise(self, campaign: str, priority: int) -> None: ...  # noqa: D102
    def shutdown(self) -> None: ...  # noqa: D102
    def events(  # noqa: D102
        self,
        on_event: Callable[[ChangeEvent], None],
        on_live: Callable[[LiveSnapshot], None] | None = None,
    ) -> Closeable: ...
    def watch(self, run: str, on_live: Callable[[LiveSnapshot], None]) -> Closeable: ...  # noqa: D102


ClientOpener: TypeAlias = Callable[[], AbstractContextManager[DaemonClient]]


def all_runs(daemon: DaemonClient, campaign: str, *, state: str = "", outcome: str = "",
             text: str = "") -> tuple[RunRow, ...]:  # fmt: skip
    """Return every run of a campaign the filter admits, page by page, in order."""
    rows: list[RunRow] = []
    while True:
        page = daemon.runs(
            campaign,
            state=state,
            outcome=outcome,
            text=text,
            offset=len(rows),
            limit=RUNS_PER_QUERY,
        )
        rows.extend(page.rows)
        if not page.rows or len(rows) >= page.total:
            return tuple(rows)
