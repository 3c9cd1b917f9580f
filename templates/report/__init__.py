"""The report of a campaign as one HTML file: its template and its style."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import jinja2

from templates.naming import xml_text

OURS: Final = Path(__file__).parent


def render_report(filters: Mapping[str, Callable[..., Any]], **values: Any) -> str:
    """Return the page filled with ``values``, whatever is put in escaped.

    Only what is :class:`markupsafe.Markup` (figures drawn here) goes in as it is. Names missing in
    the template are errors; characters no document can hold are replaced.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(OURS),
        undefined=jinja2.StrictUndefined,
        autoescape=True,
        finalize=lambda value: xml_text(value) if type(value) is str else value,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(filters)
    return environment.get_template("report.html.j2").render(values)
