"""Judging a trace by oracles: one function live, after the run and years later.

A trace that says nothing about the robot (``_validity.py``) is an error of the simulation, the
recording or the set-up. Whatever its oracles would say, it is never a failure of the robot.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from daemon import trace
from daemon.judging.oracles._obstacles import DigestedScene
from daemon.judging.oracles._operators import (
    judge_amount,
    judge_reached,
    judge_response,
    judge_statistic,
    judge_temporal,
    judge_until,
    occasions_of,
    true_stretches,
)
from daemon.judging.oracles._predicate import (
    evaluate_predicate,
    evaluate_quantity,
    margin_of,
    scope_of,
    window_of,
)
from daemon.judging.oracles._sampler import PluginError, SignalSampler, judge_by_plugin
from daemon.judging.oracles._validity import standstill_note, trace_problems
from daemon.judging.signals import TimeSpan
from daemon.model.spec import OracleText
from daemon.model.verdicts import Evidence, MarginInterval, Outcome, Verdict, combine, join_notes
from daemon.trace import Trace
from grammars.model.mission import Mission
from grammars.oracle import (
    Amount,
    ComparedLimit,
    CustomCall,
    Oracle,
    Reached,
    Response,
    Signal,
    Statistic,
    Temporal,
    Until,
    check_references,
    compared_limits,
    custom_signal_names,
    parse_oracle,
    unit_of,
)
from grammars.text.diagnostics import InputError, Where
from grammars.text.expressions import render


def judge(
    trace: Trace, oracles: Sequence[OracleText], *, sampler: SignalSampler | None = None
) -> tuple[Verdict, ...]:
    """Judge ``trace`` by each oracle, in order.

    A trace with ``problems`` gives ``error`` verdicts that say why. So does an oracle that cannot
    be read or names something missing in the scene. Nothing is raised. A trace that is not
    ``complete`` is judged as a prefix: its verdicts hold for the whole run or are inconclusive. A
    ``sampler`` of that trace spares sampling its signals again.
    """
    problems = trace_problems(trace)
    sampler = None if problems else sampler or SignalSampler(trace)
    return tuple(
        _error_verdict(oracle, f"invalid trace: {'; '.join(problems)}")
        if sampler is None
        else _judge_one(oracle, sampler)
        for oracle in oracles
    )


def judge_so_far(
    trace: Trace, oracles: Sequence[OracleText], *, sampler: SignalSampler | None = None
) -> tuple[Verdict, ...]:
    """Judge a running run by each oracle, in order, as if it ended now.

    A failure that the rest of the run may mend is ``inconclusive`` instead. A ``sampler`` of that
    trace spares sampling its signals again. Nothing is raised.
    """
    if trace.complete or trace_problems(trace):
        return judge(trace, oracles, sampler=sampler)
    sampler = sampler or SignalSampler(trace)
    ended = sampler.with_trace(replace(trace, complete=True, ended="limit"))
    return tuple(_judge_so_far(oracle, sampler, ended) for oracle in oracles)


def _judge_so_far(oracle: OracleText, sampler: SignalSampler, ended: SignalSampler) -> Verdict:
    verdict = _judge_one(oracle, ended)
    fails = verdict.outcome is Outcome.FAIL
    if fails and _judge_one(oracle, sampler).outcome is not Outcome.FAIL:
        return replace(verdict, outcome=Outcome.INCONCLUSIVE, upper=None)
    return verdict


def overall_outcome(trace: Trace, verdicts: Sequence[Verdict]) -> Outcome:
    """Combine the verdicts of a run: invalid > fail > error > inconclusive > pass.

    A run in which the system under test crashed is invalid: an error, never a failure of the
    robot. The verdicts of its oracles are kept.
    """
    valid = trace.ended != "crashed" and not trace_problems(trace)
    return combine(verdicts, valid=valid)


def _judge_one(text: OracleText, sampler: SignalSampler) -> Verdict:
    try:
        oracle = bind_oracle(text, sampler.trace)
        interval = _evaluate(oracle, sampler)
    except InputError as error:
        return _error_verdict(text, "; ".join(d.message for d in error.findings))
    except PluginError as error:
        return _error_verdict(text, str(error))
    evidence = interval.evidence
    if isinstance(oracle.judgement, Reached) and interval.outcome is Outcome.FAIL:
        why = standstill_note(sampler.trace)
        evidence = replace(evidence, note=join_notes(evidence.note, why))
    return Verdict(
        text.name,
        text.text,
        interval.outcome,
        _bound_or_none(interval.lower),
        _bound_or_none(interval.upper),
        unit_of(oracle),
        evidence,
    )


def written_oracle(text: OracleText) -> Oracle | None:
    """Return an oracle bound to no scene; ``None`` if it cannot be read."""
    try:
        return _parse(text.name, text.text)
    except InputError:
        return None


def bind_oracle(text: OracleText, trace: Trace) -> Oracle:
    """Parse an oracle and bind it to the scene and the mission of a run.

    Raises :class:`InputError`.
    """
    building = DigestedScene(trace.spec.scene, trace.scene)
    return _bind(text.name, text.text, building, trace.spec.mission)


# Bound once for the thousands of runs that an oracle judges in one building.
@functools.lru_cache(maxsize=1024)
def _bind(name: str, text: str, building: DigestedScene, mission: Mission) -> Oracle:
    oracle = _parse(name, text)
    problems = check_references(oracle, building.scene, mission)
    if problems:
        raise InputError(problems)
    return oracle


@functools.lru_cache(maxsize=1024)
def _parse(name: str, text: str) -> Oracle:
    return parse_oracle(name, text, Where(f"oracle {name}"))


def _evaluate(oracle: Oracle, sampler: SignalSampler) -> MarginInterval:
    match oracle.judgement:
        case Temporal() as judgement:
            return judge_temporal(oracle, judgement, sampler)
        case Until() as judgement:
            return judge_until(oracle, judgement, sampler)
        case Response() as judgement:
            return judge_response(oracle, judgement, sampler)
        case Amount() as judgement:
            return judge_amount(oracle, judgement, sampler)
        case Statistic() as judgement:
            return judge_statistic(oracle, judgement, sampler)
        case Reached() as judgement:
            return judge_reached(oracle, judgement, sampler)
        case CustomCall() as judgement:
            return judge_by_plugin(judgement, sampler)


def _bound_or_none(value: float) -> float | None:
    return None if math.isinf(value) else value


def _error_verdict(oracle: OracleText, note: str) -> Verdict:
    evidence = Evidence(note=note)
    return Verdict(oracle.name, oracle.text, Outcome.ERROR, None, None, "", evidence)


@dataclass(frozen=True, slots=True)
class OracleTimeline:
    """The course of a run by one oracle, for drawing only.

    ``signals`` are its signals as written, each once; ``limits`` are the constants that it compares
    them with. ``against`` are the stretches [s] that speak against the oracle, ascending and
    disjoint. They include stretches that a limit on the sum (80 % of the time, say) tolerates.
    """

    oracle: str
    signals: tuple[Signal, ...]
    limits: tuple[ComparedLimit, ...]
    against: tuple[TimeSpan, ...]


def oracle_timeline(text: OracleText, sampler: SignalSampler) -> OracleTimeline:
    """Return the course of a run by an oracle; an empty one if it cannot be evaluated."""
    try:
        oracle = bind_oracle(text, sampler.trace)
        against = _violations(oracle, sampler) if len(sampler.time_base.time) else ()
    except (InputError, PluginError):
        return OracleTimeline(text.name, (), (), ())
    signals = {render(signal): signal for signal in oracle.signals()}
    return OracleTimeline(text.name, tuple(signals.values()), compared_limits(oracle), against)


def _violations(oracle: Oracle, sampler: SignalSampler) -> tuple[TimeSpan, ...]:
    match oracle.judgement:
        case Temporal(operator=operator, predicate=predicate) if operator != "eventually":
            values = evaluate_predicate(predicate, sampler, negated=operator == "never").margin
            wrong = values < 0.0
        case Until(operator=operator, predicate=predicate, release=release):
            values = evaluate_predicate(predicate, sampler, negated=operator == "never").margin
            # A release holds for good, so nothing after it is a violation.
            released = np.logical_or.accumulate(evaluate_predicate(release, sampler).margin >= 0.0)
            wrong = (values < 0.0) & ~released
        case Response(predicate=predicate) as judgement:
            values = evaluate_predicate(predicate, sampler).margin
            scope = scope_of(oracle, sampler, window_of(oracle, sampler), values)
            wrong = np.zeros(len(values), dtype=np.bool_)
            for span, over in zip(*occasions_of(judgement, sampler, scope.allowed), strict=True):
                wrong[span] |= over and not (values[span] >= 0.0).any()
        case Amount(predicate=predicate, limit=limit) if limit is not None:
            values = evaluate_predicate(predicate, sampler).margin
            wrong = values < 0.0 if limit.operator in (">=", ">") else values >= 0.0
        case Statistic(operator="max" | "min", signal=signal, limit=limit) if limit is not None:
            values = evaluate_quantity(signal, sampler).values
            limits = np.full(len(values), limit.number.value)
            wrong = margin_of(limit.operator, values, limits) < 0.0
        case _:
            return ()
    allowed = scope_of(oracle, sampler, window_of(oracle, sampler), values).allowed
    # As in judging, a value holds until the next sample, the last one until the end.
    ends = np.append(sampler.time_base.time[1:], sampler.time_base.end)
    return tuple(
        (float(sampler.time_base.time[part.start]), float(ends[part.stop - 1]))
        for part in true_stretches(allowed & wrong)
    )


def warm_up() -> None:
    """Load everything that judging a trace needs, so that forked children need not."""
    trace.warm_up()
    custom_signal_names()  # searches all installed packages
    # A limit with a unit loads the registry of units.
    parse_oracle("warm-up", "always(clearance >= 0.1 m)", Where("warm-up"))
