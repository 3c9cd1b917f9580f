"""The results of a campaign as JSON, and read back for comparing them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

from daemon.assessment import Between, Declared, Judged, RunRecord
from grammars import codec
from grammars.diagnostics import Diagnostic, InputError, Where
from scenario_tui.cli._output import emit
from scenario_tui.summary import Results

SCHEMA: Final = "scenario/results/1"


def emit_results(results: Results, comparison: Between | None = None) -> None:
    """Write everything about a campaign as one JSON object, with what it was held against."""
    emit(
        "results",
        campaign=results.row,
        declared=results.declared,
        assessment=results.assessment,
        runs=list(results.rows),
        records=list(results.records),
        comparison=comparison,
    )


def read_results(path: Path) -> Judged:
    """Read what ``--json`` wrote; raises :class:`InputError` for anything else."""
    where = Where(str(path))
    try:
        body = json.loads(path.read_text(encoding="utf-8"))
        if body["schema"] != SCHEMA:
            raise ValueError(f"it holds {body['schema']}")
        declared = codec.from_plain(Declared, body["declared"])
        records = codec.from_plain(tuple[RunRecord, ...], body["records"])
        return Judged(str(body["campaign"]["id"]), declared, records)
    except OSError as error:
        message = f"cannot be read: {error.strerror}"
        raise InputError(Diagnostic(where, message)) from error
    except (ValueError, KeyError, TypeError) as error:
        hint = "write one with: scenario results CAMPAIGN --json"
        raise InputError(Diagnostic(where, "is no file of results", hint)) from error
