"""Reports about the traces of a campaign, for people and for machines."""

from daemon.analysis.report._data import ReportRun, read_report_data, report_table
from daemon.analysis.report._junit import write_junit
from daemon.analysis.report._page import GLYPHS, headline, write_page

__all__ = [
    "GLYPHS",
    "ReportRun",
    "headline",
    "read_report_data",
    "report_table",
    "write_junit",
    "write_page",
]
