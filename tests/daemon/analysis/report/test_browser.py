"""The page as a reader sees it, in headless Chromium; skipped where there is none."""

import json
import re
import shutil
import subprocess
from html import unescape

import pytest

from tests.daemon.analysis.report.recordings import NAME

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium is installed")

PROBE = """
<script>addEventListener("load", () => {
  const box = (e) => { const r = e.getBoundingClientRect(); return [r.x, r.y, r.width, r.height]; };
  const seen = (e) => { const [x, y, w, h] = box(e); return w > 0 && h > 0; };
  const main = document.querySelector("main");
  const found = {
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
  const out = document.createElement("pre");
  out.id = "found"; out.textContent = JSON.stringify(found); document.body.append(out);
});</script>
"""


def look(page, folder, width, *options):
    """Load the page with a probe that notes what is visible, and return the notes."""
    assert CHROMIUM is not None
    policy = re.compile(r'<meta http-equiv="Content-Security-Policy"[^>]*>')
    probed = folder / "probed.html"
    probed.write_text(policy.sub("", page).replace("</body>", PROBE + "</body>"), encoding="utf-8")
    command = [
        CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
        f"--user-data-dir={folder / 'profile'}", f"--window-size={width},900", *options,
        "--dump-dom", probed.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=240, check=True)
    found = re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.DOTALL)
    assert found is not None
    return json.loads(unescape(found[1]))


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
    assert seen["open"] == 1
    assert seen["overlaps"] == 0


def test_a_reader_on_a_phone_in_the_dark_sees_the_same(page, tmp_path):
    seen = look(page, tmp_path, 500, "--blink-settings=preferredColorScheme=0")
    assert seen["answer"].startswith("No.")
    assert seen["pageWidth"] <= seen["windowWidth"]
    assert seen["contents"][0] == "Is it fine?"
    assert all(width <= 500 for width, _ in seen["figures"])
    assert seen["overlaps"] == 0
    assert seen["paper"] != "rgb(255, 255, 255)"
