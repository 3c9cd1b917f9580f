"""The page without a browser: its text, well formed, alone in the world, its numbers right."""

import difflib
import json
import re
from base64 import b64encode
from dataclasses import replace
from hashlib import sha256
from html import unescape

import pytest

from daemon.analysis.report import _figures, _page, headline, write_page
from daemon.analysis.report._page import spread_text, verdict_details
from daemon.judging.assessment import assess
from daemon.model.assessments import ReferenceValue
from daemon.model.submission import CampaignOrigin
from daemon.model.verdicts import Evidence, Outcome, Verdict
from grammars.text.words import NOTHING
from tests.analysis.page_text import parse, text_of, without_scripts, words
from tests.analysis.report.recordings import (
    ABOUT,
    NAME,
    OPEN,
    SHUT,
    SUTS,
    WHY,
    commands,
    with_assessment,
)
from tests.make import with_result

HTML = "{http://www.w3.org/1999/xhtml}"


def elements(tree, name):
    return list(tree.iter(f"{HTML}{name}"))


def section(tree, name):
    (found,) = [e for e in tree.iter() if e.get("id") == name]
    return found


@pytest.fixture(scope="module")
def tree(page):
    return parse(page)


def test_the_page_says_it_all(page, golden):
    golden("page.txt", text_of(page))


REFERENCES = tuple(
    ReferenceValue(
        "paper", "Somebody & others", scenario, (SUTS[0],), oracle, value=value, text=text,
        **({"statistic": "mean", "unit": "s", "runs": 5} | more),
    )
    for scenario, oracle, value, text, more in (
        (SHUT, "duration", 21.5, "21.5 s ± 0.5 s", {"deviation": 0.5}),
        (OPEN, "buffer-time", 19.0, "19 s", {}),
        (SHUT, "reached", 0.8, "4 of 5", {"statistic": "rate", "unit": "1"}),
        ("", "delay", -8.9, "-8.9 s", {}),
    )
)  # fmt: skip


@pytest.fixture(scope="module")
def other_page(data):
    """The same campaign with an origin, a system outside, references, and one picture only."""
    declared = replace(data.input.declared, references=REFERENCES)
    runs = [
        replace(run, record=with_result(run.record, machine="Abacus, 2 cores")) for run in data.runs
    ]
    runs = [
        replace(run, record=replace(run.record, repeatable=run.record.sut != SUTS[0]))
        for run in runs
    ]
    rows = tuple(run.record for run in runs)
    elsewhere = replace(runs[-1].record, trace="/home/somebody/store/7.mcap")
    runs[-1] = replace(runs[-1], record=elsewhere)
    chosen = replace(
        data.input,
        rows=rows,
        declared=declared,
        row=replace(data.input.row, submitted_at=1_800_000_000.0, finished_at=1_800_000_090.0),
        origin=CampaignOrigin("c.yaml", "abcdef" * 10, 7, "0123456789abcdef", "main", changed=True),
        unread=(("/home/somebody/8.mcap", "is not an MCAP file"),),
    )
    special = replace(data, input=chosen, runs=tuple(runs))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_figures, "_MOST_MOMENTS", 1)
        return write_page(special, commands, processes=1)


def test_the_page_says_what_is_special_about_a_campaign(page, other_page, golden):
    usual, special = (text_of(one).splitlines() for one in (page, other_page))
    changes = list(difflib.unified_diff(usual, special, n=0, lineterm=""))[2:]
    golden("other_page.txt", "\n".join(one for one in changes if one[0] in "+-") + "\n")
    assert "somebody/" not in other_page


def test_runs_that_left_nothing_are_told_and_drawn_without(data):
    empty = tuple(
        replace(
            run,
            record=replace(run.record, outcome=None, result=None, trace="", state="lost"),
            tracks=replace(run.tracks, time=run.tracks.time[:0], measures={}, encounters=()),
        )
        for run in data.runs
    )
    lost = assess(data.input.declared, (run.record for run in empty))
    assert headline(lost, empty)[2] == "8 of 8 runs could not be executed or judged."
    parse(write_page(with_assessment(replace(data, runs=empty), lost), lambda *_: (), processes=1))


def test_nothing_is_fetched(page, tree):
    tags = {str(e.tag).rpartition("}")[2] for e in tree.iter()}
    assert not tags & {"link", "iframe", "object", "embed", "form", "base"}
    for element in tree.iter():
        for name, value in element.attrib.items():
            assert not str(name).lower().startswith("on"), name
            if str(name).rpartition("}")[2] in ("href", "src", "action"):
                assert value.startswith(("#", "data:image/png;base64,")), value
    assert not re.search(r"@import|url\((?!#)", without_scripts(page))
    outside = set(re.findall(r"https?://[^\"'\s<>]+", without_scripts(page)))
    assert outside <= {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}


def test_one_script_of_our_own_is_executed_and_no_other(page):
    (script,) = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    digest = b64encode(sha256(script.encode()).digest()).decode()
    policy = f"default-src 'none'; script-src 'sha256-{digest}'; style-src 'unsafe-inline'"
    assert f'content="{policy}; img-src data:"' in page
    others = re.findall(r"<script [^>]*>", page)
    assert set(others) <= {'<script type="application/json">'}


def test_texts_of_files_are_escaped_and_folders_of_the_machine_not_told(page, folder):
    for text in (NAME, ABOUT, WHY, SHUT, SUTS[1], str(folder)):
        assert text not in page


def test_identifiers_are_unique_and_references_lead_somewhere(page, tree):
    found = [e.get("id") for e in tree.iter() if e.get("id")]
    assert len(found) == len(set(found))
    anchors = {str(e.get("href"))[1:] for e in elements(tree, "a")}
    anchors |= {e.get("popovertarget") for e in section(tree, "matrix").iter(f"{HTML}button")}
    references = anchors | set(re.findall(r"url\(#([^)]+)\)", without_scripts(page)))
    assert references <= set(found)


def test_tables_can_be_scrolled_by_keys_and_sorted_by_every_column(tree):
    """What axe-core asks for: whoever has no mouse comes to what is beside the edge."""
    scrolled = [e for e in tree.iter() if e.get("class") == "wide"] + elements(tree, "pre")
    assert {e.get("tabindex") for e in scrolled} == {"0"}
    assert all(words(head) for head in elements(tree, "th"))
    sortable = [e for e in elements(tree, "table") if e.get("class") == "data"]
    assert sortable
    for table in sortable:
        assert len({len(list(row)) for row in elements(table, "tr")}) == 1
        assert not [e for e in table.iter() if e.get("rowspan") or e.get("colspan")]


def test_measures_of_a_scenario_stand_together_in_whatever_order_its_traces_are(
    data, tree, monkeypatch
):
    monkeypatch.setattr(_page, "draw_figures", lambda data, processes: ())
    cells = sorted(data.assessment.cells, key=lambda cell: cell.sut)
    assert len({cell.scenario for cell in cells[:2]}) == 2
    shuffled = with_assessment(data, replace(data.assessment, cells=tuple(cells)))

    def heads(tree):
        table = next(section(tree, "measures").iter(f"{HTML}table"))
        return [words(row[0]) for row in elements(table, "tr")]

    assert heads(parse(write_page(shuffled, lambda *_: (), processes=1))) == heads(tree)


def test_words_of_a_verdict():
    evidence = Evidence(41.3, -0.012, 0.0, "door-17", "first at 40 s")
    verdict = Verdict("clear", "…", Outcome.FAIL, -0.012, -0.012, "m", evidence)
    assert verdict_details(verdict) == "−0.012 m, at 41.3 s, door-17, first at 40 s"
    plain = replace(verdict, unit="", lower=-1.0, upper=-1.0, evidence=Evidence())
    assert verdict_details(plain) == ""


@pytest.mark.parametrize(
    ("values", "shown"),
    [
        ((696.0, 698.5, 693.7), "696.1 ± 2.4"),
        ((0.1238,), "0.124"),
        ((0.0, 0.0), "0.00 ± 0.00"),
        ((-0.05, -0.06), "−0.0550 ± 0.0071"),
        # The distance to obstacles where there are none.
        ((1.0, float("inf")), "∞"),
        ((), NOTHING),
    ],
)
def test_means_have_digits_that_mean_something(values, shown):
    assert spread_text(values) == shown


def test_the_building_is_there_small_and_with_its_names(tree):
    drawn = {}
    for name in ("answer", "building"):
        (drawn[name],) = [e for e in section(tree, name).iter() if e.get("class") == "map"]
    names = {
        name: [words(e) for e in plan.iter() if str(e.tag).endswith("}text")]
        for name, plan in drawn.items()
    }
    assert "door-17" in names["building"]
    assert "door-17" not in names["answer"]
    lines = [sum(str(e.tag).endswith("}path") for e in plan.iter()) for plan in drawn.values()]
    assert 0 < lines[0] <= lines[1]


def charts(page):
    """The label and the specification of every chart."""
    found = re.findall(r'class="chart"[^>]* aria-label="([^"]*)".*?json">(.*?)</script>', page)
    return [(unescape(label), json.loads(chart)) for label, chart in found]


def test_figures_that_are_compared_have_the_same_scale(page):
    scales = {}
    for label, chart in charts(page):
        for panel in chart.get("vconcat", [chart]):
            lines = [layer for layer in panel["layer"] if layer.get("name") == panel["title"]]
            kind = label.partition(",")[0].partition(" of ")[0], panel["title"]
            if lines:
                scales.setdefault(kind, []).append(lines[0]["encoding"]["y"]["scale"]["domain"])
    assert len(scales) == 5
    assert all(found == [found[0]] * len(found) for found in scales.values()), scales


def test_a_chart_is_drawn_in_the_colours_of_the_page_without_what_answers_to_a_pointer(page):
    drawings = re.findall(r'<div class="chart".*?(<svg.*?</svg>)', page)
    assert len(drawings) == len(charts(page)) >= 8
    for drawing in drawings:
        assert "var(--" in drawing
        assert not re.search(r'stroke="(?!var|transparent|none)', drawing)
        assert not re.search(r"\d\.\d{2,}", re.sub(r' (?!d=)[\w-]+="[^"]*"|>[^<]*<', "", drawing))
    (clearance, *_) = [chart for label, chart in charts(page) if label.startswith("Clearance over")]
    names = [layer.get("name", "") for layer in clearance["layer"]]
    assert [name.startswith("hover") for name in names][-2:] == [True, True]


def test_figures_are_written_as_vector_files_too(page, tmp_path):
    drawing = re.search(r'<div class="chart".*?(<svg.*?</svg>)', page)[1]
    kinds = ("clearance", "a", "b-c", ""), ("clearance", "a-b", "c", ""), ("boxes", "", "", "time")
    _figures.write_figures(
        tuple(
            _figures.ReportFigure(kind, scenario, sut, "", "", subject, svg=drawing)
            for kind, scenario, sut, subject in kinds
        ),
        tmp_path / "made",
    )
    files = {file.name: file.read_bytes() for file in (tmp_path / "made").iterdir()}
    assert len(files) == len(kinds)
    assert files.keys() >= {"boxes-time.pdf", "clearance-a-b-c.pdf"}
    assert all(content.startswith(b"%PDF") for content in files.values())


def figures(page, label):
    return re.findall(rf'aria-label="{label}".*?(<svg.*?)</div>', page)


def figure(page, label):
    (found,) = figures(page, label)
    return found


def test_a_reference_is_a_diamond_in_the_figure_of_its_measure(other_page, page):
    _, chart = figure(other_page, "Boxplots of duration by scenario").split("</svg>")
    assert "paper 21.5 s ± 0.5 s" in chart
    assert "Somebody & others" in chart
    numbers = set(map(float, re.findall(r"(?<![\w.])\d+(?:\.\d+)?(?![\w.])", chart)))
    assert numbers >= {21.0, 22.0}, "its deviation to both sides"
    # By what the oracle measures, whatever the campaign calls it.
    buffer = figure(other_page, "Boxplots of time in buffer by scenario")
    assert "paper 19 s" in buffer
    assert "21.5 s" not in buffer
    assert "Somebody" not in page
    # What is no other figure is the same one.
    for label in ('Clearance over time, [^"]*far[^"]*', 'Speed and turning[^"]*near'):
        assert figures(other_page, label) == figures(page, label) != []
