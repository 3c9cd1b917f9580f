"""The page as a reader sees it, in headless Chromium; skipped where there is none."""

import json
import re
import shutil
import subprocess
from base64 import b64encode
from hashlib import sha256
from html import unescape

import pytest

from tests.daemon.analysis.report.recordings import NAME

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
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
    assert [size for size in seen["figures"] if size[0] < 150 or size[1] < 80] == []
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
