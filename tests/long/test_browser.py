"""Pages as readers see them, in headless Chromium; skipped where there is none."""

import re
from contextlib import contextmanager

import pytest

from daemon.analysis.history import (
    CampaignHistory,
    OracleRecord,
    SubmissionRecord,
    history_page,
)
from daemon.analysis.report import write_page
from daemon.search.page import search_page
from tests.analysis.report.recordings import (
    NAME,
    REPEATS,
    commands,
    record_campaign,
    report_of,
)
from tests.analysis.search.searches import finished_search
from tests.analysis.search.tasks import ranged
from tests.chromium import CHROMIUM, chromium_page

DARK = "--blink-settings=preferredColorScheme=0"
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium is installed")

SEEN = """(() => {
  const box = (e) => { const r = e.getBoundingClientRect(); return [r.x, r.y, r.width, r.height]; };
  const seen = (e) => { const [x, y, w, h] = box(e); return w > 0 && h > 0; };
  const main = document.querySelector("main");
  return {
    title: document.title,
    answer: document.querySelector(".answer").innerText,
    answerBox: box(document.querySelector(".answer")),
    navPosition: getComputedStyle(document.querySelector("nav")).position,
    contents: [...document.querySelectorAll("nav a")].filter(seen).map((a) => a.innerText),
    text: main.innerText,
    paper: getComputedStyle(document.body).backgroundColor,
    pageWidth: document.documentElement.scrollWidth,
    windowWidth: innerWidth,
    figures: [...document.querySelectorAll("section figure svg")].filter(seen)
      .map((s) => box(s).slice(2)),
    textSizes: [...document.querySelectorAll("section figure svg text")].filter(seen)
      .map((t) => box(t)[3]),
    strokes: [...new Set([...document.querySelectorAll("figure svg path")].filter(seen)
      .map((p) => getComputedStyle(p).stroke))],
    overlaps: [...document.querySelectorAll(".oracle")].filter((o) => {
      const [rate, worst] = [".interval", ".worst"].map((part) => {
        const range = document.createRange();
        range.selectNodeContents(o.querySelector(part));
        return range.getBoundingClientRect();
      });
      return worst.width > 0 && rate.right > worst.left && rate.bottom > worst.top
        && worst.bottom > rate.top;
    }).length,
    open: [...document.querySelectorAll("details")].filter((d) => d.open).length,
  };
})()"""
ROWS = """[...document.querySelector("#runs table").tBodies[0].rows]
  .filter((row) => !row.hidden).map((row) => row.cells[3].textContent)"""


@contextmanager
def opened(page, folder, *options, width=1280):
    """Open a page as a browser has it that can reach no network."""
    file = folder / "page.html"
    file.write_text(page, "utf-8")
    with chromium_page(file.as_uri(), folder, *options, width=width) as browser:
        browser.evaluate("document.documentElement.style.scrollBehavior = 'auto'")
        yield browser
        assert browser.problems == []


def click(browser, *places):
    """Press the mouse at the first place, move it to the others, and release it."""
    browser.point("Moved", *places[0])
    browser.point("Pressed", *places[0], held=True)
    for place in places[1:]:
        browser.point("Moved", *place, held=True)
    browser.point("Released", *places[-1], held=True)


def middle(browser, element):
    """The middle of an element [px]."""
    return browser.evaluate(
        f"(() => {{ const box = {element}.getBoundingClientRect();"
        " return [box.x + box.width / 2, box.y + box.height / 2]; })()"
    )


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = record_campaign(tmp_path_factory.mktemp("traces") / "results")
    return write_page(report_of(folder), commands, processes=1)


@pytest.fixture
def open_page(page, tmp_path):
    with opened(page, tmp_path) as browser:
        yield browser


def test_a_reader_at_a_desk_sees_the_answer_the_contents_and_the_figures(open_page):
    seen = open_page.evaluate(SEEN)
    assert seen["answer"] == "No. 1 of 14 verdicts is not as expected."
    assert seen["answerBox"][1] < 200
    assert seen["title"] == f"No: {NAME}"
    assert NAME in seen["text"]
    assert seen["navPosition"] == "sticky"
    assert seen["contents"][:2] == ["Is it fine?", "Verdicts"]
    assert seen["pageWidth"] <= seen["windowWidth"]
    assert len(seen["figures"]) >= 8
    assert [size for size in seen["figures"] if size[0] < 150 or size[1] < 70] == []
    assert min(seen["textSizes"]) >= 8
    assert len(set(seen["strokes"]) - {"none"}) >= 4
    assert seen["open"] == 2
    assert seen["overlaps"] == 0


def test_a_reader_on_a_phone_in_the_dark_sees_the_same(page, tmp_path):
    with opened(page, tmp_path, DARK, width=500) as browser:
        seen = browser.evaluate(SEEN)
    assert seen["windowWidth"] == 500
    assert seen["answer"].startswith("No.")
    assert seen["pageWidth"] <= seen["windowWidth"]
    assert seen["contents"][0] == "Is it fine?"
    assert all(width <= 500 for width, _ in seen["figures"])
    assert seen["overlaps"] == 0
    assert seen["paper"] != "rgb(255, 255, 255)"


def test_a_table_sorts_by_a_column_up_down_and_back_and_shows_the_rows_with_some_words(open_page):
    written = open_page.evaluate(ROWS)
    head = "document.querySelectorAll('#runs th')[3]"
    for order, rows in (
        ("ascending", sorted(written)),
        ("descending", sorted(written, reverse=True)),
        (None, written),
    ):
        open_page.evaluate(f"{head}.querySelector('button').click()")
        assert open_page.evaluate(f"{head}.ariaSort") == order
        assert open_page.evaluate(ROWS) == rows
    open_page.evaluate("document.querySelector('#runs details').open = true")
    open_page.evaluate("document.querySelector('#runs .filter input').focus()")
    open_page.call("Input.insertText", text="FAR bolted")
    assert open_page.evaluate(ROWS) == ["0", "1"]
    assert open_page.evaluate("document.querySelector('#runs output').value") == "2 of 8"


def test_a_click_on_the_bar_of_a_verdict_lists_its_repeats_which_lead_to_their_runs(open_page):
    shown = "document.querySelector(':popover-open')"
    for leave in ("key", "link"):
        open_page.evaluate("document.querySelector('#matrix button').click()")
        repeats = open_page.evaluate(
            f"[...{shown}.querySelectorAll('tbody tr')].map(r => r.innerText)"
        )
        assert len(repeats) == REPEATS
        assert all("scenario judge" in repeat for repeat in repeats)
        if leave == "key":
            for kind in ("keyDown", "keyUp"):
                open_page.call(
                    "Input.dispatchKeyEvent", type=kind, key="Escape", windowsVirtualKeyCode=27
                )
        else:
            open_page.evaluate(f"{shown}.querySelector('a').click()")
        assert open_page.evaluate(f"{shown} === null")
    assert open_page.evaluate("document.querySelector(':target').closest('details').open")


def live_chart(browser, selector):
    """Scroll to a chart until it is alive; return where its plot is [px]."""
    browser.evaluate(
        f"chart = document.querySelector({selector!r}); drawn = chart.getBoundingClientRect();"
        "letters = (svg) => [...svg.querySelectorAll('text')]"
        ".map((text) => text.getBoundingClientRect().height);"
        "drawnLetters = letters(chart.querySelector('svg'));"
        "chart.scrollIntoView({ behavior: 'instant', block: 'center' })"
    )
    browser.wait("chart.classList.contains('alive')")
    return browser.evaluate(
        "(() => { const r = chart.querySelector('.live svg').getBoundingClientRect();"
        " return [r.x, r.y, r.width, r.height, drawn.width, drawn.height]; })()"
    )


def test_a_chart_comes_alive_in_its_place_and_says_the_values_under_the_pointer(open_page):
    x, y, width, height, drawn_width, drawn_height = live_chart(open_page, "#clearance .chart")
    assert width == pytest.approx(drawn_width, abs=2.0)
    assert height == pytest.approx(drawn_height, abs=4.0)
    drawn, live = open_page.evaluate("[drawnLetters, letters(chart.querySelector('.live svg'))]")
    assert live == pytest.approx(drawn, abs=1.0)
    for step in (0.5, 0.51):
        open_page.point("Moved", x + step * width, y + 0.5 * height)
    text = open_page.wait("document.querySelector('#vg-tooltip-element.visible')?.innerText")
    names = {line.split("\t")[0] for line in text.split("\n")}
    assert {"repeat", "time [s]", "clearance [m]"} <= names


def test_an_entry_of_a_legend_is_shown_alone_after_a_click(open_page):
    live_chart(open_page, "#localisation .panels:last-child .chart")
    dimmed = "[...chart.querySelectorAll('.live path[opacity=\"0.05\"]')]"
    assert open_page.evaluate(f"{dimmed}.length") == 0
    entry = "[...chart.querySelectorAll('.live text')].find((text) => text.textContent === 'σx')"
    click(open_page, middle(open_page, entry))
    assert open_page.wait(f"new Set({dimmed}.map((line) => line.getAttribute('stroke'))).size") == 1


def test_a_brushed_span_of_time_is_marked_on_the_map_and_in_the_other_chart(open_page):
    live_chart(open_page, "#localisation .panels:last-child .chart")
    x, y, width, height, *_ = live_chart(open_page, "#clearance .chart")
    open_page.evaluate(
        "ofCell = (selector) => [...document.querySelectorAll(selector)].find((element) =>"
        " element.closest('[data-cell]').dataset.cell === chart.dataset.cell)"
    )
    click(open_page, *((x + step * width, y + 0.5 * height) for step in (0.3, 0.4, 0.5, 0.6)))
    way = open_page.wait("ofCell('svg[data-way]').querySelector('.brushed')?.getAttribute('d')")
    assert re.fullmatch(r"(M[-\d.]+ [-\d.]+( [-\d.]+ [-\d.]+)+)+", way)
    open_page.point("Moved", x + 0.7 * width, y + 0.5 * height)
    assert open_page.wait("ofCell('svg[data-way]').querySelector('.pointed')?.getAttribute('cx')")


def test_on_paper_the_drawings_of_all_charts_are_there(page, open_page):
    count = page.count('class="chart"')
    live_chart(open_page, "#clearance .chart")
    seen = "[...document.querySelectorAll('.chart > svg')].filter((e) => e.clientWidth).length"
    assert open_page.evaluate(seen) < count
    open_page.call("Emulation.setEmulatedMedia", media="print")
    assert open_page.evaluate(seen) == count
    assert not open_page.evaluate("document.querySelector('.chart.alive .live').clientWidth")


def test_the_failing_runs_of_a_search_are_shown_alone_after_a_click_on_the_legend(tmp_path):
    search = finished_search(*(ranged(f"doors.time_{number}") for number in range(6)))
    with opened(search_page(*search), tmp_path, width=500) as browser:
        live_chart(browser, "#space .chart")
        dimmed = "[...chart.querySelectorAll('.live [opacity=\"0.05\"]')].length"
        assert browser.evaluate(dimmed) == 0
        entry = (
            "[...chart.querySelectorAll('.live text')].find((text) => text.textContent === 'fails')"
        )
        click(browser, middle(browser, entry))
        assert browser.wait(dimmed) > 0
        assert browser.evaluate("document.documentElement.scrollWidth") <= 500


def test_an_oracle_that_is_clicked_in_the_legend_of_a_history_is_shown_alone(tmp_path):
    # Whether a mission is done has no margin.
    oracles = tuple(
        OracleRecord("S1", "pilot", name, unit, "pass", 5, 5, 0.5, 1.0, margin, margin, 20.0, 1.5)
        for name, unit, margin in (("arrives", "s", 2.0), ("clear", "m", 0.5), ("done", "", None))
    )
    submission = SubmissionRecord("d-1", 0.0, 5, 0, True, "", "", None, ("bench",), 7.5, oracles)
    history = CampaignHistory("demo", (submission,) * 2)
    faded = "document.querySelectorAll('#cells figure:first-of-type [opacity=\"0.1\"]').length"
    entry = (
        '[...document.querySelectorAll("#cells .live .role-legend-label text")]'
        '.find((text) => text.textContent === "clear")'
    )
    with opened(history_page(history), tmp_path, width=500) as browser:
        browser.evaluate("document.querySelector('#cells').scrollIntoView()")
        browser.wait("document.querySelectorAll('#cells .live .mark-line path').length")
        assert browser.evaluate(faded) == 0
        click(browser, middle(browser, entry))
        assert browser.wait(faded) > 0
        assert browser.evaluate("document.documentElement.scrollWidth") <= 500
