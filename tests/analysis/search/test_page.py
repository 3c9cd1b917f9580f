"""The page of a search: what it shows of which search, and that it needs nothing else."""

import math
import re
from dataclasses import replace

import html5lib
import pytest

from daemon.analysis.charts import draw_charts
from daemon.model.run_state import RunState
from daemon.model.search import SearchParameter
from daemon.model.search_answer import SearchRow
from daemon.model.spec import own_version
from daemon.model.trials import point_trials, smallest_so_far
from daemon.search.answers.sentences import headline, minus
from daemon.search.figures import margins_chart, space_charts
from daemon.search.page import search_page
from daemon.search.program import run_search
from tests.analysis.report.recordings import SHUT, SUTS, record, spec
from tests.analysis.search.pretended import PretendedCase, make_task, seconds
from tests.chromium import CHROMIUM, chromium_page


def kitchen(point, _):
    """Fails where the first parameter is above 7, whatever the others are."""
    return (7.0 - float(point[0])) / 10.0


def searched(*parameters, margin=kitchen, **more):
    """A finished search with its runs."""
    task = make_task(*parameters, **({"then": ("nearest",), "confirm": 2} | more))
    case = PretendedCase(task, margin)
    runs = case.runs()
    answer = run_search(case, runs)
    rows = tuple(runs.result(position) for position in range(len(runs.proposals)))
    row = SearchRow("demo-s-1", "demo-s", 0.0, task, "finished", finished=len(rows), answer=answer)
    return row, rows


DOOR = seconds("doors.kitchen_opens")
OTHERS = tuple(seconds(f"doors.time_{number}") for number in range(5))
CHOICE = SearchParameter("doors.leading", "behaviours", 0, "leading", choices=("a", "b"))
COMMANDS = (("scenario replay demo-s-1.3", "watch it"),)


@pytest.fixture(scope="module")
def search():
    """A search over many parameters with its page."""
    row, rows = searched(DOOR, *OTHERS)
    return row, rows, search_page(row, rows, commands=COMMANDS)


def charts_of(row, rows):
    trials, steps = point_trials(row.task, rows), point_trials(row.task, rows, "nearest")
    nearest = row.answer.nearest.result.point if row.answer.nearest else None
    return list(space_charts(row.task, trials, steps, nearest))


def rows_of(data):
    """Return the rows of the table of a chart."""
    columns = data["values"]
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


@pytest.mark.parametrize(
    ("parameters", "captions"),
    [
        ((DOOR,), [""]),
        ((DOOR, OTHERS[0]), [""]),
        ((DOOR, replace(CHOICE, written="a")), [""]),
        (
            (DOOR, *OTHERS[:2]),
            ["time_0 over kitchen_opens", "time_1 over kitchen_opens", "time_1 over time_0"],
        ),
        ((DOOR, *OTHERS), [""]),
    ],
)
def test_few_parameters_are_drawn_two_by_two_and_many_side_by_side(parameters, captions):
    row, rows = searched(*parameters)
    charts = charts_of(row, rows)
    assert [caption for caption, _ in charts] == captions
    (svg, *_) = draw_charts([chart for _, chart in charts])
    assert "as written" not in svg
    # All with a margin: those explored, and of one or two the way to the nearest failure.
    assert svg.count("<path") > 20


@pytest.mark.parametrize(
    "parameter",
    [
        seconds("doors.early", written=1.0, low=6.0, high=8.0),
        SearchParameter(
            "doors.late", "behaviours", 0, "late", "s", choices=(6.0, -8.0), written=1.0
        ),
    ],
)
def test_every_run_has_its_place_on_the_axis_of_a_parameter(parameter):
    for parameters in ((parameter,), (DOOR, parameter)):
        row, rows = searched(*parameters)
        ((_, chart),) = charts_of(row, rows)
        field = "x" if len(parameters) == 1 else "y"
        dots = next(layer for layer in chart["layer"] if layer.get("name") == "runs")
        domain = dots["encoding"][field]["scale"]["domain"]
        places = {one[field] for one in rows_of(dots["data"])}
        if parameter.choices:
            assert domain == ["6 s", "−8 s", "1 s"]
            assert places == set(domain)
        else:
            assert domain[0] < min(places) == 1.0
            assert max(places) < domain[1]


def test_every_failure_is_a_cross_and_the_smallest_margin_a_line():
    row, rows = searched(DOOR, *OTHERS)
    trials = point_trials(row.task, rows)
    above, below = margins_chart(row.task, trials)["vconcat"]
    _, smallest, dots = above["layer"]
    kinds = [one["kind"] for one in rows_of(dots["data"])]
    assert kinds.count("fails") == sum(one.fails for one in trials) > 0
    courses = [one for one in rows_of(smallest["data"]) if one["of"] == "smallest so far"]
    least = smallest_so_far(one.compared for one in trials)
    assert [one["smallest"] for one in courses] == pytest.approx([*least, least[-1]])
    assert courses[-1]["failures"] == kinds.count("fails")
    assert below["data"] == smallest["data"]


def test_runs_without_a_margin_leave_gaps():
    def broken(point, _):
        return None if float(point[0]) > 5.0 else 0.2

    row, rows = searched(DOOR, *OTHERS, margin=broken, stop="budget", runs=6)
    trials = point_trials(row.task, rows)
    assert any(math.isnan(one.compared) for one in trials)
    assert smallest_so_far(one.compared for one in trials)[-1] == 0.2
    page = search_page(row, rows)
    assert "nan" not in page[: page.index("<script>")].lower()
    assert "‼" in page


def test_colours_change_at_zero_and_each_side_has_its_own_scale():
    row, rows = searched(DOOR, OTHERS[0])
    ((_, chart),) = charts_of(row, rows)
    edges = chart["layer"][0]["encoding"]["fill"]["scale"]["domain"]
    assert edges == sorted(set(edges))
    assert edges[2] == 0.0
    assert -edges[0] < 0.3 < edges[4]


def test_influence_that_chance_gives_as_well_is_grey(search):
    row, _, page = search
    for one in row.answer.influence:
        tag = "b" if one.parameter == DOOR.name else 'span class="note"'
        assert f"<{tag}>{minus(f'{one.correlation:+.2f}')}<" in page


def test_of_a_point_that_was_repeated_the_median_counts():
    row, rows = searched(DOOR, runs=3, confirm=0, then=())
    run = rows[0]
    assert run.leads[0].margin is not None
    led = [
        replace(run, result=replace(run.result, leads=(replace(run.leads[0], margin=margin),)))
        for margin in (0.5, 0.1, 0.3)
    ]
    repeats = [
        replace(one, proposal=replace(run.proposal, position=100 + k, repeat=k))
        for k, one in enumerate(led)
    ]
    (point,) = point_trials(row.task, repeats)
    assert point.compared == 0.3


def test_the_page_is_html_and_needs_nothing_else(search):
    row, rows, page = search
    html5lib.HTMLParser(strict=True).parse(page)
    before = page[: page.rindex("<script>")]
    assert set(re.findall(r'(?:src|href)="([^"#]+)', before)) == set()
    assert not re.search(r"url\((?!#)", before)
    assert before.count('<div class="chart"') == 2
    assert row.answer is not None
    assert headline(row)[1:] in page
    for sentence in row.answer.sentences[1:]:
        assert sentence in page
    assert COMMANDS[0][0] in page
    assert f"<dt>page written by</dt><dd>{own_version()}</dd>" in page
    assert page == search_page(row, rows, commands=COMMANDS)


def test_what_is_wider_than_a_phone_can_be_scrolled_by_keys(search):
    tree = html5lib.HTMLParser().parse(search[2])
    wide = [e for e in tree.iter() if e.get("class") in ("wide", "full")]
    assert {e.get("class") for e in wide} == {"wide", "full"}
    assert {e.get("tabindex") for e in wide} == {"0"}


def test_nothing_that_a_campaign_is_called_gets_into_the_page():
    name = "doors.<script>alert(1)</script>"
    row, rows = searched(replace(DOOR, name=name), *OTHERS)
    row = replace(row, note="<b>\x1b[2J</b>", task=replace(row.task, about='"><script>'))
    page = search_page(row, rows)
    assert "<script>alert" not in page
    assert '"><script>' not in page
    assert "<b>\x1b" not in page
    assert "&lt;script&gt;" in page


def test_what_is_not_settled_is_not_drawn():
    row, rows = searched(DOOR)
    waiting = [replace(one, state=RunState.QUEUED) for one in rows]
    assert point_trials(row.task, waiting) == []
    page = search_page(replace(row, answer=None, state="running"), waiting)
    assert "No run has a result yet" in page
    assert '<div class="chart"' not in page


def test_points_are_listed_by_their_margins_and_not_all_of_many():
    row, rows = searched(DOOR, *OTHERS, runs=90, then=(), confirm=0)
    page = search_page(row, rows)
    listed = page[page.index("smallest margins") :]
    margins = [
        float(words.replace("−", "-")) for words in re.findall(r"([+−][0-9.e-]+) m</td>", listed)
    ]
    assert len(margins) == 60
    assert margins == sorted(margins)
    assert "30 more have larger ones" in page


def test_the_failure_is_drawn_where_its_trace_is(tmp_path):
    row, rows = searched(DOOR)
    assert row.answer is not None
    assert row.answer.nearest is not None
    shown = row.answer.nearest.result
    assert shown.verdict is not None
    seen = replace(shown.verdict.evidence, time=2.0)
    shown = replace(shown, verdict=replace(shown.verdict, evidence=seen))
    nearest = replace(row.answer.nearest, result=shown)
    row = replace(row, answer=replace(row.answer, nearest=nearest))
    trace = record(tmp_path / "run.mcap", spec(SHUT, SUTS[0], 0))
    page = search_page(row, rows, traces={shown.run: trace})
    assert "<figcaption>at 2 s</figcaption>" in page
    assert "<figcaption>the whole way</figcaption>" in page
    gone = search_page(row, rows, traces={shown.run: tmp_path / "gone.mcap"})
    assert "the whole way" not in gone


FADED = """(() => [...document.querySelectorAll("#space .live .mark-line path")]
  .map((line) => line.getAttribute("opacity") ?? line.getAttribute("stroke-opacity") ?? 1)
  .filter((opacity) => Number(opacity) < 0.1).length)()"""
FIRST_AXIS = """(() => {
  const [line, svg] = [".mark-line", "svg"].map(
    (part) => document.querySelector(`#space .live ${part}`).getBoundingClientRect());
  return [line.x, svg.y, svg.height];
})()"""


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium is installed")
@pytest.mark.parametrize("width", [1280, 500])
def test_an_area_brushed_over_an_axis_keeps_the_runs_that_lie_in_it(search, tmp_path, width):
    file = tmp_path / "search.html"
    file.write_text(search[2], encoding="utf-8")
    with chromium_page(file.as_uri(), tmp_path, width=width) as page:
        page.evaluate("document.documentElement.style.scrollBehavior = 'auto'")
        page.evaluate("document.querySelector('#space .chart').scrollIntoView()")
        page.wait("document.querySelectorAll('#space .live .mark-line').length")
        assert page.evaluate(FADED) == 0
        left, top, high = page.evaluate(FIRST_AXIS)
        start, end = (left - 8, top + 0.3 * high), (left + 8, top + 0.5 * high)
        page.point("Moved", *start)
        page.point("Pressed", *start, held=True)
        page.point("Moved", *end, held=True)
        page.point("Released", *end, held=True)
        assert page.wait(FADED) > 0
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.problems == []
