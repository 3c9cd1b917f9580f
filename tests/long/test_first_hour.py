"""The tutorial of the dashboard is true: its keys lead to what it says one sees."""

import itertools
import json
from pathlib import Path

import pyte
import pytest

from campaigns.studies.pictures.session_cast import CAST, LARGEST, LONGEST_PAUSE
from tests.long.first_hour import DOCUMENT, SIZE, Step, follow, read_steps, shell_in
from tests.people.terminal.pseudo_terminal import ALTERNATE, ROOT


def test_steps_are_what_stands_in_backquotes_in_the_tables_of_steps():
    text = (
        "`not this`\n\n## Go\n\n| press | you see |\n|---|---|\n| `g` then `⏎` | `a`, or `b c` |\n"
        "| nothing | nor here |\n\n| key | means |\n|---|---|\n| `x` | `y` |\n"
    )
    assert read_steps(text) == (Step(("g", "⏎"), ("a", "b c"), "Go"),)


@pytest.mark.timeout(1200)  # twelve real runs, beside whatever else the machine does
def test_the_keys_of_the_first_hour_lead_to_what_it_says(tmp_path):
    steps = read_steps(DOCUMENT.read_text("utf-8"))
    assert len(steps) > 20

    def report_is_there(step):
        if step.keys == ("o",):
            shell.until(lambda: bool(list((tmp_path / "robot").glob("demo-*.html"))))

    with shell_in(tmp_path) as shell:
        follow(shell, steps, then=report_is_there)
        assert not shell.mode(ALTERNATE)


def read_cast():
    """Return the head and the events of the cast of the documentation."""
    head, *events = map(json.loads, CAST.read_text("utf-8").splitlines())
    return head, [(time, kind, data) for time, kind, data in events]


def test_the_session_in_the_docs_can_be_played_and_names_no_machine():
    assert CAST.stat().st_size < LARGEST
    head, events = read_cast()
    assert (head["version"], head["width"], head["height"]) == (2, *SIZE)
    assert head["title"]
    assert {kind for _, kind, _ in events} <= {"o", "m"}
    times = [time for time, _, _ in events]
    assert times == sorted(times)
    assert max(b - a for a, b in itertools.pairwise(times)) <= LONGEST_PAUSE + 0.001
    written = "".join(data for _, kind, data in events if kind == "o")
    assert "\N{REPLACEMENT CHARACTER}" not in written
    for folder in ("/home", Path.home(), ROOT):
        assert f"{folder}/" not in written
    # What ships would be named by where this copy lies, which may be anywhere.
    assert "/campaigns/demo/" not in written


def test_the_session_in_the_docs_shows_what_the_tutorial_says():
    played = pyte.Screen(*SIZE)
    stream, written = pyte.Stream(played), ""
    steps = read_steps(DOCUMENT.read_text("utf-8"))
    ahead, marks = list(steps), []
    for _, kind, data in read_cast()[1]:
        if kind == "m":
            marks.append(data)
            continue
        stream.feed(data)
        written += data
        shown = "\n".join(line.rstrip() for line in played.display)
        while ahead and all(word in shown for word in ahead[0].words):
            ahead.pop(0)
    assert ahead == []
    assert marks == list(dict.fromkeys(step.section for step in steps))
    # The screen of the dashboard is left, and the shell has the last word.
    _, left, after = written.rpartition(f"\x1b[?{ALTERNATE}l")
    assert left
    assert after.rstrip().endswith("$")
