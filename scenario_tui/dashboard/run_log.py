"""The log of a run: its events, the decisions of oracles and the motions of doors."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, TypeAlias

from rich.text import Text

from daemon.model.status import RunDetail
from grammars.text.words import count_noun
from scenario_tui.text.formatting import last_lines, printed_lines, time_text
from scenario_tui.text.run_text import append_facts
from scenario_tui.text.styles import QUIET, UNSURE

if TYPE_CHECKING:
    from daemon.model.live_judgement import DoorMotion
    from daemon.trace import Trace
    from scenario_tui.dashboard.transport import FailureMoment

_LINES: Final = 5000
"""Most lines of the log on a screen; `scenario show --log --all` prints all."""

Line: TypeAlias = tuple[float, str, str]
"""The moment [s], the source and the words of a line."""


@dataclass(frozen=True, slots=True)
class LogExcerpt:
    """Lines by time, with the numbers of lines left out ``before`` and ``after`` them.

    ``problems`` tell why a trace cannot be trusted; ``outputs`` are those of external systems by
    name.
    """

    lines: tuple[Line, ...] = ()
    before: int = 0
    after: int = 0
    problems: tuple[str, ...] = ()
    outputs: Mapping[str, str] = field(default_factory=dict)


def recorded_log(
    trace: Trace,
    moments: Iterable[FailureMoment],
    doors: Iterable[DoorMotion],
    outputs: Mapping[str, str],
) -> LogExcerpt:
    """Return the log of a recorded run, at most :data:`_LINES` lines of it."""
    # Loaded with the first trace.
    from daemon.judging.run_log import run_log

    events = ((line.time, line.source, line.text) for line in run_log(trace))
    failures = ((m.time, "oracle", f"✗ {m.oracle} failed") for m in moments)
    motions = ((event.time, event.joint, "opens" if event.opens else "is shut") for event in doors)
    lines = tuple(heapq.merge(events, failures, motions, key=lambda line: line[0]))
    after = max(len(lines) - _LINES, 0)
    return LogExcerpt(lines[:_LINES], 0, after, tuple(trace.problems), outputs)


def log_text(detail: RunDetail, log: LogExcerpt | None) -> Text:
    """Return the text of a run: notes, facts and its ``log``, ``None`` before the first lines."""
    text = Text()
    result = detail.row.result
    notes = (detail.row.reason.strip(), result.note.strip() if result is not None else "")
    for note in dict.fromkeys(filter(None, notes)):
        text.append(f"{note}\n", style=UNSURE)
    if detail.row.attempt > 1:
        text.append(f"this was attempt {detail.row.attempt}\n", style=UNSURE)
    if detail.row.cached:
        text.append(f"not executed again: the result comes from {detail.row.cached}\n")
    if result is None and log is None:
        return text.append("Its log comes while it runs.\n", style=QUIET)
    append_facts(text, detail)
    if log is not None:
        _append_log(text, log)
    return text


def _append_log(text: Text, log: LogExcerpt) -> None:
    if log.problems:
        text.append("cannot be trusted: ", style=UNSURE).append("; ".join(log.problems) + "\n")
    text.append("\n")
    if log.before:
        text.append(f"{count_noun(log.before, 'line')} before these\n", style=QUIET)
    for time, source, words in log.lines:
        text.append(f"{time_text(time):>10}  ", style=QUIET)
        text.append(f"{source:<10} ", style="bold")
        text.append("\n".join(printed_lines(words)) + "\n")
    if log.after:
        text.append(f"and {count_noun(log.after, 'line')} more\n", style=QUIET)
    for name, printed in log.outputs.items():
        last, hidden = last_lines(printed)
        text.append(f"\n{name}\n", style="bold")
        if hidden:
            more = count_noun(hidden, "line")
            text.append(f"{more} before these: scenario show --log --all prints all\n", style=QUIET)
        text.append("".join(f"{line}\n" for line in last or ["(nothing)"]))
