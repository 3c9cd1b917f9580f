"""The log of a run: what was said, what oracles decided, what doors did; live or recorded."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Final

from rich.text import Text

from daemon.model.live_judgement import LiveJudgement
from daemon.model.spec import RunResult
from daemon.model.status import RunDetail
from grammars.text.words import count_noun
from scenario_tui.text.formatting import last_lines, printed_lines, time_text
from scenario_tui.text.run_text import append_facts
from scenario_tui.text.styles import QUIET, UNSURE

if TYPE_CHECKING:
    from scenario_tui.dashboard.playback import Playback

_LINES: Final = 5000
"""Lines of the log laid out at once; `scenario show --log --all` prints all."""

Line = tuple[float, str, str]


def log_text(
    detail: RunDetail | None,
    playback: Playback | None,
    limit: int = _LINES,
    *,
    judgement: LiveJudgement | None = None,
) -> Text:
    """Return everything there is to read about a run, at most ``limit`` lines of its log.

    Of a run that goes on, or whose trace is not read yet, that is what its ``judgement`` tells.
    """
    text = Text()
    if detail is not None:
        for note in _notes(detail.row.reason, detail.row.result):
            text.append(f"{note}\n", style=UNSURE)
        if detail.row.attempt > 1:
            text.append(f"this was attempt {detail.row.attempt}\n", style=UNSURE)
        if detail.row.cached:
            text.append(f"not executed again: the result is that of {detail.row.cached}\n")
        if detail.row.result is None and judgement is None:
            return text.append("Its log comes while it runs.\n", style=QUIET)
        append_facts(text, detail)
    if playback is None:
        if judgement is not None:
            _append_live(text, judgement)
        return text
    if playback.trace.problems:
        text.append("not to be trusted: ", style=UNSURE)
        text.append("; ".join(playback.trace.problems) + "\n")
    text.append("\n")
    lines = [*log_lines(playback)]
    _append_lines(text, lines[:limit])
    if len(lines) > limit:
        text.append(f"and {len(lines) - limit} lines more\n", style=QUIET)
    _append_outputs(text, playback)
    return text


def _append_live(text: Text, judgement: LiveJudgement) -> None:
    """Add the end of the log of a run that goes on."""
    text.append("\n")
    if judgement.log_before:
        more = count_noun(judgement.log_before, "line")
        text.append(f"{more} before these\n", style=QUIET)
    _append_lines(text, ((line.time, line.source, line.text) for line in judgement.log))


def _append_lines(text: Text, lines: Iterable[Line]) -> None:
    for time, source, said in lines:
        text.append(f"{time_text(time):>10}  ", style=QUIET)
        text.append(f"{source:<10} ", style="bold")
        text.append("\n".join(printed_lines(said)) + "\n")


def _append_outputs(text: Text, playback: Playback) -> None:
    """Add the last lines of what an external system under test printed."""
    for name, printed in playback.outputs.items():
        shown, hidden = last_lines(printed)
        text.append(f"\n{name}\n", style="bold")
        if hidden:
            more = count_noun(hidden, "line")
            text.append(f"{more} before these: scenario show --log --all prints all\n", style=QUIET)
        text.append("".join(f"{line}\n" for line in shown or ["(nothing)"]))


def log_lines(playback: Playback) -> Iterator[Line]:
    """Yield what was recorded as words, what oracles decided and what doors did, by time [s]."""
    # Loaded when a trace is there to be read.
    from daemon.judging.run_log import run_log

    said = ((line.time, line.source, line.text) for line in run_log(playback.trace))
    decided = [(m.time, "oracle", f"✗ {m.oracle} decided against") for m in playback.moments]
    doors = [
        (event.time, event.joint, "opens" if event.opens else "is shut")
        for event in playback.timeline.doors or ()
    ]
    yield from heapq.merge(said, decided, doors, key=lambda line: line[0])


def _notes(reason: str, result: RunResult | None) -> list[str]:
    note = result.note if result is not None else ""
    return list(dict.fromkeys(filter(None, (reason.strip(), note.strip()))))
