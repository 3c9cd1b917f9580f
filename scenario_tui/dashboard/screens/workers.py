"""Who executes runs: the workers of the daemon, and which of them are away."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from rich.text import Text
from textual.app import ComposeResult

from grammars.text.words import count_noun, duration_text
from scenario_tui.dashboard.screens.base import BaseScreen, show_message_or
from scenario_tui.dashboard.state import Known
from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.dashboard.widgets.tables import Column, KeyedTable, Row
from scenario_tui.text.formatting import age_text

if TYPE_CHECKING:
    from daemon.model.status import WorkerRow
    from daemon.model.verbs import DaemonClient

_COLUMNS: Final = (
    Column("worker", 0),
    Column("host", 16),
    Column("busy", 9, right=True),
    Column("here for", 12, right=True),
    Column("last heard", 16, right=True),
    Column("process", 8, from_width=90, right=True),
    Column("version", 9, from_width=100),
)
_NOBODY: Final = (
    "No worker is connected: nothing runs. In another terminal, here or elsewhere, type\n\n"
    "    scenario worker --connect tls/<this machine>:7447\n\n"
    "or start the daemon with slots of its own: scenario daemon --slots 4"
)


class WorkersScreen(BaseScreen["tuple[WorkerRow, ...]"]):
    """The workers and how busy they are."""

    IN_FOOTER = ("back", "submit", "palette", "help", "quit")

    def body(self) -> ComposeResult:
        """The table."""
        yield StaticText(id="empty")
        yield KeyedTable(_COLUMNS, id="workers")

    def fetch(self, daemon: DaemonClient, known: Known) -> tuple[WorkerRow, ...]:
        """Return the workers."""
        return daemon.workers()

    def pointless_keys(self) -> frozenset[str]:
        """There is no more to a worker than its row."""
        return super().pointless_keys() | {"open"}

    def trail(self) -> str:
        """Where we are, and the sum of it."""
        rows = self.news or ()
        here = [row for row in rows if not row.away]
        busy, slots = sum(row.busy for row in here), sum(row.slots for row in here)
        away = f", {len(rows) - len(here)} away" if len(here) < len(rows) else ""
        return f"workers ({len(here)}{away})  {busy} of {count_noun(slots, 'slot')} busy"

    def show(self, known: Known, news: tuple[WorkerRow, ...] | None) -> None:
        """Fill the table."""
        now = self.dashboard.clock()
        table = self.query_one(KeyedTable)
        rows = news or ()
        trouble = known.overview.trouble.strip() if known.overview else ""
        nobody = f"No run can start:\n\n{trouble}" if trouble else _NOBODY
        # Beside those that stop everything: what keeps one worker, or some runs, from it.
        troubles = known.overview.troubles if known.overview else ()
        others = [one.words for one in troubles[bool(trouble) :]]
        message = "" if (rows or news is None) and not trouble else nobody
        busy = [f"{row.id}: {row.preparing}" for row in rows if row.preparing]
        message = "\n\n".join(filter(None, (message, *busy, *(f"! {words}" for words in others))))
        above = self.query_one("#empty")
        above.set_class(bool(rows), "-above")
        show_message_or(above, table, message)
        table.display = bool(rows)
        table.fill([worker_cells(row, now) for row in rows])
        if self.focused is None:
            table.focus()


def worker_cells(row: WorkerRow, now: float) -> Row:
    """Return a worker as a row of the table."""
    return row.id, (
        Text(row.id),
        Text(row.host),
        Text(f"{row.busy} of {row.slots}"),
        Text(duration_text(now - row.connected_at)),
        Text(("away, " if row.away else "") + age_text(row.last_seen_at, now)),
        Text(str(row.pid)),
        Text(row.version),
    )
