"""Reports about the traces of a campaign, for people and for machines."""

from daemon.analysis.report._data import ReportData, ReportRun, read_report_data, report_table
from daemon.analysis.report._junit import write_junit
from daemon.analysis.report._measures import MEASURES
from daemon.analysis.report._page import (
    GLYPHS,
    SuggestedCommand,
    headline,
    spread_text,
    verdict_details,
    write_page,
)
from daemon.analysis.report._safety_buffer import oracle_limit, safety_buffer
from daemon.analysis.report._tracks import thinned_indices

__all__ = [
    "GLYPHS",
    "MEASURES",
    "ReportData",
    "ReportRun",
    "SuggestedCommand",
    "headline",
    "oracle_limit",
    "read_report_data",
    "report_table",
    "safety_buffer",
    "spread_text",
    "thinned_indices",
    "verdict_details",
    "write_junit",
    "write_page",
]
