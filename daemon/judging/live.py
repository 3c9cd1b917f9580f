"""A run along time: its signals, doors and mission; and while it goes on, its judgement so far.

The code that judges finished runs also judges running ones: the last judgement of a run has the
verdicts of its result.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
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
from daemon.judging.signals import RunSignal, merge_spans, thin_signal
from daemon.model.live_judgement import (
    DoorMotion,
    LimitSide,
    LiveJudgement,
    LiveSignal,
    LogLine,
    SignalLimit,
)
from daemon.model.verdicts import Outcome, Verdict, deciding_verdict
from daemon.trace import JointTrack, Trace
from grammars import oracle as language
from grammars.oracle import ComparedLimit, kind_of
from grammars.text.expressions import render
from grammars.text.terminal_text import printable

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
    for name, signal in ({name: language.Signal(name) for name in _USUAL} | asked).items():
        values = sampler.sample(signal).values
        if name not in asked and not np.isfinite(values).any():
            continue
        kind = kind_of(signal) if name in asked else None
        unit = _USUAL.get(name) or ("bool" if kind is None else kind.unit)
        readers = [o for o in oracles if name in {render(read) for read in o.signals}]
        signals.append(
            RunSignal(
                name, unit, sampler.time_base.time, values, values,
                limits_of(name, (limit for o in readers for limit in o.limits)),
                merge_spans(span for o in readers for span in o.against),
                tuple(reader.oracle for reader in readers),
            )
        )  # fmt: skip
    return tuple(signals)


def limits_of(signal: str, compared: Iterable[ComparedLimit]) -> tuple[SignalLimit, ...]:
    """Return the limits of one signal among those of oracles, ascending, each once."""
    sides: dict[float, set[LimitSide]] = {}
    for one in compared:
        if one.signal == signal:
            sides.setdefault(one.value, set()).add(one.against)
    limits = []
    for value in sorted(sides):
        meant = sides[value] - {""}
        # Two oracles that want opposite things: neither side is free.
        limits.append(SignalLimit(value, meant.pop() if len(meant) == 1 else ""))
    return tuple(limits)


def _thinned_signals(sampler: SignalSampler) -> tuple[LiveSignal, ...]:
    signals = sample_run_signals(sampler)
    share = _COLUMNS_IN_ALL // max(len(signals), 1)
    columns = min(MOST_COLUMNS, max(_FEWEST_COLUMNS, share))
    start, end = sampler.time_base.start, sampler.time_base.end
    return tuple(thin_signal(signal, start, end, columns) for signal in signals)


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
