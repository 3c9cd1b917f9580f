"""The page of a search: its answer, with figures of where and how near it fails."""

from daemon.search.page._figures import search_figures
from daemon.search.page._page import search_page

__all__ = ["search_figures", "search_page"]
