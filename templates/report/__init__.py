"""The reports of a campaign and of a search as HTML files: their templates and their style."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import jinja2

from templates.rendering import strict_environment

OURS: Final = Path(__file__).parent


def render_report(filters: Mapping[str, Callable[..., Any]], **values: Any) -> str:
    """Return the page of a campaign filled with ``values``, whatever is put in escaped.

    Only what is :class:`markupsafe.Markup` (figures drawn here) goes in as it is. Names missing in
    the template are errors; characters no document can hold are replaced.
    """
    return _render("report.html.j2", filters, values)


def render_search_report(filters: Mapping[str, Callable[..., Any]], **values: Any) -> str:
    """Return the page of a search, as :func:`render_report` does that of a campaign."""
    return _render("search.html.j2", filters, values)


def _render(
    template: str, filters: Mapping[str, Callable[..., Any]], values: Mapping[str, Any]
) -> str:
    environment = strict_environment(jinja2.FileSystemLoader(OURS), autoescape=True)
    environment.filters.update(filters)
    return environment.get_template(template).render(values)
