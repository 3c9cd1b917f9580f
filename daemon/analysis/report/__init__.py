"""Reports: what the traces of a campaign say, for people and for machines."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Final

from daemon.analysis.report._input import (
    NOTE,
    campaign_input,
    folder_input,
    ledger_input,
    open_ledger,
    write_campaign_note,
)

if TYPE_CHECKING:
    from daemon.analysis.report._data import ReportData, ReportRun, read_report_data
    from daemon.analysis.report._exports import COLUMNS, write_csv, write_junit, write_parquet
    from daemon.analysis.report._input import ReportInput, RunTracks
    from daemon.analysis.report._page import SuggestedCommand, headline, write_page
    from daemon.analysis.report._run_picture import draw_run
    from daemon.analysis.report._tracks import MEASURES, RunMeasure

__all__ = [
    "COLUMNS",
    "MEASURES",
    "NOTE",
    "ReportData",
    "ReportInput",
    "ReportRun",
    "RunMeasure",
    "RunTracks",
    "SuggestedCommand",
    "campaign_input",
    "draw_run",
    "folder_input",
    "headline",
    "ledger_input",
    "open_ledger",
    "read_report_data",
    "write_campaign_note",
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
            return getattr(import_module(f"daemon.analysis.report.{room}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
