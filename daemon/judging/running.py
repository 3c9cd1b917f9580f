"""A run that goes on, judged by what is recorded of it: signals, verdicts, doors, mission, log.

By the code that judges finished runs, so that the last of these judgements says what the run's
verdicts will be.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from daemon.judging.oracles import SignalSampler, judge_so_far, oracle_timeline, trace_problems
from daemon.judging.run_log import run_log
from daemon.judging.run_signals import (
    door_motions,
    reached_moments,
    sample_run_signals,
    thin_signal,
)
from daemon.model.live_judgement import LiveJudgement, LiveSignal, LogLine, ProvisionalVerdict
from daemon.model.verdicts import Outcome
from daemon.trace import Trace
from grammars.text.terminal_text import printable

MOST_COLUMNS: Final = 200
"""Parts of the time in which a signal is told at most."""
_COLUMNS_IN_ALL: Final = 1600
"""Where there are more than eight signals, each is told in fewer parts."""
_FEWEST_COLUMNS: Final = 40
MOST_LINES: Final = 200
"""Lines of the log at most."""
_LINE_LENGTH: Final = 200
_MOST_MOTIONS: Final = 1000
"""Motions of doors at most, the last ones: hinges may swing for hours."""


class RunningJudge:
    """Judges one run again and again while it goes on; remembers when oracles were decided."""

    def __init__(self) -> None:
        self._decided: dict[str, LogLine] = {}

    def judge(self, trace: Trace) -> LiveJudgement:
        """Return what the run is judged by ``trace``, which is that of all until now.

        ``run`` is left empty: a trace does not know its name in a queue. Nothing is raised.
        """
        problems = trace_problems(trace)
        sampler = None if problems else SignalSampler(trace)
        signals = () if sampler is None else _thinned_signals(sampler)
        verdicts = judge_so_far(trace, trace.spec.oracles, sampler=sampler)
        if sampler is not None:
            self._note_decided(verdicts, sampler)
        lines = [*heapq.merge(run_log(trace), self._decisions(), key=lambda line: line.time)]
        return LiveJudgement(
            "",
            trace.valid_until,
            signals,
            verdicts,
            door_motions(trace.joints)[-_MOST_MOTIONS:],
            reached_moments(trace),
            tuple(map(_short, lines[-MOST_LINES:])),
            max(0, len(lines) - MOST_LINES),
        )

    def _note_decided(self, verdicts: Sequence[ProvisionalVerdict], sampler: SignalSampler) -> None:
        """Note when oracles were decided: once, since what is most telling may change later."""
        for one, written in zip(verdicts, sampler.trace.spec.oracles, strict=True):
            verdict = one.verdict
            if not one.final or verdict.oracle in self._decided:
                continue
            time = verdict.evidence.time
            if verdict.outcome is Outcome.FAIL:
                against = oracle_timeline(written, sampler).against
                time = against[0][0] if against else time
            about = f" ({verdict.evidence.object})" if verdict.evidence.object else ""
            text = f"decided: {verdict.outcome}{about}"
            when = sampler.time_base.end if time is None else time
            self._decided[verdict.oracle] = LogLine(when, verdict.oracle, text)

    def _decisions(self) -> list[LogLine]:
        return sorted(self._decided.values(), key=lambda line: line.time)


def _thinned_signals(sampler: SignalSampler) -> tuple[LiveSignal, ...]:
    found = sample_run_signals(sampler)
    share = _COLUMNS_IN_ALL // max(len(found), 1)
    columns = min(MOST_COLUMNS, max(_FEWEST_COLUMNS, share))
    start, end = sampler.time_base.start, sampler.time_base.end
    return tuple(thin_signal(signal, start, end, columns) for signal in found)


def _short(line: LogLine) -> LogLine:
    text = printable(" ".join(line.text[: 2 * _LINE_LENGTH].split())[:_LINE_LENGTH])
    return replace(line, source=printable(line.source[:_LINE_LENGTH]), text=text)
