"""The page of a campaign's history: its news, its submissions, and each cell over them."""

from __future__ import annotations

from datetime import UTC, datetime
from operator import attrgetter
from typing import Final

from daemon.analysis.charts import (
    SECOND,
    SERIES,
    SOFT,
    Chart,
    chart_figure,
    colours_of,
    columns_of,
    draw_charts,
    layer,
    legend,
    legend_opacity,
    page_script,
    quantity,
    table,
    tooltip,
)
from daemon.analysis.history import (
    CampaignHistory,
    OracleRecord,
    SubmissionRecord,
    quantity_words,
    verdict_words,
)
from daemon.model.spec import own_version
from grammars.text.words import NOTHING, format_quantity
from templates.report import render_report

_WIDTH: Final = 620
"""Width of a panel [px]."""


def history_page(history: CampaignHistory) -> str:
    """Return the history of a campaign as self-contained HTML."""
    charts = [_cell_chart(history, cell) for cell in history.cells]
    names = [f"{scenario} with {sut}" for scenario, sut in history.cells]
    figures = [
        (name, chart_figure(chart, svg, f"{name} over time"))
        for name, chart, svg in zip(names, charts, draw_charts(charts), strict=True)
    ]
    return render_report(
        {
            "quantity": format_quantity,
            "moment": lambda at: f"{datetime.fromtimestamp(at, UTC):%Y-%m-%d %H:%M} UTC",
            "commit": _commit_text,
            "verdict": verdict_words,
            "change": quantity_words,
        },
        template="history.html.j2",
        library=page_script(),
        history=history,
        figures=figures,
        version=own_version(),
        nothing=NOTHING,
    )


def _commit_text(submission: SubmissionRecord) -> str:
    if not submission.commit:
        return NOTHING
    branch = f" on {submission.branch}" if submission.branch else ""
    return f"{submission.commit[:8]}{branch}{', uncommitted' if submission.uncommitted else ''}"


def _cell_chart(history: CampaignHistory, cell: tuple[str, str]) -> Chart:
    """Return rates, margins by their units, and times of a run, over the submissions."""
    names = [one.id.removeprefix(f"{history.name}-") for one in history.submissions]
    pairs = list(zip(names, history.submissions, strict=True))
    rows = [(name, one) for name, each in pairs for one in each.oracles if one.cell == cell]
    fields = ("oracle", "unit", "low", "high", "worst", "median", "simulated", "cpu")
    columns = columns_of(fields, [attrgetter(*fields)(one) for _, one in rows]) | {
        "submission": [name for name, _ in rows],
        "rate": [one.passed / one.n for _, one in rows],
        "passed": [f"{one.passed} of {one.n}" for _, one in rows],
        "margins": [_margins_text(one) for _, one in rows],
        "times": [_times_text(one) for _, one in rows],
        # All oracles of a cell have the same runs, so the first of a submission gives their times.
        "first": [not n or rows[n - 1][0] != name for n, (name, _) in enumerate(rows)],
    }
    oracles = list(dict.fromkeys(columns["oracle"]))
    units = dict.fromkeys(one.unit for _, one in rows if one.median is not None)
    colour = colours_of("oracle", oracles, SERIES, _WIDTH)
    kinds = colours_of("kind", ("simulated", "cpu"), (SOFT, SECOND), _WIDTH)
    of_units = [
        _panel(
            f"margin [{unit}]", "median", ("worst", "median"), "margins", colour | {"legend": None}
        )
        | {"transform": [{"filter": {"field": "unit", "equal": unit}}]}
        for unit in units
    ]
    folds = [{"filter": "datum.first"}, {"fold": ["simulated", "cpu"], "as": ["kind", "time"]}]
    panels = [
        _panel("pass rate", "rate", ("low", "high"), "passed", colour),
        *of_units,
        _panel("time [s]", "time", ("time", "time"), "times", kinds) | {"transform": folds},
    ]
    x = {"field": "submission", "type": "ordinal", "scale": {"domain": names}, "title": None}
    for panel in panels:
        axis = {"labelAngle": -30} if panel is panels[-1] else {"labels": False}
        panel["encoding"]["x"] = {**x, "axis": axis}
    return {
        "data": table(columns),
        # A click on an entry shows it alone in all panels.
        "params": legend("oracle", "pass rate"),
        "vconcat": panels,
        "spacing": 8,
        "resolve": {"scale": {"color": "independent"}},
    }


def _panel(title: str, field: str, ends: tuple[str, str], hover: str, colour: Chart) -> Chart:
    """Return a panel with a line for each series, and bars from one of ``ends`` to the other."""
    place = {"y": quantity(ends[0], title), "y2": {"field": ends[1]}}
    words = tooltip({"submission": "submission", hover: title})
    encoding = {"y": quantity(field, title), "tooltip": words}
    if colour["field"] == "oracle":
        encoding["opacity"] = legend_opacity(1.0, 0.1)
    bars = layer("rule", None, place, strokeWidth=3, opacity=0.3)
    line = layer("line", None, encoding, name=title, point={"size": 26}, strokeWidth=1.3)
    return {"width": _WIDTH, "height": 80, "encoding": {"color": colour}, "layer": [bars, line]}


def _margins_text(record: OracleRecord) -> str:
    worst, middle = (format_quantity(one, record.unit) for one in (record.worst, record.median))
    return f"{record.oracle}: median {middle}, worst {worst}"


def _times_text(record: OracleRecord) -> str:
    simulated, cpu = (format_quantity(one, "s") for one in (record.simulated, record.cpu))
    return f"{simulated} simulated in {cpu} of CPU"
