"""Charts: Vega-Lite specifications as plain dicts, drawn as SVG, interactive on a page.

A chart names the colours of the page, ``var(--line)``, so it follows the theme of the reader. Its
layers called :data:`HOVER` are for the interactive chart only. A drawing without scripts, as on
paper, leaves them out.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib import metadata
from typing import Any, Final, TypeAlias

from markupsafe import Markup, escape

from daemon.analysis.parallel_map import parallel_map
from daemon.model.execution import available_cores
from grammars.text.files import user_folder, write_atomically
from templates.naming import xml_text
from templates.report import OURS

Chart: TypeAlias = dict[str, Any]
"""A specification of Vega-Lite, https://vega.github.io/vega-lite/docs/."""
Table: TypeAlias = Mapping[str, Sequence[Any]]
"""Columns (n,) each by name."""

HOVER: Final = "hover"
"""Beginning of the names of layers that show marks only under the pointer."""
SERIES: Final = tuple(f"var(--s{number})" for number in range(8))
"""Colours of scenarios or systems under test side by side, in this order."""
_FOR_ANOTHER: Final = 10
"""Charts per process: the start of Vega takes as long as ten charts."""
WIDTH: Final = 290
"""Width of the plot of a chart that stands beside others [px]."""
AXIS: Final = {"minExtent": 28, "tickCount": 3}
"""Axis of values, so wide that stacked panels begin at one line, unless a number is long."""
INK, SOFT, LINE, SECOND = "var(--ink)", "var(--soft)", "var(--line)", "var(--second)"
BAD, NEAR, BODY = "var(--bad)", "var(--near)", "var(--body)"
DASHED: Final = [4, 3]
DOTTED: Final = [1, 1.6]
THEME: Final[Mapping[str, Any]] = {
    "aria": False,
    "font": "sans-serif",
    "background": None,
    "numberFormat": "~f",
    "padding": 2,
    "view": {"stroke": None},
    "axis": {
        "domainColor": "var(--rule)",
        "gridColor": "var(--rule)",
        "gridWidth": 0.5,
        "labelColor": "var(--soft)",
        "labelFontSize": 9,
        "labelLimit": 180,
        "ticks": False,
        "titleAnchor": "start",
        "titleColor": "var(--soft)",
        "titleFontSize": 10,
        "titleFontWeight": "normal",
    },
    "axisX": {"grid": False},
    "legend": {
        "labelColor": "var(--soft)",
        "labelFontSize": 9,
        "labelLimit": 160,
        "offset": 5,
        "orient": "top",
        "rowPadding": 0,
        "symbolOpacity": 1,
        "symbolSize": 30,
        "title": None,
    },
    "title": {
        "anchor": "start", "color": "var(--soft)", "fontSize": 10, "fontWeight": "normal",
        "offset": 3,
    },
    "text": {"color": "var(--ink)", "fontSize": 9},
}  # fmt: skip
_VERSION: Final = "6.1"
_PLACE: Final = re.compile(r' (?:d|transform|x2?|y2?)="[^"]*"')
_LONG_DECIMAL: Final = re.compile(r"-?\d+\.\d{2,}")
_UNUSED: Final = re.compile(
    r' (?:class|pointer-events|cursor|aria-\w+|role|version|xmlns:xlink|font-family)="[^"]*"'
    r'| opacity="1"| font-weight="normal"| transform="translate\(0,0\)"| [xy]2="0"'
)
_INVISIBLE: Final = re.compile(
    r'<path(?: transform="[^"]*")? d="(?:[^"]*"(?: display="none")?|M0,0h0v0h0Z"[^>]*)/>'
)
_CLIP: Final = re.compile(r'(id="|url\(#)(clip\d+)')
_COLOUR: Final = re.compile(r"--(\w+): (#\w+);")
_VARIABLE: Final = re.compile(r"var\(--([\w-]+),?([^)]*)\)")
_NAMESPACE: Final = ' xmlns="http://www.w3.org/2000/svg"'


def table(columns: Table) -> dict[str, Any]:
    """Return columns as the ``data`` of a chart, more compact than rows.

    Numbers keep four significant digits; None, NaN and infinity become null.
    """
    return {"values": {name: list(map(_cell, column)) for name, column in columns.items()}}


def _cell(value: Any) -> Any:
    if value is None or isinstance(value, str):
        return value
    number = float(f"{value:.4g}")
    if not math.isfinite(number):
        return None
    return int(number) if number.is_integer() else number


def columns_of(names: Iterable[str], rows: Sequence[tuple[Any, ...]]) -> dict[str, list[Any]]:
    """Return ``rows`` as columns."""
    return {name: [row[place] for row in rows] for place, name in enumerate(names)}


def layer(
    kind: str, columns: Table | None, encoding: Chart, *, name: str = "", **look: Any
) -> Chart:
    """Return a layer of marks of one ``kind`` and ``look``.

    It shows the rows of ``columns``, or with ``None`` those of the whole chart. With empty columns
    it shows ``encoding`` once.
    """
    part: Chart = {"name": name} if name else {}
    if columns is not None:
        part["data"] = table(columns) if columns else {"values": [{}]}
    return part | {"mark": {"type": kind, **look}, "encoding": encoding}


def quantity(field: str, title: str = "", *, domain: Any = None, **options: Any) -> Chart:
    """Return the encoding of a number, on an axis that shows exactly ``domain``."""
    if domain is not None:
        options["scale"] = {"domain": domain, "nice": False, "zero": False}
    return {"field": field, "type": "quantitative", "title": title or None, **options}


def colours_of(
    field: str, names: Sequence[str], colours: Sequence[str], width: int = WIDTH
) -> Chart:
    """Return the encoding of ``names`` by ``colours``, which repeat after the last one.

    The legend has as many columns as fit into ``width``.
    """
    scale = {"domain": names, "range": [colours[n % len(colours)] for n in range(len(names))]}
    columns = max(width // (5 * max(map(len, names)) + 28), 1)
    return {"field": field, "type": "nominal", "scale": scale, "legend": {"columns": columns}}


def legend(field: str, *views: str) -> list[Chart]:
    """Return the parameter for clicks on the legend, which show one entry alone."""
    select = {"type": "point", "fields": [field]}
    return [{"name": "legend", "select": select, "bind": "legend", "views": views}]


def legend_opacity(opacity: float, other: float = 0.05) -> Chart:
    """Return the encoding of marks that a click on the legend dims to ``other``."""
    return {"condition": {"param": "legend", "value": opacity}, "value": other}


def tooltip(about: Mapping[str, str]) -> list[Chart]:
    """Return the encoding of a tooltip with fields and their titles."""
    return [{"field": field, "title": title} for field, title in about.items()]


def hover_layer(
    title: str, place: Chart, about: Mapping[str, str], fields: Sequence[str], *, clip: bool = False
) -> Chart:
    """Return a layer that shows the point nearest to the pointer, with a tooltip."""
    near = {"type": "point", "on": "pointerover", "clear": "pointerout", "nearest": True}
    opacity = {"condition": {"param": "near", "empty": False, "value": 1}, "value": 0}
    encoding = {**place, "opacity": opacity, "tooltip": tooltip(about)}
    points = layer("circle", None, encoding, name=f"{HOVER} {title}", color=INK, size=30, clip=clip)
    return points | {"params": [{"name": "near", "select": {**near, "fields": fields}}]}


def draw_charts(charts: Sequence[Chart], *, processes: int | None = None) -> list[str]:
    """Return each chart as an ``<svg>`` element, in order; draw all charts of a page at once.

    Child processes draw them, never this one: Vega runs in threads, after which a process can no
    longer be forked.
    """
    doing = "that draws charts"
    numbered = list(enumerate(charts))
    count = min(processes or available_cores(), math.ceil(len(charts) / _FOR_ANOTHER))
    return list(parallel_map(_draw, numbered, doing=doing, processes=count, always_forked=True))


@cache
def page_script() -> str:
    """Return Vega, Vega-Lite and Vega-Embed as one script for a page that needs no network.

    The theme of all charts, ``chartTheme``, is a part of it. Bundling takes over a second, so the
    script of a version is kept in the user's cache.
    """
    version = metadata.version("vl-convert-python")
    cached = user_folder("cache") / f"vega-{version}.js"
    try:
        script = cached.read_text(encoding="utf-8")
    except OSError:
        (script,) = parallel_map(_bundle, ("",), doing="that bundles Vega", always_forked=True)
        # If the cache is not writable, the next page bundles it again.
        with suppress(OSError):
            cached.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(cached, script.encode(), durable=False)
    return f"{script}window.chartTheme = {json.dumps(THEME)};"


def standalone_svg(svg: str) -> str:
    """Return a drawing of a page as a file of its own, in the colours of light paper."""
    style = (OURS / "report.css").read_text(encoding="utf-8")
    light = dict(_COLOUR.findall(style.partition("}")[0]))
    coloured = _VARIABLE.sub(lambda name: light.get(name[1]) or name[2], svg)
    root = '<svg xmlns="http://www.w3.org/2000/svg" font-family="sans-serif" '
    return coloured.replace(_NAMESPACE, "").replace("<svg ", root, 1)


def svg_pdf(svg: str) -> bytes:
    """Return a drawing of a page as PDF, in the colours of light paper."""
    import vl_convert

    return vl_convert.svg_to_pdf(standalone_svg(svg))


def chart_figure(chart: Chart, svg: str, label: str, *, cell: str = "") -> Markup:
    """Return a drawn chart with its specification, which scripts of the page make interactive.

    ``label`` is for screen readers. Charts and maps of one ``cell`` react together to the pointer
    and to brushing.
    """
    # Within a script element only its end tag and a comment would be read as markup.
    text = xml_text(json.dumps(chart, ensure_ascii=False, separators=(",", ":")))
    text = text.replace("<", "\\u003c")
    label, cell = escape(xml_text(label)), escape(xml_text(cell))
    about = f'role="img" aria-label="{label}" data-cell="{cell}"'
    script = f'<script type="application/json">{text}</script>'
    return Markup(f'<div class="chart" {about}>{svg}{script}</div>')


def _draw(numbered: tuple[int, Chart]) -> str:
    import vl_convert

    number, chart = numbered
    themed = {**_static(chart), "config": THEME}
    svg = vl_convert.vegalite_to_svg(themed, vl_version=_VERSION)
    svg = _PLACE.sub(lambda place: _LONG_DECIMAL.sub(_one_digit, place[0]), svg)
    # Drawings are the larger part of a page: leave out invisible parts and the page's own font.
    svg = _INVISIBLE.sub("", _UNUSED.sub("", svg))
    # Names of clips hold in the whole page, and their numbers depend on earlier drawings.
    names = list(dict.fromkeys(clip[2] for clip in _CLIP.finditer(svg)))
    return _CLIP.sub(lambda clip: f"{clip[1]}c{number}-{names.index(clip[2])}", svg)


def _one_digit(number: re.Match[str]) -> str:
    return f"{float(number[0]):.1f}".removesuffix(".0")


def _bundle(_: str) -> str:
    import vl_convert

    # Its stub does not say that the snippet may be left out.
    return str(vl_convert.javascript_bundle(vl_version=_VERSION))  # type: ignore[call-arg]


def _static(chart: Any) -> Any:
    """Return a chart, or a part of it, for Vega: rows instead of columns, no hover layers."""
    if isinstance(chart, dict):
        return {
            key: _static(_rows(value) if key == "values" else value) for key, value in chart.items()
        }
    if isinstance(chart, list):
        return [
            _static(part)
            for part in chart
            if not (isinstance(part, dict) and str(part.get("name", "")).startswith(HOVER))
        ]
    # Vega itself would crash on a character that SVG cannot contain.
    return xml_text(chart) if isinstance(chart, str) else chart


def _rows(values: Any) -> Any:
    """Return the rows of columns from :func:`table`; rows stay unchanged."""
    if not isinstance(values, dict):
        return values
    return [dict(zip(values, row, strict=True)) for row in zip(*values.values(), strict=True)]
