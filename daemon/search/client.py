"""A search run by its client: the program in this process, its runs in a daemon.

The program of a search is plain code that always runs from its beginning. The ledger returns
existing runs at once, so a search continues after any end.
"""

from __future__ import annotations

import os
import secrets
import socket
import threading
import traceback
from collections.abc import Callable
from contextlib import suppress
from typing import Final, TypeAlias

from daemon.batch.client import Client
from daemon.batch.errors import DaemonError, Refused
from daemon.model.search import SearchSubmission
from daemon.model.search_answer import SearchAnswer, SearchQuery, SearchRow, SearchState
from daemon.model.verbs import SEARCH, SEARCHES
from daemon.search.daemon_runs import (
    DaemonRuns,
    PatientClient,
    SearchDivergedError,
    SearchStoppedError,
)
from grammars.text.diagnostics import InputError

SearchProgram: TypeAlias = Callable[[DaemonRuns], SearchAnswer]

_LOOK_EVERY: Final = 0.5
"""Seconds between two checks whether another client still runs the search."""
_LAST_MOMENT: Final = 5.0
"""Longest wait [s] for the program to reach its next question after :meth:`SearchClient.leave`."""


def client_name() -> str:
    """Return a unique name of this process for daemons."""
    return f"{socket.gethostname()}-{os.getpid()}-{secrets.token_hex(4)}"


class SearchClient(threading.Thread):
    """Runs the program of a search that has begun, as soon as no other client does.

    This thread calls ``program`` and closes the connection to the ``daemon`` at the end. The ledger
    then contains the ending of the search.
    """

    def __init__(self, daemon: Client, search: SearchSubmission, program: SearchProgram) -> None:
        super().__init__(name=f"search {search.campaign}", daemon=True)
        self._daemon = daemon
        self._search = search
        self._program = program
        self._runs: DaemonRuns | None = None
        self._leaving = threading.Event()

    def leave(self) -> None:
        """Let the search wait for another client; any other thread may call this."""
        self._leaving.set()
        if self._runs is not None:
            self._runs.leave()
        self.join(_LAST_MOMENT)

    def run(self) -> None:
        """Wait until no other client runs the search, and run it to its end."""
        with self._daemon as client:
            daemon = PatientClient(client)
            row = self._wait_for_turn(daemon)
            if row is None:
                return
            self._runs = runs = DaemonRuns(daemon, row.campaign, row.client, row.submitted_at)
            if self._leaving.is_set():
                runs.leave()
            with client.events(runs.note_event):
                ending = self._run_program(runs)
            # It may have been ended or deleted at this moment.
            with suppress(Refused):
                runs.end(*ending)

    def _wait_for_turn(self, daemon: PatientClient) -> SearchRow | None:
        while True:
            rows = daemon.ask(SEARCHES, SearchQuery(self._search.campaign))
            if not rows or rows[0].ended:
                return None
            if rows[0].client == self._search.client:
                return rows[0]
            if self._leaving.is_set():
                return None
            if rows[0].state == "waiting":
                daemon.ask(SEARCH, self._search)
            else:
                self._leaving.wait(_LOOK_EVERY)

    def _run_program(self, runs: DaemonRuns) -> tuple[SearchState, str, SearchAnswer | None]:
        """Return how the search ended, the reason of a failure, and the answer."""
        try:
            runs.load()
            return "finished", "", self._program(runs)
        except SearchStoppedError as stopped:
            return "waiting" if self._leaving.is_set() else "cancelled", "", stopped.answer
        except (InputError, SearchDivergedError, DaemonError) as error:
            return "failed", str(error), None
        except Exception as error:
            # A new attempt would meet the same problem.
            traceback.print_exc()
            return "failed", f"the search broke: {type(error).__name__}: {error}", None
