"""A run along time: its signals, doors and mission; and while it goes on, its judgement so far.

The code that judges finished runs also judges running ones: the last judgement of a run has the
verdicts of its result.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from daemon.judging.oracles import (
    DOOR_CLEARANCE,
    SignalSampler,
    judge_so_far,
    oracle_timeline,
    trace_problems,
)
from daemon.judging.run_log import run_log
from daemon.model.live_judgement import DoorMotion, LiveJudgement, LiveSignal, LogLine
from daemon.model.ranges import LARGEST_VALUE
from daemon.model.verdicts import Outcome, Verdict, deciding_verdict
from daemon.trace import JointTrack, Trace
from grammars.model.geometry import Floats
from grammars.oracle import Signal, kind_of
from grammars.text.expressions import render
from grammars.text.terminal_text import printable

TimeSpan = tuple[float, float]

MOST_COLUMNS: Final = 200
"""Parts of the time in which a signal is sent, at most."""
_COLUMNS_IN_ALL: Final = 1600
"""With more than eight signals each is sent in fewer parts."""
_FEWEST_COLUMNS: Final = 40
MOST_LINES: Final = 200
"""Lines of the log, at most."""
_LINE_LENGTH: Final = 200
_MOST_MOTIONS: Final = 1000
"""Motions of doors, at most, the last ones: hinges may swing for hours."""
_USUAL: Final = {"loc.error": "m", "clearance": "m", DOOR_CLEARANCE: "m", "speed": "m/s"}
"""Signals of every run, and their units."""
_AJAR: Final = 0.05
"""A door this far from how it is drawn, shut, counts as open [rad or m]."""
_MOST_LIMITS: Final = 1000
"""Limits of a thinned signal: with more the lines cannot be told apart."""
_DIGITS: Final = 4
"""Significant digits of thinned values: more are not visible."""


@dataclass(frozen=True, slots=True, eq=False)
class RunSignal:
    """A signal over a run: ``time``, ``values`` (n,) in SI units, NaN where it is not known.

    ``unit`` is ``bool`` for true or false; ``limits``, ``against`` and ``readers`` are those of
    :class:`~daemon.model.live_judgement.LiveSignal`.
    """

    name: str
    unit: str
    time: Floats
    values: Floats
    limits: tuple[float, ...] = ()
    against: tuple[TimeSpan, ...] = ()
    readers: tuple[str, ...] = ()


def judge_running(trace: Trace) -> LiveJudgement:
    """Return the judgement of a run by ``trace``, all that is recorded of it until now.

    ``run`` is left empty: a trace does not know its name in a queue. Nothing is raised.
    """
    sampler = None if trace_problems(trace) else SignalSampler(trace)
    lines = run_log(trace)
    return LiveJudgement(
        "",
        trace.valid_until,
        () if sampler is None else _thinned_signals(sampler),
        judge_so_far(trace, trace.spec.oracles, sampler=sampler),
        door_motions(trace.joints)[-_MOST_MOTIONS:],
        reached_moments(trace),
        tuple(map(_short, lines[-MOST_LINES:])),
        max(0, len(lines) - MOST_LINES),
    )


def least_margin(so_far: Sequence[Verdict]) -> Verdict | None:
    """Return the verdict that a list shows of a run that goes on, if any has a margin.

    By the rule of finished runs, :func:`daemon.model.verdicts.deciding_verdict`.
    """
    return deciding_verdict(
        verdict
        for verdict in so_far
        if verdict.outcome in (Outcome.PASS, Outcome.FAIL) and verdict.margin is not None
    )


def sample_run_signals(sampler: SignalSampler) -> tuple[RunSignal, ...]:
    """Sample the usual signals and all that the run's oracles read, each once.

    A usual signal is left out if no oracle reads it and nothing of it is known.
    """
    oracles = [oracle_timeline(one, sampler) for one in sampler.trace.spec.oracles]
    asked = {render(signal): signal for oracle in oracles for signal in oracle.signals}
    signals = []
    for name, signal in ({name: Signal(name) for name in _USUAL} | asked).items():
        values = sampler.sample(signal).values
        if name not in asked and not np.isfinite(values).any():
            continue
        kind = kind_of(signal) if name in asked else None
        unit = _USUAL.get(name) or ("bool" if kind is None else kind.unit)
        readers = [o for o in oracles if name in {render(read) for read in o.signals}]
        limits = {limit for o in readers for read, limit in o.limits if read == name}
        against = merge_spans(span for o in readers for span in o.against)
        signals.append(
            RunSignal(
                name, unit, sampler.time_base.time, values, tuple(sorted(limits)), against,
                tuple(reader.oracle for reader in readers),
            )
        )  # fmt: skip
    return tuple(signals)


def merge_spans(stretches: Iterable[TimeSpan], gap: float = 0.0) -> tuple[TimeSpan, ...]:
    """Return stretches of time as few, ascending and disjoint ones, more than ``gap`` [s] apart."""
    merged: list[TimeSpan] = []
    for start, end in sorted(stretches):
        if merged and start <= merged[-1][1] + gap:
            merged[-1] = (merged[-1][0], max(end, merged[-1][1]))
        else:
            merged.append((start, end))
    return tuple(merged)


def _thinned_signals(sampler: SignalSampler) -> tuple[LiveSignal, ...]:
    signals = sample_run_signals(sampler)
    share = _COLUMNS_IN_ALL // max(len(signals), 1)
    columns = min(MOST_COLUMNS, max(_FEWEST_COLUMNS, share))
    start, end = sampler.time_base.start, sampler.time_base.end
    return tuple(thin_signal(signal, start, end, columns) for signal in signals)


def thin_signal(signal: RunSignal, start: float, end: float, columns: int) -> LiveSignal:
    """Return the least and the greatest value in each of ``columns`` equal parts of the time.

    A part without a sample holds the last value before it, as between two samples; values keep four
    significant digits. Stretches that are less than a part apart become one, so that there are not
    more of them than parts.
    """
    span = max(end - start, 1e-9)
    column = np.floor((signal.time - start) / span * columns).astype(np.int64)
    column = np.clip(column, 0, columns - 1)
    finite = np.isfinite(signal.values)
    low, high = np.full(columns, np.inf), np.full(columns, -np.inf)
    np.minimum.at(low, column[finite], signal.values[finite])
    np.maximum.at(high, column[finite], signal.values[finite])
    last = np.searchsorted(column, np.arange(columns), side="right") - 1
    empty = np.bincount(column, minlength=columns) == 0
    held = empty & (last >= 0) & finite[np.maximum(last, 0)]
    low[held] = high[held] = signal.values[last[held]]
    return LiveSignal(
        signal.name, signal.unit, start, end, _rounded(low), _rounded(high),
        signal.limits[:_MOST_LIMITS], merge_spans(signal.against, span / columns), signal.readers,
    )  # fmt: skip


def _rounded(values: Floats) -> tuple[float | None, ...]:
    return tuple(
        float(f"{min(max(value, -LARGEST_VALUE), LARGEST_VALUE):.{_DIGITS}g}")
        if np.isfinite(value)
        else None
        for value in values.tolist()
    )


def door_motions(joints: JointTrack) -> tuple[DoorMotion, ...]:
    """Return when every joint left or came back to how it is drawn, by time."""
    motions = []
    for column, name in enumerate(joints.names):
        open_ = np.abs(joints.position[:, column]) > _AJAR
        turns = (np.flatnonzero(np.diff(open_)) + 1).tolist()
        motions += [DoorMotion(float(joints.time[i]), name, bool(open_[i])) for i in turns]
    return tuple(sorted(motions, key=lambda motion: (motion.time, motion.joint)))


def reached_moments(trace: Trace) -> tuple[float, ...]:
    """Return the moments [s] at which waypoints were reported as done, in order."""
    moments: list[float] = []
    for record in trace.progress:
        moments += [record.time] * (record.reached - len(moments))
    return tuple(moments)


def _short(line: LogLine) -> LogLine:
    text = printable(" ".join(line.text[: 2 * _LINE_LENGTH].split())[:_LINE_LENGTH])
    return replace(line, source=printable(line.source[:_LINE_LENGTH]), text=text)
