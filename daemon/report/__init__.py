"""Reports: what the traces of a campaign say, for people and for machines."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Final

from daemon.report._chosen import (
    NOTE,
    assembled,
    folder_of_traces,
    leave_note,
    open_ledger,
    recorded,
)

if TYPE_CHECKING:
    from daemon.report._gather import Gathered, Material, gather
    from daemon.report._junit import write_junit
    from daemon.report._page import Command, answer, write_page
    from daemon.report._picture import draw_run
    from daemon.report._series import MEASURES, Measure
    from daemon.report._tables import COLUMNS, write_csv, write_parquet
    from daemon.report._types import Chosen, Driven

__all__ = [
    "COLUMNS",
    "MEASURES",
    "NOTE",
    "Chosen",
    "Command",
    "Driven",
    "Gathered",
    "Material",
    "Measure",
    "answer",
    "assembled",
    "draw_run",
    "folder_of_traces",
    "gather",
    "leave_note",
    "open_ledger",
    "recorded",
    "write_csv",
    "write_junit",
    "write_page",
    "write_parquet",
]

_ROOMS: Final = {
    "_gather": ("Gathered", "Material", "gather"),
    "_junit": ("write_junit",),
    "_page": ("Command", "answer", "write_page"),
    "_picture": ("draw_run",),
    "_series": ("MEASURES", "Measure"),
    "_tables": ("COLUMNS", "write_csv", "write_parquet"),
    "_types": ("Chosen", "Driven"),
}


def __getattr__(name: str) -> object:
    """Load what judges, draws and writes only when it is asked for."""
    for room, names in _ROOMS.items():
        if name in names:
            return getattr(import_module(f"daemon.report.{room}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
