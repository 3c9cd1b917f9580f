"""The page of a search: its answer, with figures of where and how near it fails."""

from daemon.search.page._figures import PairFigure, search_figures, told_point
from daemon.search.page._page import SearchHeadline, search_headline, search_page

__all__ = [
    "PairFigure",
    "SearchHeadline",
    "search_figures",
    "search_headline",
    "search_page",
    "told_point",
]
