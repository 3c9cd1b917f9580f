"""What happened in a run, in words: why it is over, what it was, what was said while it ran."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from rich.text import Text

from daemon.protocol import RunDetail
from daemon.spec import RunResult
from scenario_tui.palette import QUIET, UNSURE
from scenario_tui.widgets.run_text import facts

if TYPE_CHECKING:
    from scenario_tui.playback import Playback

_LINES: Final = 5000

Line = tuple[float, str, str]


def log_text(detail: RunDetail | None, playback: Playback | None, limit: int = _LINES) -> Text:
    """Return everything there is to read about a run, at most ``limit`` lines of its log."""
    text = Text()
    if detail is not None:
        for note in _notes(detail.row.reason, detail.result):
            text.append(f"{note}\n", style=UNSURE)
        if detail.row.attempt > 1:
            text.append(f"this was attempt {detail.row.attempt}\n", style=UNSURE)
        if detail.row.cached:
            text.append(f"not executed again: the result is that of {detail.row.cached}\n")
        facts(text, detail)
    if playback is None:
        return text
    if playback.trace.problems:
        text.append("not to be trusted: ", style=UNSURE)
        text.append("; ".join(playback.trace.problems) + "\n")
    text.append("\n")
    lines = [*log_lines(playback)]
    for time, source, said in lines[:limit]:
        text.append(f"{time:8.2f} s  ", style=QUIET)
        text.append(f"{source:<10} ", style="bold")
        text.append(f"{said}\n")
    if len(lines) > limit:
        text.append(f"and {len(lines) - limit} lines more\n", style=QUIET)
    return text


def log_lines(playback: Playback) -> Iterator[Line]:
    """Yield what was recorded as words, what oracles decided and what doors did, by time [s]."""
    trace = playback.trace
    said = sorted((e.time, e.source, e.text) for e in trace.events)
    decided = [(m.time, "oracle", f"✗ {m.oracle} decided against") for m in playback.moments]
    doors = [
        (event.time, event.name, "opens" if event.opens else "is shut")
        for event in playback.chronicle.doors
    ]
    touched = sorted((c.time, "contact", f"{c.first} touches {c.second}") for c in trace.contacts)
    yield from heapq.merge(said, decided, doors, _first_of_each(touched))


def _first_of_each(touched: list[Line], pause: float = 1.0) -> Iterator[Line]:
    """Leave out contacts that only go on: the same two within a while."""
    last: dict[str, float] = {}
    for time, source, words in touched:
        if time - last.get(words, -pause) >= pause:
            yield time, source, words
        last[words] = time


def _notes(reason: str, result: RunResult | None) -> list[str]:
    note = result.note if result is not None else ""
    return list(dict.fromkeys(filter(None, (reason.strip(), note.strip()))))
