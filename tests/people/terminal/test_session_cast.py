"""Casts are what asciinema reads: a head, then times that only grow; so is the one of the docs."""

import itertools
import json
import sys
from pathlib import Path

import pyte

from tests.people.pictures.session_cast import CAST, LARGEST, LONGEST_PAUSE, CastRecorder
from tests.people.terminal.first_hour import DOCUMENT, SIZE, read_steps
from tests.people.terminal.pseudo_terminal import ALTERNATE, ROOT, terminal

SLOW = """
import sys
for word in ("naïve", "second", "third"):
    print(word, flush=True)
    sys.stdin.readline()
"""


def read(path):
    head, *events = map(json.loads, path.read_text("utf-8").splitlines())
    return head, [(time, kind, data) for time, kind, data in events]


def valid(path):
    """The events of a cast, after a look at what the format asks for."""
    head, events = read(path)
    assert head["version"] == 2
    assert (type(head["width"]), type(head["height"])) == (int, int)
    times = [time for time, _, _ in events]
    assert times == sorted(times)
    assert {kind for _, kind, _ in events} <= {"o", "m"}
    return events


def test_what_a_program_sends_is_kept_by_time(tmp_path):
    with terminal([sys.executable, "-c", SLOW], columns=40, rows=5) as shown:
        cast = CastRecorder(shown)
        cast.until("naïve")
        cast.mark("first")
        for word in ("second", "third"):
            shown.type("\n")
            cast.until(word)
        cast.write(tmp_path / "run.cast", "words")
        screen = list(shown.lines)
    events = valid(tmp_path / "run.cast")
    played = pyte.Screen(40, 5)
    stream = pyte.Stream(played)
    for _, kind, data in events:
        if kind == "o":
            stream.feed(data)
    assert [line.rstrip() for line in played.display] == screen
    assert [data for _, kind, data in events if kind == "m"] == ["first"]


def test_the_session_in_the_docs_can_be_played_and_names_no_machine():
    assert CAST.stat().st_size < LARGEST
    head, _ = read(CAST)
    assert (head["width"], head["height"]) == SIZE
    assert head["title"]
    events = valid(CAST)
    times = [time for time, _, _ in events]
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
    for _, kind, data in valid(CAST):
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
