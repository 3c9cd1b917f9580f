"""The page of a search: what it shows of which search, and that it needs nothing else."""

import math
import re
from dataclasses import replace

import pytest

from daemon.model.trials import point_trials, smallest_so_far
from daemon.model.verdicts import RunState
from daemon.search import page as search_pages
from daemon.search.answers.sentences import minus
from daemon.search.figures import margins_chart, space_charts
from daemon.search.page import search_page
from tests.analysis.page_text import parse, text_of, without_scripts
from tests.analysis.report.recordings import SHUT, SUTS, record, spec
from tests.analysis.search.searches import finished_search
from tests.analysis.search.tasks import chosen, ranged

DOOR = ranged("doors.kitchen_opens")
OTHERS = tuple(ranged(f"doors.time_{number}") for number in range(5))
CHOICE = chosen("doors.leading", "a", "b")
LATE = replace(chosen("doors.late", 6.0, -8.0), unit="s", written=1.0)
COMMANDS = (("scenario replay demo-s-1.3", "watch it"),)


@pytest.fixture(scope="module")
def search():
    """A search over many parameters with its page."""
    row, rows = finished_search(DOOR, *OTHERS)
    return row, rows, search_page(row, rows, commands=COMMANDS)


@pytest.fixture
def undrawn(monkeypatch):
    """Pages without drawings: whoever starts Vega waits for a second."""
    monkeypatch.setattr(search_pages, "draw_charts", lambda charts: ["<svg></svg>"] * len(charts))


def charts_of(row, rows):
    trials, steps = point_trials(row.task, rows), point_trials(row.task, rows, "nearest")
    nearest = row.answer.nearest.result.point if row.answer.nearest else None
    return list(space_charts(row.task, trials, steps, nearest))


def rows_of(layer):
    """The rows of the table of a layer of a chart."""
    columns = layer["data"]["values"]
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


@pytest.mark.parametrize(
    ("parameters", "captions"),
    [
        ((DOOR,), [""]),
        ((DOOR, OTHERS[0]), [""]),
        ((DOOR, CHOICE), [""]),
        (
            (DOOR, *OTHERS[:2]),
            ["time_0 over kitchen_opens", "time_1 over kitchen_opens", "time_1 over time_0"],
        ),
        ((DOOR, *OTHERS), ["kitchen_opens", *(f"time_{number}" for number in range(5))]),
    ],
)
def test_few_parameters_are_drawn_two_by_two_and_many_side_by_side(parameters, captions):
    row, rows = finished_search(*parameters)
    charts = charts_of(row, rows)
    assert [caption for caption, _ in charts] == captions
    layers = [one for one in charts[0][1]["layer"] if isinstance(one["data"].get("values"), dict)]
    drawn = max(len(rows_of(layer)) for layer in layers)
    # All that are explored, and of one or two parameters the way to the nearest failure.
    assert drawn > row.task.runs if len(parameters) < 3 else drawn == row.task.runs


@pytest.mark.parametrize("parameters", [(), (DOOR,)])
@pytest.mark.parametrize("parameter", [ranged("doors.early", 6.0, 8.0, written=1.0), LATE])
def test_every_run_has_its_place_on_the_axis_of_a_parameter(parameters, parameter):
    ((_, chart),) = charts_of(*finished_search(*parameters, parameter))
    field = "y" if parameters else "x"
    dots = next(layer for layer in chart["layer"] if layer.get("name") == "runs")
    domain = dots["encoding"][field]["scale"]["domain"]
    places = {one[field] for one in rows_of(dots)}
    if parameter.choices:
        assert domain == ["6 s", "−8 s", "1 s"]
        assert places == set(domain)
    else:
        assert domain[0] < min(places) == 1.0
        assert max(places) < domain[1]


def test_every_failure_is_a_cross_and_the_smallest_margin_a_line(search):
    row, rows, _ = search
    trials = point_trials(row.task, rows)
    _, smallest, dots = margins_chart(row.task, trials)["layer"]
    failures = [one["kind"] for one in rows_of(dots)].count("fails")
    assert failures == sum(one.fails for one in trials) > 0
    course = [one for one in rows_of(smallest) if one["of"] == "smallest so far"]
    least = smallest_so_far(one.compared for one in trials)
    assert [one["smallest"] for one in course] == pytest.approx(least)


def test_runs_without_a_margin_leave_gaps_and_no_name_becomes_part_of_the_page():
    door = replace(DOOR, name="doors.<script>alert(1)</script>")
    row, rows = finished_search(
        door, *OTHERS, margin=lambda p, _: None if p[0] > 5.0 else 0.2, runs=6
    )
    row = replace(row, note="<b>\x1b[2J</b>", task=replace(row.task, about='"><script>'))
    trials = point_trials(row.task, rows)
    assert any(math.isnan(one.compared) for one in trials)
    assert smallest_so_far(one.compared for one in trials)[-1] == 0.2
    page = search_page(row, rows)
    assert "nan" not in page[: page.index("<script>")].lower()
    assert "‼" in page
    for text in ("<script>alert", '"><script>', "<b>\x1b"):
        assert text not in page
    assert "&lt;script&gt;" in page


def test_colours_change_at_zero_and_each_side_has_its_own_scale():
    ((_, chart),) = charts_of(*finished_search(DOOR, OTHERS[0]))
    edges = chart["layer"][0]["encoding"]["fill"]["scale"]["domain"]
    assert edges == sorted(set(edges))
    assert edges[2] == 0.0
    assert -edges[0] < 0.3 < edges[4]


def test_of_a_point_that_was_repeated_the_median_counts():
    row, rows = finished_search(DOOR, runs=3, confirm=0, then=())
    repeats = []
    for repeat, margin in enumerate((0.5, 0.1, 0.3)):
        result = replace(rows[0].result, leads=(replace(rows[0].leads[0], margin=margin),))
        proposal = replace(rows[0].proposal, position=100 + repeat, repeat=repeat)
        repeats.append(replace(rows[0], result=result, proposal=proposal))
    (point,) = point_trials(row.task, repeats)
    assert point.compared == 0.3


def test_the_page_says_it_all_and_needs_nothing_else(search, golden):
    row, _, page = search
    golden("page.txt", text_of(page))
    before = without_scripts(page)
    assert set(re.findall(r'(?:src|href)="([^"#]+)', before)) == set()
    assert not re.search(r"url\((?!#)", before)
    # What chance gives as well is grey.
    for one in row.answer.influence:
        tag = "b" if one.parameter == DOOR.name else 'span class="note"'
        assert f"<{tag}>{minus(f'{one.correlation:+.2f}')}<" in page
    # Whatever is wider than a phone can be scrolled by keys.
    wide = {(e.get("class"), e.get("tabindex")) for e in parse(page).iter()}
    assert {pair for pair in wide if pair[0] in ("wide", "full")} == {("wide", "0"), ("full", "0")}


def test_runs_that_are_not_settled_are_not_drawn(search):
    row, rows, _ = search
    waiting = [replace(one, state=RunState.QUEUED) for one in rows]
    assert point_trials(row.task, waiting) == []
    page = search_page(replace(row, answer=None, state="running"), waiting)
    assert "No run has a result yet" in page
    assert '<div class="chart"' not in page


@pytest.mark.usefixtures("undrawn")
def test_points_are_listed_by_their_margins_and_not_all_of_many():
    page = search_page(*finished_search(DOOR, *OTHERS, runs=90, then=(), confirm=0))
    listed = re.findall(r"([+−][0-9.e-]+) m</td>", page[page.index("smallest margins") :])
    margins = [float(words.replace("−", "-")) for words in listed]
    assert len(margins) == 60
    assert margins == sorted(margins)
    assert "30 more have larger ones" in page


@pytest.mark.usefixtures("undrawn")
def test_the_failure_is_drawn_where_its_trace_is(search, tmp_path):
    row, rows, _ = search
    nearest = row.answer.nearest
    evidence = replace(nearest.result.verdict.evidence, time=2.0)
    shown = replace(nearest.result, verdict=replace(nearest.result.verdict, evidence=evidence))
    row = replace(row, answer=replace(row.answer, nearest=replace(nearest, result=shown)))
    trace = record(tmp_path / "run.mcap", spec(SHUT, SUTS[0], 0))
    page = search_page(row, rows, traces={shown.run: trace})
    assert "<figcaption>at 2 s</figcaption>" in page
    assert "<figcaption>the whole way</figcaption>" in page
    assert "the whole way" not in search_page(row, rows, traces={shown.run: tmp_path / "gone"})
