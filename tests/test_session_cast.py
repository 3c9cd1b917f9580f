"""Casts are what asciinema reads: a head, then times that only grow; so is the one of the docs."""

from __future__ import annotations

import itertools
import json
import sys
from pathlib import Path
from typing import Any

import pyte
import pytest

from tests.scenario_tui.terminal.pseudo_terminal import terminal
from tests.session_cast import CAST, COLUMNS, LARGEST, LONGEST_PAUSE, ROWS, CastRecorder

SLOW = """
import sys
for word in ("naïve", "second", "third"):
    print(word, flush=True)
    sys.stdin.readline()
"""


def read(path: Path) -> tuple[dict[str, Any], list[tuple[float, str, str]]]:
    head, *events = map(json.loads, path.read_text("utf-8").splitlines())
    return head, [(time, kind, data) for time, kind, data in events]


def valid(path: Path) -> list[tuple[float, str, str]]:
    """The events of a cast, after a look at what the format asks for."""
    head, events = read(path)
    assert head["version"] == 2
    assert (type(head["width"]), type(head["height"])) == (int, int)
    times = [time for time, _, _ in events]
    assert times == sorted(times)
    assert {kind for _, kind, _ in events} <= {"o", "m"}
    return events


def test_what_a_program_sends_is_kept_by_time(tmp_path: Path) -> None:
    with terminal([sys.executable, "-c", SLOW], columns=40, rows=5) as shown:
        cast = CastRecorder(shown)
        cast.until("naïve")
        cast.mark("first")
        cast.press("\n", 0.05)
        cast.until("second")
        cast.press("\n", 0.05)
        cast.until("third")
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


def test_the_session_in_the_docs_shows_its_steps() -> None:
    if not CAST.exists():
        pytest.skip("recorded with the pictures: python -m tests.pictures --cast")
    assert CAST.stat().st_size < LARGEST
    events = valid(CAST)
    times = [time for time, _, _ in events]
    assert max(b - a for a, b in itertools.pairwise(times)) <= LONGEST_PAUSE + 0.001
    marks = [data for _, kind, data in events if kind == "m"]
    assert marks == ["campaigns", "runs", "a run", "signals", "keys"]
    played = pyte.Screen(COLUMNS, ROWS)
    stream, seen = pyte.Stream(played), ""
    for _, kind, data in events:
        if kind == "o":
            stream.feed(data)
            seen += "\n".join(played.display)
    for words in ("demo-", "running", "clearance", "Quit"):
        assert words in seen
