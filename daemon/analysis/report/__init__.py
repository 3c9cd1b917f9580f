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

_MODULES: Final = {
    "COLUMNS": "_exports",
    "MEASURES": "_tracks",
    "ReportData": "_data",
    "ReportInput": "_input",
    "ReportRun": "_data",
    "RunMeasure": "_tracks",
    "RunTracks": "_input",
    "SuggestedCommand": "_page",
    "draw_run": "_run_picture",
    "headline": "_page",
    "read_report_data": "_data",
    "write_csv": "_exports",
    "write_junit": "_exports",
    "write_page": "_page",
    "write_parquet": "_exports",
}


def __getattr__(name: str) -> object:
    """Load what judges, draws and writes only when it is asked for."""
    if name in _MODULES:
        return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
