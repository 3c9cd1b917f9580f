"""Makes the proposals of searches that run in a daemon, each in a thread of its own.

The program of a search is plain code that is run from its beginning every time: what the ledger
has already is there at once, so that it goes on where it was, whatever ended the process before.
Nothing is kept but in the ledger.
"""

from __future__ import annotations

import sys
import threading
import traceback
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Final, TypeAlias

from daemon.batch.client import Client
from daemon.batch.errors import DaemonError
from daemon.batch.paths import StatePaths
from daemon.model.search import SearchTask
from daemon.model.search_answer import (
    LONGEST_NOTE,
    SearchAnswer,
    SearchProgress,
    SearchRow,
    SearchState,
)
from daemon.model.status import ChangeEvent
from daemon.search.execution.daemon_runs import (
    DaemonRuns,
    PatientClient,
    SearchDivergedError,
)
from daemon.search.execution.runs import Runs, SearchStoppedError
from grammars.text.diagnostics import InputError

Searcher: TypeAlias = Callable[[Path, str, SearchTask, Runs], SearchAnswer]
"""Runs the program of a search: the folder of its files, the name of its campaign file among them,
what is asked, and who executes its runs."""

_LOOK_EVERY: Final = 5.0
"""Seconds between two looks for searches, besides those that events cause."""
_STEERED: Final = frozenset({"submitted", "retried", "cancelled", "deleted"})
_LOADING: Final = threading.Lock()
"""One campaign is read at a time."""


def run_program(folder: Path, file: str, task: SearchTask, runs: Runs) -> SearchAnswer:
    """Run the program of a search on what its campaign file says."""
    from daemon.search.preparation.composition import load_search_case
    from daemon.search.program import run_search

    with _LOADING:
        # Its files may be somebody else's, who has a key and no account here.
        case = load_search_case(folder / file, task.name, task, only_in=folder)
    return run_search(case, runs)


def load_searcher(name: str) -> Searcher:
    """Return the function called ``module:function``."""
    module, _, function = name.partition(":")
    searcher: Searcher = getattr(import_module(module), function)
    return searcher


class Coordinator:
    """Runs the program of every search that is running, until none is."""

    def __init__(self, client: Client, paths: StatePaths, searcher: Searcher) -> None:
        self._client = PatientClient(client)
        self._paths = paths
        self._searcher = searcher
        self._steered = threading.Event()
        self._lock = threading.Lock()
        self._searches: dict[str, _ProgramThread] = {}

    def run(self) -> None:
        """Look for searches and run them; returns when there is none."""
        with self._client.client.events(self._on_event):
            while True:
                self._steered.clear()
                rows = {row.campaign: row for row in self._client.running_searches()}
                with self._lock:
                    ended = [name for name, one in self._searches.items() if one.over]
                    for name in ended:
                        del self._searches[name]
                    for name in rows.keys() - self._searches.keys():
                        self._searches[name] = self._start(rows[name])
                    if not self._searches:
                        return
                self._steered.wait(_LOOK_EVERY)

    def _start(self, row: SearchRow) -> _ProgramThread:
        folder = self._paths.search(row.campaign)
        search = _ProgramThread(self._client, row, folder, self._searcher, self._steered.set)
        search.start()
        return search

    def _on_event(self, event: ChangeEvent) -> None:
        if event.kind == "campaign" and event.state in _STEERED:
            self._steered.set()
        with self._lock:
            search = self._searches.get(event.campaign)
        if search is not None:
            search.runs.note_event(event)


class _ProgramThread(threading.Thread):
    """The program of one search."""

    def __init__(
        self,
        client: PatientClient,
        row: SearchRow,
        folder: Path,
        searcher: Searcher,
        ended: Callable[[], None],
    ) -> None:
        super().__init__(name=f"search {row.campaign}", daemon=True)
        self._client = client
        self._row = row
        self._folder = folder
        self._searcher = searcher
        self._ended = ended
        self.runs = DaemonRuns(client, row)
        self.over = False

    def run(self) -> None:
        """Run the program; how it ended is in the ledger afterwards."""
        try:
            self._report(*self._search())
        except DaemonError as error:
            # It was ended, or deleted, in that very moment.
            print(f"{self._row.campaign}: {error}", file=sys.stderr)
        finally:
            self.over = True
            self._ended()

    def _search(self) -> tuple[SearchState, str, SearchAnswer | None]:
        """Return how the search ended, why if it failed, and what it has found."""
        try:
            self.runs.load()
            answer = self._searcher(self._folder, self._row.file, self._row.task, self.runs)
        except SearchStoppedError as stopped:
            return "cancelled", "", stopped.answer
        except (InputError, SearchDivergedError, DaemonError) as error:
            return "failed", str(error), None
        except Exception as error:
            # Whatever the program has run into, it would again; search.log has the rest.
            traceback.print_exc()
            words = f"the search broke: {type(error).__name__}: {error}"
            return "failed", f"{words} (search.log in the state directory has more)", None
        return "finished", "", answer

    def _report(self, state: SearchState, note: str, answer: SearchAnswer | None) -> None:
        if state != "cancelled" and not self.runs.is_wanted():
            # It was cancelled in that very moment, or deleted and submitted again: then this is
            # refused, and not taken for the end of the new one.
            state = "cancelled"
        progress = SearchProgress(
            self._row.campaign, self.runs.phase, note[:LONGEST_NOTE], state, answer
        )
        self._client.report(progress)
