"""The workers slot by slot: the run in each, its progress, and the load of the machine."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Final, TypeAlias

from rich.text import Text
from textual.app import ComposeResult

from grammars.text.words import count_noun, duration_text
from scenario_tui.dashboard.screens.filtering import FilteredScreen
from scenario_tui.dashboard.state import DashboardState
from scenario_tui.dashboard.widgets.running_grid import progress_bar, running_page
from scenario_tui.dashboard.widgets.static_text import StaticText, show_message_or
from scenario_tui.dashboard.widgets.tables import Column, KeyedTable, Row
from scenario_tui.text.formatting import age_text
from scenario_tui.text.run_text import reached_text
from scenario_tui.text.styles import QUIET

if TYPE_CHECKING:
    from daemon.model.status import WorkerRow
    from daemon.model.verbs import DaemonClient
    from scenario_tui.dashboard.run_watch import Tracks

_COLUMNS: Final = (
    Column("worker", 14),
    Column("run", 0),
    Column("progress", 20),
    Column("CPU", 9),
    Column("memory", 13, right=True),
    Column("last heard", 10, right=True, from_width=100),
    Column("here for", 13, right=True, from_width=116),
    Column("host", 16, from_width=140),
    Column("version", 9, from_width=150),
)
_BAR: Final = 4
_NOBODY: Final = (
    "No worker is connected, so no run can start. In another terminal, here or elsewhere, type\n\n"
    "    scenario worker --connect tls/<this machine>:7447\n\n"
    "or start the daemon with its own slots: scenario daemon --slots 4"
)
_KEYS: Final[Mapping[str, Callable[[WorkerRow], Any]]] = {
    "worker": lambda row: row.id,
    "CPU": lambda row: row.cpu,
    "memory": lambda row: row.memory,
    "last heard": lambda row: row.last_seen_at,
    "here for": lambda row: -row.connected_at,
}


WorkersNews: TypeAlias = "tuple[tuple[WorkerRow, ...], Mapping[str, str]]"
"""The workers, and the names of running runs by their id."""


class WorkersScreen(FilteredScreen[WorkersNews]):
    """The slots of all workers: their runs, and the load of their machines."""

    SORTS: ClassVar = dict.fromkeys(_KEYS, True) | {"worker": False}

    def body(self) -> ComposeResult:
        """Lay out the table."""
        yield self.filter_line()
        yield StaticText(id="empty")
        yield KeyedTable(_COLUMNS, id="workers")

    def on_mount(self) -> None:
        """Fetch again and again, because no event reports the load of a machine."""
        self.set_interval(1.0, self._ask_again)

    def _ask_again(self) -> None:
        if self.is_current:
            self.ask()

    def fetch(self, daemon: DaemonClient, state: DashboardState) -> WorkersNews:
        """Return the workers and their runs."""
        page = running_page(daemon, state)
        return daemon.workers(), {row.id: row.label for row in page.rows}

    def trail(self) -> str:
        """Return the sum of workers and slots."""
        rows = self.news[0] if self.news else ()
        here = [row for row in rows if not row.away]
        busy, slots = sum(row.busy for row in here), sum(row.slots for row in here)
        away = f", {len(rows) - len(here)} away" if len(here) < len(rows) else ""
        return f"workers ({len(here)}{away})  {busy} of {count_noun(slots, 'slot')} busy"

    def show(self, state: DashboardState, news: WorkersNews | None) -> None:
        """Fill the table."""
        now, tracks = self.dashboard.clock(), self.dashboard.tracks
        workers, labels = news or ((), {})
        cells = [(one, row) for one in workers for row in slot_rows(one, labels, tracks, now)]
        rows = self.arrangement.apply(cells, _KEYS)
        above, table = self.query_one("#empty"), self.query_one(KeyedTable)
        message = self._message(state, workers) if news else ""
        message = message or ("" if rows or not news else self.no_match())
        above.set_class(bool(workers), "-above")
        show_message_or(above, table, message)
        table.display = bool(rows)
        table.fill(rows)
        if self.focused is None:
            table.focus()

    def _message(self, state: DashboardState, workers: tuple[WorkerRow, ...]) -> str:
        """Return the problems that keep workers from executing runs."""
        trouble = state.overview.trouble.strip() if state.overview else ""
        nobody = f"No run can start:\n\n{trouble}" if trouble else "" if workers else _NOBODY
        # Then the problems of single workers, or of some runs.
        troubles = state.overview.troubles if state.overview else ()
        others = [f"! {one.words}" for one in troubles[bool(trouble) :]]
        busy = [f"{row.id}: {row.preparing}" for row in workers if row.preparing]
        return "\n\n".join(filter(None, (nobody, *busy, *others)))

    def on_data_table_row_selected(self) -> None:
        """Open the run in the slot."""
        run = self.query_one(KeyedTable).key.rpartition(" ")[2]
        if run:
            self.dashboard.open("run", run)


def slot_rows(
    worker: WorkerRow, labels: Mapping[str, str], tracks: Tracks, now: float
) -> Iterator[Row]:
    """Yield a row for each run of a worker, then one for its idle slots.

    ``labels`` name runs. Only the first row has the facts about the whole worker.
    """
    load, memory = Text("away" if worker.away else "", style="inconclusive"), ""
    if worker.memory_total and not worker.away:
        done = round(worker.cpu * _BAR)
        load = Text.assemble(("█" * done, "running"), ("·" * (_BAR - done), QUIET))
        load.append(f"{worker.cpu:>5.0%}")
        memory = f"{worker.memory / 1e9:.1f} of {worker.memory_total / 1e9:.0f} GB"
    age, here = age_text(worker.last_seen_at, now), duration_text(now - worker.connected_at)
    rest = (load, *map(Text, (memory, age, here, worker.host, worker.version)))
    for run in worker.runs:
        track = tracks.get(run)
        last = track.snapshot if track else None
        progress = progress_bar(last).append(" ") if last and not last.waiting else Text()
        progress.append(reached_text(last, limit=False))
        # The list of runs is a moment older than the workers, and may lack this one.
        cells = (Text(worker.id), Text(labels.get(run, run)), progress, *rest)
        yield f"{worker.id} {run}", cells
        rest = (Text(),) * len(rest)
    if (idle := worker.slots - len(worker.runs)) > 0:
        cells = (Text(worker.id), Text(f"{idle} idle", style=QUIET), Text(), *rest)
        yield f"{worker.id} ", cells
