"""Reports: what the traces of a campaign say, for people and for machines."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Final

from daemon.analysis.report._input import (
    ReportInput,
    campaign_input,
    folder_input,
    ledger_input,
    local_record,
    open_ledger,
    read_campaign_note,
    write_campaign_note,
)

if TYPE_CHECKING:
    from daemon.analysis.report._axes import Axes, Sheet
    from daemon.analysis.report._data import ReportData, ReportRun, read_report_data
    from daemon.analysis.report._exports import COLUMNS, write_csv, write_parquet
    from daemon.analysis.report._formatting import GLYPHS, mean_and_deviation, verdict_details
    from daemon.analysis.report._junit import write_junit
    from daemon.analysis.report._measures import MEASURES
    from daemon.analysis.report._page import SuggestedCommand, headline, write_page
    from daemon.analysis.report._recorded_run import plot_recorded_way
    from daemon.analysis.report._run_picture import draw_moment, draw_run
    from daemon.analysis.report._safety_buffer import oracle_limit, safety_buffer
    from daemon.analysis.report._svg import PagePicture
    from daemon.analysis.report._tracks import thinned_indices

__all__ = [
    "COLUMNS",
    "GLYPHS",
    "MEASURES",
    "Axes",
    "PagePicture",
    "ReportData",
    "ReportInput",
    "ReportRun",
    "Sheet",
    "SuggestedCommand",
    "campaign_input",
    "draw_moment",
    "draw_run",
    "folder_input",
    "headline",
    "ledger_input",
    "local_record",
    "mean_and_deviation",
    "open_ledger",
    "oracle_limit",
    "plot_recorded_way",
    "read_campaign_note",
    "read_report_data",
    "safety_buffer",
    "thinned_indices",
    "verdict_details",
    "write_campaign_note",
    "write_csv",
    "write_junit",
    "write_page",
    "write_parquet",
]

_MODULES: Final = {
    "_axes": ("Axes", "Sheet"),
    "_data": ("ReportData", "ReportRun", "read_report_data"),
    "_exports": ("COLUMNS", "write_csv", "write_parquet"),
    "_formatting": (
        "GLYPHS",
        "mean_and_deviation",
        "verdict_details",
    ),
    "_junit": ("write_junit",),
    "_page": ("SuggestedCommand", "headline", "write_page"),
    "_recorded_run": ("plot_recorded_way",),
    "_run_picture": ("draw_moment", "draw_run"),
    "_safety_buffer": ("oracle_limit", "safety_buffer"),
    "_svg": ("PagePicture",),
    "_measures": ("MEASURES",),
    "_tracks": ("thinned_indices",),
}


def __getattr__(name: str) -> object:
    """Load what judges, draws and writes only when it is asked for.

    ``scenario run`` and ``scenario compare`` take notes and ledgers from here and never draw.
    """
    for module, names in _MODULES.items():
        if name in names:
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
