"""The page as a reader sees it, in headless Chromium; skipped where there is none."""

import json
import re
import subprocess
from base64 import b64encode
from hashlib import sha256
from html import unescape

import pytest

from tests.chromium import CHROMIUM, chromium_page
from tests.daemon.analysis.report.recordings import NAME

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium is installed")

PROBE = """
const problems = [];
addEventListener("error", (event) => problems.push(event.message));
addEventListener("securitypolicyviolation", (event) => problems.push(event.blockedURI));
addEventListener("load", async () => {
  const notes = await (async () => { BODY })();
  const out = document.createElement("pre");
  out.id = "notes"; out.textContent = JSON.stringify({ ...notes, problems });
  document.body.append(out);
});
"""
SEEN = """
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
"""
DONE = """
  const runs = document.querySelector("#runs table");
  const shown = () => [...runs.tBodies[0].rows].filter((row) => !row.hidden)
    .map((row) => row.cells[3].textContent);
  const written = shown();
  const heads = [...runs.tHead.rows[0].cells];
  const button = heads[3].querySelector("button");
  const sorted = [];
  for (const order of [1, 2, 3]) {
    button.click();
    sorted.push([heads[3].getAttribute("aria-sort"), shown()]);
  }
  const field = document.querySelector("#runs .filter input");
  field.value = "far bolted";
  field.dispatchEvent(new Event("input"));
  const filtered = shown().length;
  document.querySelector("#matrix button").click();
  const list = document.querySelector(":popover-open");
  const repeats = [...list.querySelectorAll("tbody tr")].map((row) => row.innerText);
  list.querySelector("a").click();
  return {
    written, sorted, filtered, repeats, count: document.querySelector("#runs output").value,
    open: document.querySelectorAll(":popover-open").length, place: location.hash,
  };
"""


def look(page, folder, width, *options, body=SEEN):
    """Load the page with a probe, allowed by its policy as well, and return the probe's notes."""
    assert CHROMIUM is not None
    probe = PROBE.replace("BODY", body)
    digest = b64encode(sha256(probe.encode()).digest()).decode()
    probed = folder / "probed.html"
    allowed = page.replace("script-src ", f"script-src 'sha256-{digest}' ", 1)
    probed.write_text(allowed.replace("<style>", f"<script>{probe}</script><style>", 1), "utf-8")
    command = [
        CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
        f"--user-data-dir={folder / 'profile'}", f"--window-size={width},900", *options,
        "--dump-dom", probed.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=240, check=True)
    notes = re.search(r'<pre id="notes">(.*?)</pre>', done.stdout, re.DOTALL)
    assert notes is not None
    return json.loads(unescape(notes[1]))


def test_a_reader_at_a_desk_sees_the_answer_the_contents_and_the_figures(page, tmp_path):
    seen = look(page, tmp_path, 1280)
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
    assert seen["problems"] == []


def test_a_reader_on_a_phone_in_the_dark_sees_the_same(page, tmp_path):
    seen = look(page, tmp_path, 500, "--blink-settings=preferredColorScheme=0")
    assert seen["answer"].startswith("No.")
    assert seen["pageWidth"] <= seen["windowWidth"]
    assert seen["contents"][0] == "Is it fine?"
    assert all(width <= 500 for width, _ in seen["figures"])
    assert seen["overlaps"] == 0
    assert seen["problems"] == []
    assert seen["paper"] != "rgb(255, 255, 255)"


def test_tables_answer_a_reader_and_verdicts_list_their_repeats(page, tmp_path):
    notes = look(page, tmp_path, 1280, body=DONE)
    assert notes["problems"] == []
    assert notes["sorted"] == [
        ["ascending", sorted(notes["written"])],
        ["descending", sorted(notes["written"], reverse=True)],
        [None, notes["written"]],
    ]
    assert notes["filtered"] == 2
    assert notes["count"] == "2 of 8"
    assert len(notes["repeats"]) == 2
    assert all("scenario judge" in repeat for repeat in notes["repeats"])
    assert notes["open"] == 0
    assert notes["place"].startswith("#run-")


@pytest.fixture
def open_page(page, tmp_path):
    """The page as a browser has it that can reach no network."""
    file = tmp_path / "page.html"
    file.write_text(page, "utf-8")
    with chromium_page(file, tmp_path) as opened:
        yield opened


def live_chart(opened, selector):
    """Scroll to a chart until it is alive; return where its plot is [px]."""
    opened.evaluate(
        f"chart = document.querySelector({selector!r}); drawn = chart.getBoundingClientRect();"
        "chart.scrollIntoView({ behavior: 'instant', block: 'center' })"
    )
    opened.wait("chart.classList.contains('alive')")
    return opened.evaluate(
        "(() => { const r = chart.querySelector('.live svg').getBoundingClientRect();"
        " return [r.x, r.y, r.width, r.height, drawn.width, drawn.height]; })()"
    )


def test_a_chart_comes_alive_in_its_place_and_says_the_values_under_the_pointer(open_page):
    x, y, width, height, drawn_width, drawn_height = live_chart(open_page, "#clearance .chart")
    assert width == pytest.approx(drawn_width, abs=2.0)
    assert height == pytest.approx(drawn_height, abs=4.0)
    for step in (0.5, 0.51):
        open_page.point("Moved", x + step * width, y + 0.5 * height)
    told = open_page.wait("document.querySelector('#vg-tooltip-element.visible')?.innerText")
    assert {"repeat", "time [s]", "clearance [m]"} <= {
        line.split("\t")[0] for line in told.split("\n")
    }
    assert open_page.problems == []


def test_a_brushed_span_of_time_is_marked_on_the_map_and_in_the_other_chart(open_page):
    live_chart(open_page, "#localisation .panels:last-child .chart")
    x, y, width, height, *_ = live_chart(open_page, "#clearance .chart")
    open_page.evaluate(
        "ofCell = (selector) => [...document.querySelectorAll(selector)].find((element) =>"
        " element.closest('[data-cell]').dataset.cell === chart.dataset.cell)"
    )
    middle = y + 0.5 * height
    open_page.point("Moved", x + 0.3 * width, middle)
    open_page.point("Pressed", x + 0.3 * width, middle, held=True)
    for step in (0.4, 0.5, 0.6):
        open_page.point("Moved", x + step * width, middle, held=True)
    open_page.point("Released", x + 0.6 * width, middle, held=True)
    way = open_page.wait("ofCell('svg[data-way]').querySelector('.brushed')?.getAttribute('d')")
    assert re.fullmatch(r"(M[-\d.]+ [-\d.]+( [-\d.]+ [-\d.]+)+)+", way)
    open_page.point("Moved", x + 0.7 * width, middle)
    assert open_page.wait("ofCell('svg[data-way]').querySelector('.pointed')?.getAttribute('cx')")
    assert open_page.problems == []


def test_on_paper_the_drawings_of_all_charts_are_there(page, open_page):
    count = page.count('class="chart"')
    live_chart(open_page, "#clearance .chart")
    seen = "[...document.querySelectorAll('.chart > svg')].filter((e) => e.clientWidth).length"
    assert open_page.evaluate(seen) < count
    open_page.call("Emulation.setEmulatedMedia", media="print")
    assert open_page.evaluate(seen) == count
    assert not open_page.evaluate("document.querySelector('.chart.alive .live').clientWidth")


def test_without_scripts_all_figures_are_there(page, tmp_path):
    bare = re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)
    seen = look(bare, tmp_path, 1280)
    assert len(seen["figures"]) >= page.count('class="chart"') + page.count('class="map" data-cell')
    assert seen["problems"] == []
