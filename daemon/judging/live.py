"""A run over time: its signals, doors and mission, and the judgement so far of a running one.

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
"""Most parts of the time in which a signal is sent."""
_COLUMNS_IN_ALL: Final = 1600
"""Parts of all signals together: more than eight signals are each sent in fewer parts."""
_FEWEST_COLUMNS: Final = 40
MOST_LINES: Final = 200
"""Most lines of the log."""
_LINE_LENGTH: Final = 200
_MOST_MOTIONS: Final = 1000
"""Most motions of doors, counted from the last: hinges may swing for hours."""
_USUAL: Final = {"loc.error": "m", "clearance": "m", DOOR_CLEARANCE: "m", "speed": "m/s"}
"""Signals of every run, and their units."""
_AJAR: Final = 0.05
"""Distance from the drawn, shut position at which a door counts as open [rad or m]."""


def judge_running(trace: Trace) -> LiveJudgement:
    """Return the judgement of a run by ``trace``, its recording until now.

    ``run`` stays empty: a trace does not know its name in a queue. Raises nothing.
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
    """Return the verdict that a list shows for a running run, if any has a margin.

    The rule is that of finished runs, :func:`daemon.model.verdicts.deciding_verdict`.
    """
    return deciding_verdict(
        verdict
        for verdict in so_far
        if verdict.outcome in (Outcome.PASS, Outcome.FAIL) and verdict.margin is not None
    )


def sample_run_signals(sampler: SignalSampler) -> tuple[RunSignal, ...]:
    """Sample the usual signals and every signal of the run's oracles, each once.

    Leave out a usual signal without values that no oracle reads.
    """
    oracles = [oracle_timeline(one, sampler) for one in sampler.trace.spec.oracles]
    judged = {render(signal): signal for oracle in oracles for signal in oracle.signals}
    signals = []
    for name, signal in ({name: language.Signal(name) for name in _USUAL} | judged).items():
        values = sampler.sample(signal).values
        if name not in judged and not np.isfinite(values).any():
            continue
        kind = kind_of(signal) if name in judged else None
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
        against = sides[value] - {""}
        # Oracles with opposite limits leave neither side free.
        limits.append(SignalLimit(value, against.pop() if len(against) == 1 else ""))
    return tuple(limits)


def _thinned_signals(sampler: SignalSampler) -> tuple[LiveSignal, ...]:
    signals = sample_run_signals(sampler)
    share = _COLUMNS_IN_ALL // max(len(signals), 1)
    columns = min(MOST_COLUMNS, max(_FEWEST_COLUMNS, share))
    start, end = sampler.time_base.start, sampler.time_base.end
    return tuple(thin_signal(signal, start, end, columns) for signal in signals)


def door_motions(joints: JointTrack) -> tuple[DoorMotion, ...]:
    """Return the moments at which a joint left or came back to its drawn position, in order."""
    motions = []
    for column, name in enumerate(joints.names):
        open_ = np.abs(joints.position[:, column]) > _AJAR
        turns = (np.flatnonzero(np.diff(open_)) + 1).tolist()
        motions += [DoorMotion(float(joints.time[i]), name, bool(open_[i])) for i in turns]
    return tuple(sorted(motions, key=lambda motion: (motion.time, motion.joint)))


def reached_moments(trace: Trace) -> tuple[float, ...]:
    """Return the moments [s] at which waypoints were reported done, in order."""
    moments: list[float] = []
    for record in trace.progress:
        moments += [record.time] * (record.reached - len(moments))
    return tuple(moments)


def _short(line: LogLine) -> LogLine:
    text = printable(" ".join(line.text[: 2 * _LINE_LENGTH].split())[:_LINE_LENGTH])
    return replace(line, source=printable(line.source[:_LINE_LENGTH]), text=text)
