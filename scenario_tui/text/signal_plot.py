"""Signals of a recorded run, sampled as they are asked for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from daemon.judging.oracles import SignalSampler, judge, trace_problems
from daemon.model.verdicts import Verdict
from daemon.trace import Trace, TraceError, read_trace
from grammars.model.geometry import Floats
from grammars.oracle import (
    Oracle,
    Signal,
    Statistic,
    Temporal,
    check_references,
    kind_of,
    parse_oracle,
)
from grammars.text.diagnostics import InputError, Where


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A signal over time: ``time`` and ``values`` (n,), NaN where it is not known."""

    name: str
    unit: str
    time: Floats
    values: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Curves:
    """The signals asked for of one run, and what its oracles say."""

    trace: Trace
    curves: tuple[Curve, ...]
    verdicts: tuple[Verdict, ...]


def read_curves(path: Path, signals: list[str]) -> Curves:
    """Sample signals, written as in oracles, of the run in a trace.

    Raises :class:`daemon.trace.TraceError` for a trace that cannot be used or trusted and
    :class:`InputError` for what is no signal, or none of this run's scene.
    """
    trace = read_trace(path)
    parsed = [_parsed(text, trace) for text in signals]
    problems = trace_problems(trace)
    if problems:
        raise TraceError(path, f"not to be trusted: {'; '.join(problems)}", "run it again")
    sampler = SignalSampler(trace)
    curves = tuple(
        Curve(text, unit, sampler.time_base.time, sampler.sample(signal).values)
        for text, (signal, unit) in zip(signals, parsed, strict=True)
    )
    return Curves(trace, curves, judge(trace, trace.spec.oracles, sampler=sampler))


def _parsed(text: str, trace: Trace) -> tuple[Signal, str]:
    oracle = _oracle_about(text)
    found = check_references(oracle, trace.scene, trace.spec.mission)
    if found:
        raise InputError(found)
    match oracle.judgement:
        case Statistic(signal=Signal() as signal) | Temporal(predicate=Signal() as signal):
            kind = kind_of(signal)
            return signal, "bool" if kind is None else kind.unit
    raise ValueError(f'"{text}" is no signal: name one, such as clearance or loc.error')


def _oracle_about(text: str) -> Oracle:
    """Return an oracle about the signal, which is a quantity, else true or false."""
    # Signals have no grammar of their own. What is wrong is said of the first try: most signals
    # are quantities.
    where = Where(f"signal {text}")
    try:
        return parse_oracle(text, f"max({text})", where)
    except InputError:
        try:
            return parse_oracle(text, f"never({text})", where)
        except InputError:
            pass
        raise
