"""The one recorded run a command is about."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from pathlib import Path

    from daemon.places import Places


def one_trace(run: str, places: Places, hint: str) -> Path:
    """Return the trace of a run named by its id or as a file; wrong usage for none or several.

    ``hint`` is the parameter the words came from.
    """
    from daemon.rejudge import find_traces

    try:
        run = _id_of(run, places)
        traces = find_traces([run], places)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint=hint) from error
    if len(traces) != 1:
        message = f"{run} means {len(traces)} traces, name one of them"
        raise typer.BadParameter(message, param_hint=hint)
    return traces[0]


def _id_of(run: str, places: Places) -> str:
    """Return the id of a run named by its campaign and number, a file as it is.

    Raises ``ValueError`` for what names neither.
    """
    from pathlib import Path

    from daemon.errors import Refused
    from daemon.report import open_ledger
    from scenario_tui.cli._session import find_run

    if Path(run).exists() or run.endswith(".mcap") or not places.ledger.is_file():
        return run
    try:
        with open_ledger(places) as ledger:
            return find_run(ledger, run).row.id
    except Refused as error:
        raise ValueError(f"{run} is no trace (.mcap) and no run: {error}") from error
