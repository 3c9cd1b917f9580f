"""The page without a browser: well formed, alone in the world, escaped, and its numbers right."""

import json
import re
from base64 import b64encode
from dataclasses import replace
from hashlib import sha256
from html import unescape
from pathlib import Path

import html5lib
import pytest

from daemon.analysis.report import (
    SuggestedCommand,
    _figures,
    headline,
    spread_text,
    verdict_details,
    write_page,
)
from daemon.analysis.report._measures import (
    SPEED_AT_TRIGGER,
    measured_values,
    standard_oracles,
)
from daemon.judging.assessment import assess
from daemon.judging.oracles import judge
from daemon.model.spec import own_version
from daemon.model.submission import CampaignOrigin
from daemon.model.verdicts import Evidence, Outcome, Verdict
from daemon.trace import read_trace
from grammars.text.words import NOTHING, format_quantity
from tests.analysis.report.recordings import (
    ABOUT,
    NAME,
    OPEN_SHOWN,
    REPEATS,
    SHUT,
    SUTS,
    WHY,
    with_assessment,
)
from tests.make import with_result

HTML = "{http://www.w3.org/1999/xhtml}"


@pytest.fixture(scope="module")
def tree(page):
    return parse(page)


def without_scripts(page):
    """What a reader whose browser executes nothing is sent."""
    return re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)


def parse(page):
    """The page as a browser would understand it; anything not well formed raises."""
    return html5lib.HTMLParser(strict=True).parse(without_scripts(page))


def words(element):
    return " ".join(" ".join(element.itertext()).split())


def elements(tree, name):
    return list(tree.iter(f"{HTML}{name}"))


def section(tree, name):
    (found,) = [e for e in tree.iter() if e.get("id") == name]
    return found


def test_systems_that_are_not_repeatable_are_marked(data, page):
    assert "not repeatable" not in page.casefold()
    external = tuple(
        replace(run, record=replace(run.record, repeatable=run.record.sut != SUTS[0]))
        for run in data.runs
    )
    marked = write_page(replace(data, runs=external), (), processes=1)
    assert f"<dt>not repeatable</dt><dd>{SUTS[0]}</dd>" in marked
    assert f'<th scope="col">{SUTS[0]} (not repeatable)</th>' in marked
    assert marked.count("(not repeatable)") == 1


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


def test_folders_of_the_machine_are_not_told(data, page, folder):
    assert str(folder) not in page
    assert f"<dt>from</dt><dd>the folder {folder.name}</dd>" in page
    elsewhere = replace(data.runs[0].record, trace="/home/somebody/store/7.mcap")
    runs = (replace(data.runs[0], record=elsewhere), *data.runs[1:])
    unread = (("/home/somebody/8.mcap", "is not an MCAP file"),)
    chosen = replace(data.input, unread=unread)
    moved = write_page(replace(data, input=chosen, runs=runs), (), processes=1)
    assert "somebody" not in moved
    assert "<td>7.mcap</td>" in moved
    assert "Not read: 8.mcap: is not an MCAP file" in moved


def test_everything_from_files_is_escaped(page, tree):
    for text in (NAME, ABOUT, WHY, SHUT, SUTS[1]):
        assert text not in page
    shown = words(section(tree, "answer"))
    assert NAME in shown
    assert ABOUT in shown
    assert WHY in words(section(tree, "matrix"))


def test_identifiers_are_unique_and_references_lead_somewhere(page, tree):
    found = [e.get("id") for e in tree.iter() if e.get("id")]
    assert len(found) == len(set(found))
    anchors = {str(e.get("href"))[1:] for e in elements(tree, "a")}
    references = anchors | set(re.findall(r"url\(#([^)]+)\)", without_scripts(page)))
    assert references <= set(found)


def test_the_matrix_says_what_the_assessment_says(data, tree):
    rows = list(section(tree, "matrix").iter(f"{HTML}tr"))[1:]
    cells = {(c.scenario, c.sut): c for c in data.assessment.cells}
    for row, scenario in zip(rows, dict.fromkeys(s for s, _ in cells), strict=True):
        head, *shown = list(row)
        assert words(head) == scenario.replace("\x07", "\ufffd")
        for column, sut in zip(shown, dict.fromkeys(s for _, s in cells), strict=True):
            for oracle in cells[scenario, sut].oracles:
                assert oracle.n == REPEATS
                said_so = f"{oracle.oracle} {oracle.passed}/{oracle.n}"
                assert said_so in words(column)
                assert f"to {100 * oracle.high:.1f}".removesuffix(".0") in words(column)


def test_tables_can_be_scrolled_by_keys_and_sorted_by_every_column(tree):
    """What axe-core asks for: whoever has no mouse comes to what is beside the edge."""
    scrolled = [e for e in tree.iter() if e.get("class") == "wide"] + elements(tree, "pre")
    assert {e.get("tabindex") for e in scrolled} == {"0"}
    assert all(words(head) for head in elements(tree, "th"))
    sortable = [e for e in elements(tree, "table") if e.get("class") == "data"]
    assert sortable
    for table in sortable:
        columns = {len(list(row)) for row in elements(table, "tr")}
        assert len(columns) == 1
        assert not [e for e in table.iter() if e.get("rowspan") or e.get("colspan")]


def test_measures_of_a_scenario_stand_together_in_whatever_order_its_traces_are(data, page):
    cells = sorted(data.assessment.cells, key=lambda cell: cell.sut)
    assert len({cell.scenario for cell in cells[:2]}) == 2
    shuffled = with_assessment(data, replace(data.assessment, cells=tuple(cells)))

    def heads(page):
        table = next(section(parse(page), "measures").iter(f"{HTML}table"))
        return [words(row[0]) for row in elements(table, "tr")]

    assert heads(write_page(shuffled, (), processes=1)) == heads(page)


def test_each_verdict_lists_its_repeats_with_what_replays_them(data, page, tree):
    buttons = [e.get("popovertarget") for e in section(tree, "matrix").iter(f"{HTML}button")]
    oracles = [(c, oracle) for c in data.assessment.cells for oracle in c.oracles]
    assert len(buttons) == len(oracles) == page.count("<div popover")
    for name, (cell, oracle) in zip(buttons, oracles, strict=True):
        rows = elements(section(tree, name), "tr")[1:]
        verdicts = [words(row[1]).split()[1] for row in rows]
        assert len(rows) == len(cell.runs)
        assert verdicts.count("pass") == oracle.passed
        assert all(words(row[5]).startswith("scenario judge") for row in rows)
        assert {row[0][0].get("href")[1:] for row in rows} <= {
            e.get("id") for e in section(tree, "runs").iter()
        }


def test_every_number_of_the_tables_of_measures_is_what_judge_says(data, tree):
    layer = standard_oracles(data.buffer)
    judged = {
        run.record.id: measured_values(judge(read_trace(Path(run.record.trace)), layer))
        for run in data.runs
    }
    compared = set()
    *tables, oracles = section(tree, "measures").iter(f"{HTML}table")
    texts = {words(row[0]): words(row[1]) for row in elements(oracles, "tr")}
    assert texts.items() >= {o.name: o.text for o in layer if o.name != "recoveries"}.items()
    for table in tables:
        head, *rows = elements(table, "tr")
        for row, cell in zip(rows, data.assessment.cells, strict=True):
            for column, number in list(zip(head, row, strict=True))[2:]:
                name = words(column).partition(" [")[0]
                values = [judged[run][name] for run in cell.runs if name in judged[run]]
                if name != SPEED_AT_TRIGGER:
                    assert (name, words(number)) == (name, spread_text(values))
                    compared.add(name)
    # No behaviour tree is recorded.
    assert compared == {oracle.name for oracle in layer} - {"recoveries"}


def test_what_fails_comes_with_evidence_and_commands(data, tree):
    found = section(tree, "findings")
    first = next(found.iter(f"{HTML}details"))
    assert OPEN_SHOWN in words(first)
    assert "always(clearance(0.55 m, 0.433 m) >= 0 m)" in words(first)
    assert "door-17.leaf" in words(first)
    (typed,) = [e for e in first.iter() if e.get("class") == "typed"]
    assert words(typed).startswith("scenario judge open")
    assert first.get("open") is not None
    known = [words(e) for e in found.iter(f"{HTML}details")][1]
    assert f"a known: {WHY}" in known


def test_news_and_known_failures_are_told_apart(tree):
    signs = {(words(e), e.get("class")) for e in section(tree, "matrix").iter(f"{HTML}b")}
    assert signs > {("!", "mark bad"), ("a", "mark open")}


def test_the_same_runs_give_the_same_page(data, page):
    again = write_page(
        data, (SuggestedCommand("scenario judge {run}", "judge it again"),), processes=2
    )
    assert again == page


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
    bare = with_assessment(replace(data, runs=empty), lost)
    assert headline(lost, empty).sentence == "8 of 8 runs could not be executed or judged."
    parse(write_page(bare, (), processes=1))


def test_words_of_a_verdict():
    seen = Evidence(41.3, -0.012, 0.0, "door-17", "first at 40 s")
    verdict = Verdict("clear", "…", Outcome.FAIL, -0.012, -0.012, "m", seen)
    assert verdict_details(verdict) == "−0.012 m, at 41.3 s, door-17, first at 40 s"
    assert (
        verdict_details(replace(verdict, unit="", lower=-1.0, upper=-1.0, evidence=Evidence()))
        == ""
    )


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


def test_what_was_exercised_is_told_and_what_was_not(tree, data):
    part, coverage = section(tree, "coverage"), data.coverage
    assert coverage.runs == len(data.runs)
    assert f"these {coverage.runs} runs exercised" in words(part)
    rows = {words(next(row.iter(f"{HTML}th"))): row for row in elements(part, "tr")}
    for group in coverage.groups:
        cells = elements(rows[group.path.replace("/", " / ")], "td")
        assert [f.name in words(cells[0]) for f in group.planned] == [True] * len(group.planned)
        told = words(cells[1]).replace(" ,", ",")
        assert told == ", ".join(f.name for f in group.missing)
    assert {door.door for door in coverage.doors} <= set(rows)


def test_the_head_tells_where_the_numbers_are_from(data):
    origin = CampaignOrigin("c.yaml", "abcdef" * 10, 7, "0123456789abcdef", "main", changed=True)
    row = replace(data.input.row, submitted_at=1_800_000_000.0, finished_at=1_800_000_090.0)
    chosen = replace(data.input, row=row, origin=origin)
    runs = tuple(
        replace(run, record=with_result(run.record, machine="Abacus, 2 cores")) for run in data.runs
    )
    head = words(section(parse(write_page(replace(data, input=chosen, runs=runs), ())), "answer"))
    assert "executed 2027-01-15, 08:00 to 08:01 UTC" in head
    assert "campaign file c.yaml, SHA-256 abcdefabcdef…" in head
    assert "commit 0123456789ab on main, with changes that are not committed" in head
    assert "seed 7" in head
    assert "machine Abacus, 2 cores" in head
    assert f"page written by {own_version()}" in head


def test_what_nobody_noted_is_left_out(page, tree):
    head = words(section(tree, "answer"))
    for name in ("executed", "campaign file", "version control", "seed", "machine"):
        assert f"<dt>{name}</dt>" not in page, head
    assert "<dt>simulated with</dt>" in page


def test_the_building_is_there_small_and_with_its_names(tree):
    drawn = {}
    for name in ("answer", "building"):
        plans = [e for e in section(tree, name).iter() if e.get("class") == "map"]
        (drawn[name],) = plans
    names = {
        name: [words(e) for e in plan.iter() if str(e.tag).endswith("}text")]
        for name, plan in drawn.items()
    }
    assert "door-17" in names["building"]
    assert "door-17" not in names["answer"]
    lines = [sum(str(e.tag).endswith("}path") for e in plan.iter()) for plan in drawn.values()]
    assert 0 < lines[0] <= lines[1]


def test_each_failure_has_a_picture_of_its_moment(tree):
    captions = [words(e[0]) for e in elements(tree, "figure") if e.get("class") == "moment"]
    assert len(captions) >= 2
    for caption in captions:
        assert re.match(r"repeat \d+, the seconds before (the end|[\d.]+ s)", caption)


def test_the_page_says_how_many_findings_have_a_picture(data, page, monkeypatch):
    count = page.count('<details class="finding"')
    assert count > 1
    assert "findings have pictures" not in page
    monkeypatch.setattr(_figures, "_MOST_MOMENTS", 1)
    assert f"Only 1 of {count} findings have pictures." in write_page(data, (), processes=1)


def charts(page):
    """The label and the specification of every chart."""
    found = re.findall(r'class="chart"[^>]* aria-label="([^"]*)".*?json">(.*?)</script>', page)
    return [(unescape(label), json.loads(chart)) for label, chart in found]


def test_every_figure_of_the_paper_is_there_and_has_a_name(tree):
    labels = [e.get("aria-label") or "" for e in tree.iter() if e.get("role") == "img"]
    for start in (
        "The moment that decides buffer",
        "Localisation error and spread",
        "The largest localisation error over time",
        "Clearance over time",
        "Clearance along the way",
        "Laser returns inside the safety buffer",
        "Boxplots of time in buffer",
        "Speed and turning speed around the trigger",
    ):
        assert any(label.startswith(start) for label in labels), start


def test_figures_that_are_compared_have_the_same_scale(page):
    scales = {}
    for label, chart in charts(page):
        for panel in chart.get("vconcat", [chart]):
            (line,) = [
                layer for layer in panel["layer"] if layer.get("name") == panel["title"]
            ] or [None]
            kind = label.partition(",")[0].partition(" of ")[0], panel["title"]
            if line and "largest" not in label:
                scales.setdefault(kind, []).append(line["encoding"]["y"]["scale"]["domain"])
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


def test_figures_are_written_as_vector_files_too(data, tmp_path):
    figures = _figures.draw_figures(data, processes=1)
    a_bc, ab_c = (replace(figures[0], scenario=s, sut=t) for s, t in (("a", "b-c"), ("a-b", "c")))
    _figures.write_figures((*figures, a_bc, ab_c), tmp_path / "made")
    files = sorted(file.name for file in (tmp_path / "made").iterdir())
    assert len(files) == len(figures) + 2
    assert "boxes-duration.pdf" in files
    assert all((tmp_path / "made" / file).read_bytes().startswith(b"%PDF") for file in files)


def test_comparisons_have_two_sided_intervals_and_limits(data, tree):
    shown = words(section(tree, "comparisons"))
    for cell in data.assessment.comparisons:
        assert cell.interval is not None
        assert cell.low is not None
        assert cell.interval[0] <= cell.low
        low, high = (format_quantity(bound, signed=True) for bound in cell.interval)
        assert f"{low} to {high} s" in shown
        assert format_quantity(cell.mean, "s", signed=True) in shown
        assert format_quantity(cell.limit, "s") in shown
    assert "two-sided, 95 % confidence" in words(section(tree, "matrix"))


def test_figures_of_the_paper_carry_their_numbers(tree):
    said = " ".join(words(e) for e in elements(tree, "small"))
    for number in (8, 9, 10, 11, 13, 14):
        assert f"Fig. {number}" in said
