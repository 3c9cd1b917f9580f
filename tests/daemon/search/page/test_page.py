"""The page of a search: what it shows of which search, and that it needs nothing else."""

import math
import re
from dataclasses import replace

import html5lib
import numpy as np
import pytest

from daemon.model.run_state import RunState
from daemon.model.search import SearchParameter
from daemon.model.search_answer import SearchRow
from daemon.model.spec import own_version
from daemon.model.trials import point_trials, smallest_so_far
from daemon.search.answers.sentences import headline
from daemon.search.page import search_figures, search_page
from daemon.search.page._spaces import RAMP, ramp_levels
from daemon.search.program import run_search
from tests.daemon.analysis.report.recordings import SHUT, SUTS, record, spec
from tests.daemon.search.pretended import PretendedCase, make_task, seconds


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


@pytest.mark.parametrize(
    ("parameters", "expected"),
    [
        ((DOOR,), {"boundary"}),
        ((DOOR, OTHERS[0]), {"boundary"}),
        ((DOOR, replace(CHOICE, written="a")), {"boundary"}),
        (
            (DOOR, *OTHERS[:2]),
            {
                "time_0 over kitchen_opens",
                "time_1 over kitchen_opens",
                "time_1 over time_0",
            },
        ),
        ((DOOR, *OTHERS), {"parallel"}),
    ],
)
def test_few_parameters_are_drawn_two_by_two_and_many_side_by_side(parameters, expected):
    row, rows = searched(*parameters)
    figures = search_figures(row, rows)
    assert set(figures) - {"margins", "influence"} == expected
    assert search_page(row, rows).count("<svg ") == len(figures)


def test_the_page_is_html_and_needs_nothing_else():
    row, rows = searched(DOOR, *OTHERS)
    page = search_page(row, rows, commands=(("scenario replay demo-s-1.3", "watch it"),))
    html5lib.HTMLParser(strict=True).parse(page)
    assert "<script" not in page
    assert set(re.findall(r'(?:src|href)="([^"#]+)', page)) == set()
    assert not re.search(r"url\((?!#)", page)
    assert row.answer is not None
    for sentence in row.answer.sentences[1:]:
        assert sentence in page
    assert "scenario replay demo-s-1.3" in page
    assert page == search_page(row, rows, commands=(("scenario replay demo-s-1.3", "watch it"),))


def test_what_is_wider_than_a_phone_can_be_scrolled_by_keys():
    row, rows = searched(DOOR, *OTHERS)
    page = search_page(row, rows, commands=(("scenario replay demo-s-1.3", "watch it"),))
    tree = html5lib.HTMLParser(strict=True).parse(page)
    wide = [e for e in tree.iter() if e.get("class") in ("wide", "full")]
    assert {e.get("class") for e in wide} == {"wide", "full"}
    assert {e.get("tabindex") for e in wide} == {"0"}
    assert f"<dt>page written by</dt><dd>{own_version()}</dd>" in page


def test_nothing_that_a_campaign_is_called_gets_into_the_page():
    name = "doors.<script>alert(1)</script>"
    row, rows = searched(replace(DOOR, name=name), *OTHERS)
    row = replace(row, note="<b>\x1b[2J</b>", task=replace(row.task, about='"><script>'))
    page = search_page(row, rows)
    assert "<script" not in page
    assert "<b>\x1b" not in page
    assert "&lt;script&gt;" in page


def test_every_failure_is_a_cross_and_the_smallest_margin_a_line():
    row, rows = searched(DOOR, *OTHERS)
    points = point_trials(row.task, rows)
    failed = sum(point.fails for point in points)
    svg = search_figures(row, rows)["margins"]
    crosses = max(re.findall(r'<path d="([^"]+)" style="[^"]*var\(--bad\)', svg), key=len)
    assert crosses.count("M") == 2 * failed > 0
    values = smallest_so_far(point.compared for point in points)
    assert values == list(np.minimum.accumulate([p.compared for p in points]))
    assert "space-filling runs alone" in svg


def test_another_search_that_was_not_guided_is_the_baseline():
    row, rows = searched(DOOR, *OTHERS)
    _, others = searched(DOOR, *OTHERS, method="random", seed=3)
    assert "random alone, another search" in search_figures(row, rows, baseline=others)["margins"]
    assert "another search of the same" in search_page(row, rows, baseline=others)


def test_runs_without_a_margin_leave_gaps():
    def broken(point, _):
        return None if float(point[0]) > 5.0 else 0.2

    row, rows = searched(DOOR, *OTHERS, margin=broken, stop="budget", runs=6)
    points = point_trials(row.task, rows)
    assert any(math.isnan(point.compared) for point in points)
    assert smallest_so_far(point.compared for point in points)[-1] == 0.2
    page = search_page(row, rows)
    assert "nan" not in page
    assert "‼" in page


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


def test_what_is_not_settled_is_not_drawn():
    row, rows = searched(DOOR)
    waiting = [replace(one, state=RunState.QUEUED) for one in rows]
    assert point_trials(row.task, waiting) == []
    assert search_figures(replace(row, answer=None), waiting) == {}
    assert "No run has a result yet" in search_page(
        replace(row, answer=None, state="running"), waiting
    )


def test_the_first_line_is_the_headline():
    row, rows = searched(DOOR)
    assert headline(row).startswith("keeps-clear fails in 2 of 2 repeats with kitchen_opens 7.01 s")
    passing, rows = searched(DOOR, margin=lambda point, _: 0.3)
    told = "does not fail in 20 runs, the smallest margin is 0.3 m near door"
    assert headline(passing) == f"keeps-clear {told}"
    assert headline(replace(passing, state="failed", note="a.yaml:3: gone")) == "a.yaml:3: gone"
    assert f"Keeps-clear {told}" in search_page(passing, rows)


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
    figures = search_figures(row, rows, traces={shown.run: trace})
    assert {"moment", "way"} <= set(figures)
    assert "at 2 s" in search_page(row, rows, traces={shown.run: trace})
    gone = search_figures(row, rows, traces={shown.run: tmp_path / "gone.mcap"})
    assert not {"moment", "way"} & set(gone)


def test_any_of_several_oracles_is_told_as_a_share():
    row, rows = searched(DOOR)
    task = row.task
    scales = (*task.scales, replace(task.scales[0], oracle="in-time"))
    several = replace(task, minimise="any", scales=scales)
    svg = search_figures(replace(row, task=several, answer=None), rows)["margins"]
    assert "as a share of its scale" in svg


def test_colours_change_where_margins_do():
    levels = ramp_levels(np.array([-0.05, -0.0001, 0.0, 0.0001, 0.1])).tolist()
    assert levels == sorted(levels)
    assert (levels[0], levels[-1]) == (0, len(RAMP) - 1)
    # A failure by a hair is not drawn as if it nearly passed.
    half = len(RAMP) // 2
    assert [level < half for level in levels] == [True, True, False, False, False]
    assert levels[2] - levels[1] > 1
