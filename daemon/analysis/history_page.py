"""The page of a campaign's history: what is new, its submissions, and each cell over them."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any

from daemon.analysis.charts import SERIES, Chart, chart_figure, draw_charts, page_script, table
from daemon.analysis.history import (
    CampaignHistory,
    CellRecord,
    SubmissionRecord,
    quantity_words,
    verdict_words,
)
from daemon.model.spec import own_version
from grammars.text.words import NOTHING, count_noun, duration_text, format_quantity
from templates.report import render_report

_WIDTH = 620
"""Width of a panel [px]."""


def history_page(history: CampaignHistory) -> str:
    """Return the history of a campaign as HTML that needs nothing else."""
    charts = [_cell_chart(history, *cell) for cell in history.cells]
    figures = [
        (f"{scenario} with {sut}", chart_figure(chart, svg, f"{scenario} with {sut} over time"))
        for (scenario, sut), chart, svg in zip(
            history.cells, charts, draw_charts(charts), strict=True
        )
    ]
    return render_report(
        {
            "quantity": format_quantity,
            "span": duration_text,
            "runs": lambda one: count_noun(one.runs, "run"),
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


def _cell_chart(history: CampaignHistory, scenario: str, sut: str) -> Chart:
    """Return rates, margins by their units, and what a run took, over the submissions of a cell."""
    names = [one.id.removeprefix(f"{history.name}-") for one in history.submissions]
    cells = [
        (name, cell)
        for name, submission in zip(names, history.submissions, strict=True)
        for cell in submission.cells
        if (cell.scenario, cell.sut) == (scenario, sut)
    ]
    panels = list(_panels(cells))
    x = {"field": "submission", "type": "ordinal", "scale": {"domain": names}}
    for number, panel in enumerate(panels, 1):
        last = number == len(panels)
        axis = {"title": None, "labelAngle": -30} if last else {"labels": False, "title": None}
        panel["encoding"]["x"] = {**x, "axis": axis}
    return {"vconcat": panels, "spacing": 8, "resolve": {"scale": {"color": "shared"}}}


def _panels(cells: list[tuple[str, CellRecord]]) -> Iterator[Chart]:
    oracles = [(name, oracle) for name, cell in cells for oracle in cell.oracles]
    known = list(dict.fromkeys(oracle.name for _, oracle in oracles))
    scale = {"domain": known, "range": [SERIES[i % len(SERIES)] for i in range(len(known))]}
    colour = {"field": "oracle", "type": "nominal", "scale": scale, "title": None}
    rows: dict[str, Any] = {
        "submission": [name for name, _ in oracles],
        "oracle": [oracle.name for _, oracle in oracles],
        "rate": [oracle.passed / oracle.n for _, oracle in oracles],
        "low": [oracle.low for _, oracle in oracles],
        "high": [oracle.high for _, oracle in oracles],
        "passed": [f"{oracle.passed} of {oracle.n}" for _, oracle in oracles],
    }
    if oracles:
        yield _panel(
            "pass rate", rows, colour, "rate", ("low", "high"), "passed", {"domain": [0, 1]}
        )
    for unit in dict.fromkeys(oracle.unit for _, oracle in oracles if oracle.median is not None):
        some = [
            (name, oracle)
            for name, oracle in oracles
            if oracle.unit == unit and oracle.median is not None
        ]
        rows = {
            "submission": [name for name, _ in some],
            "oracle": [oracle.name for _, oracle in some],
            "median": [oracle.median for _, oracle in some],
            "worst": [oracle.worst for _, oracle in some],
            "words": [
                f"median {format_quantity(oracle.median, unit)}, "
                f"worst {format_quantity(oracle.worst, unit)}"
                for _, oracle in some
            ],
        }
        title = f"margin [{unit}]"
        yield _panel(title, rows, colour, "median", ("worst", "median"), "words", {"zero": True})
    costs = [
        (name, kind, value)
        for name, cell in cells
        for kind, value in (("simulated", cell.duration), ("CPU", cell.cpu))
        if value is not None
    ]
    if costs:
        rows = dict(zip(("submission", "kind", "seconds"), zip(*costs, strict=True), strict=True))
        rows["words"] = [f"{kind} {format_quantity(value, 's')}" for _, kind, value in costs]
        dash = {"field": "kind", "type": "nominal", "title": None}
        yield _panel("time [s]", rows, dash, "seconds", (), "words", {"zero": True})


def _panel(
    title: str, rows: dict[str, Any], series: Chart, y: str, ends: tuple[str, ...], hover: str,
    scale: Chart,
) -> Chart:  # fmt: skip
    """Return a panel with a line for each series, and bars from one of ``ends`` to the other."""
    channel = "strokeDash" if series["field"] == "kind" else "color"
    value = {"field": y, "type": "quantitative", "title": title, "scale": scale}
    line = {
        "mark": {"type": "line", "point": {"size": 26}, "strokeWidth": 1.3},
        "encoding": {
            "y": value,
            "tooltip": [{"field": "submission"}, {"field": hover, "title": title}],
        },
    }
    bars = {
        "mark": {"type": "rule", "strokeWidth": 3, "opacity": 0.3},
        "encoding": {"y": {**value, "field": ends[0]}, "y2": {"field": ends[1]}} if ends else {},
    }
    return {
        "width": _WIDTH,
        "height": 80,
        "data": table(rows),
        "encoding": {channel: series},
        "layer": [*([bars] if ends else []), line],
    }
