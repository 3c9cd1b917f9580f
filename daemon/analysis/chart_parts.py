"""Parts of charts: layers of marks, their encodings, and parameters that answer to a pointer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, TypeAlias

from daemon.analysis.charts import HOVER, Chart, table

Table: TypeAlias = Mapping[str, Sequence[Any]]
"""Columns (n,) each by name."""

WIDTH: Final = 290
"""Width of the plot of a chart that stands beside others [px]."""
AXIS: Final = {"minExtent": 28, "tickCount": 3}
"""Axis of values: panels above each other begin at one line, unless a number is long."""
INK, SOFT, LINE, SECOND = "var(--ink)", "var(--soft)", "var(--line)", "var(--second)"
BAD, NEAR, BODY = "var(--bad)", "var(--near)", "var(--body)"
DASHED: Final = [4, 3]
DOTTED: Final = [1, 1.6]


def columns_of(names: Iterable[str], rows: Sequence[tuple[Any, ...]]) -> dict[str, list[Any]]:
    """Return ``rows`` as columns."""
    return {name: [row[place] for row in rows] for place, name in enumerate(names)}


def layer(
    kind: str, columns: Table | None, encoding: Chart, *, name: str = "", **look: Any
) -> Chart:
    """Return a layer of marks of one ``kind`` and ``look``.

    It shows the rows of ``columns``, and with ``None`` those of the whole chart. Without columns it
    shows once what ``encoding`` says.
    """
    part: Chart = {"name": name} if name else {}
    if columns is not None:
        part["data"] = table(columns) if columns else {"values": [{}]}
    return part | {"mark": {"type": kind, **look}, "encoding": encoding}


def quantity(field: str, title: str = "", *, domain: Any = None, **options: Any) -> Chart:
    """Return the encoding of a number, on an axis that shows ``domain`` and no more."""
    if domain is not None:
        options["scale"] = {"domain": domain, "nice": False, "zero": False}
    return {"field": field, "type": "quantitative", "title": title or None, **options}


def colours_of(field: str, names: Sequence[str], colours: Sequence[str]) -> Chart:
    """Return the encoding of ``names`` by ``colours``, which begin anew when they are used up."""
    scale = {"domain": names, "range": [colours[n % len(colours)] for n in range(len(names))]}
    # As many entries of the legend beside each other as their words leave room for.
    columns = max(WIDTH // (5 * max(map(len, names)) + 28), 1)
    return {"field": field, "type": "nominal", "scale": scale, "legend": {"columns": columns}}


def legend(field: str, *views: str) -> list[Chart]:
    """Return the parameter by which a click on an entry of the legend shows it alone."""
    select = {"type": "point", "fields": [field]}
    return [{"name": "legend", "select": select, "bind": "legend", "views": views}]


def legend_opacity(opacity: float, other: float = 0.05) -> Chart:
    """Return the encoding of marks that a click on the legend dims to ``other``."""
    return {"condition": {"param": "legend", "value": opacity}, "value": other}


def tooltip(about: Mapping[str, str]) -> list[Chart]:
    """Return the encoding of a tooltip with these fields, called by their titles."""
    return [{"field": field, "title": title} for field, title in about.items()]


def hover_layer(
    title: str, place: Chart, about: Mapping[str, str], fields: Sequence[str], *, clip: bool = False
) -> Chart:
    """Return points of which the one nearest to the pointer is shown, with a tooltip."""
    near = {"type": "point", "on": "pointerover", "clear": "pointerout", "nearest": True}
    opacity = {"condition": {"param": "near", "empty": False, "value": 1}, "value": 0}
    encoding = {**place, "opacity": opacity, "tooltip": tooltip(about)}
    points = layer("circle", None, encoding, name=f"{HOVER} {title}", color=INK, size=30, clip=clip)
    return points | {"params": [{"name": "near", "select": {**near, "fields": fields}}]}
