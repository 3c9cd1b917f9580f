"""Charts: Vega-Lite specifications as plain dicts, drawn as SVG and shown alive by a page.

A chart names the colours of the page, ``var(--line)``, so it follows the theme of the reader. Its
layers called :data:`HOVER` and its parameters are for the live chart only: what is drawn without
scripts, on paper too, leaves them out.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache, partial
from typing import Any, Final, TypeAlias

from markupsafe import Markup, escape

from daemon.analysis.parallel_map import parallel_map

Chart: TypeAlias = dict[str, Any]
"""A specification of Vega-Lite, https://vega.github.io/vega-lite/docs/."""

HOVER: Final = "hover"
"""Name of layers that show their marks under the pointer only."""
SERIES: Final = tuple(f"var(--s{number})" for number in range(8))
"""Colours of scenarios or systems under test side by side, in this order."""
THEME: Final[Mapping[str, Any]] = {
    "font": "sans-serif",
    "background": None,
    "padding": 2,
    "view": {"stroke": None},
    "axis": {
        "domainColor": "var(--rule)",
        "gridColor": "var(--rule)",
        "gridWidth": 0.5,
        "labelColor": "var(--soft)",
        "labelFontSize": 9,
        "ticks": False,
        "titleAnchor": "start",
        "titleColor": "var(--soft)",
        "titleFontSize": 10,
        "titleFontWeight": "normal",
    },
    "header": {"labelColor": "var(--soft)", "titleColor": "var(--soft)"},
    "legend": {
        "labelColor": "var(--soft)",
        "labelFontSize": 9,
        "orient": "top",
        "titleColor": "var(--soft)",
        "titleFontSize": 9,
        "titleFontWeight": "normal",
    },
    "title": {"color": "var(--soft)", "fontSize": 10, "fontWeight": "normal", "anchor": "start"},
    "range": {"category": list(SERIES)},
    "text": {"color": "var(--ink)", "fontSize": 9},
}
_VERSION: Final = "6.1"
_LONG_DECIMAL: Final = re.compile(r"-?\d+\.\d{2,}")


def table(columns: Mapping[str, Sequence[Any]], digits: int = 4) -> dict[str, Any]:
    """Return columns (n,) each as the ``data`` of a chart: compact, numbers rounded.

    Numbers keep ``digits`` significant digits; not a number is an empty cell, which is null.
    Texts must not be more than one line.
    """
    cells = (map(partial(_cell, digits=digits), values) for values in columns.values())
    lines = "\n".join(",".join(row) for row in zip(*cells, strict=True))
    kinds = {
        name: "string" if any(isinstance(value, str) for value in values) else "number"
        for name, values in columns.items()
    }
    text = f"{','.join(columns)}\n{lines}"
    return {"values": text, "format": {"type": "csv", "parse": kinds}}


def _cell(value: Any, digits: int) -> str:
    if isinstance(value, str):
        return '"' + value.replace('"', '""') + '"'
    return "" if value != value else f"{value:.{digits}g}"


def draw_charts(charts: Sequence[Chart], *, processes: int | None = None) -> list[str]:
    """Return each chart as an ``<svg>`` element, in order.

    They are drawn in child processes, never in this one: Vega runs in threads, and a process with
    these could not be forked any more.
    """
    doing = "that draws charts"
    return list(parallel_map(_draw, charts, doing=doing, processes=processes, always_forked=True))


@cache
def page_script() -> str:
    """Return Vega, Vega-Lite and Vega-Embed as one script for a page that needs no network."""
    (script,) = parallel_map(_bundle, ("",), doing="that bundles Vega", always_forked=True)
    return script


def chart_figure(chart: Chart, svg: str, label: str) -> Markup:
    """Return a drawn chart with its specification, which scripts of the page bring to life.

    ``label`` is read out where pictures are not seen.
    """
    # Within a script element only its own end, and what looks like a comment, would be read.
    specification = json.dumps(_themed(chart), ensure_ascii=False).replace("<", "\\u003c")
    return Markup(
        f'<div class="chart" role="img" aria-label="{escape(label)}">{svg}'
        f'<script type="application/json">{specification}</script></div>'
    )


def _draw(chart: Chart) -> str:
    import vl_convert

    svg = vl_convert.vegalite_to_svg(_themed(_static(chart)), vl_version=_VERSION)
    return _LONG_DECIMAL.sub(lambda found: f"{float(found[0]):.1f}".removesuffix(".0"), svg)


def _bundle(_: str) -> str:
    import vl_convert

    # Its stub does not say that the snippet may be left out.
    return str(vl_convert.javascript_bundle(vl_version=_VERSION))  # type: ignore[call-arg]


def _themed(chart: Chart) -> Chart:
    return {**chart, "config": {**THEME, **chart.get("config", {})}}


def _static(chart: Any) -> Any:
    """Return a chart, or a part of it, without what only answers to a pointer."""
    if isinstance(chart, dict):
        return {key: _static(value) for key, value in chart.items() if key != "params"}
    if isinstance(chart, list):
        parts: Iterable[Any] = chart
        return [
            _static(part)
            for part in parts
            if not (isinstance(part, dict) and part.get("name") == HOVER)
        ]
    return chart
