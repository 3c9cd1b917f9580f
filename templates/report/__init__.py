"""The report of a campaign as one HTML file: its template and its style."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import jinja2

from templates.rendering import strict_environment

OURS: Final = Path(__file__).parent


def render_report(filters: Mapping[str, Callable[..., Any]], **values: Any) -> str:
    """Return the page filled with ``values``, whatever is put in escaped.

    Only what is :class:`markupsafe.Markup` (figures drawn here) goes in as it is. Names missing in
    the template are errors; characters no document can hold are replaced.
    """
    environment = strict_environment(jinja2.FileSystemLoader(OURS), autoescape=True)
    environment.filters.update(filters)
    return environment.get_template("report.html.j2").render(values)
