"""From trace and oracles to verdicts: live, after the run and years later, one function.

A trace that says nothing about the robot (``_validity.py``) is an error of the simulation, the
recording or the set-up, never a failure of the robot, whatever its oracles would say.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import replace

from daemon import trace
from daemon.judging.oracles._obstacles import DigestedScene
from daemon.judging.oracles._operators import (
    judge_amount,
    judge_reached,
    judge_statistic,
    judge_temporal,
    judge_until,
)
from daemon.judging.oracles._sampler import PluginError, SignalSampler, judge_by_plugin
from daemon.judging.oracles._validity import standstill_note, trace_problems
from daemon.model.spec import OracleText
from daemon.model.verdicts import Evidence, MarginInterval, Outcome, Verdict, combine, join_notes
from daemon.trace import Trace
from grammars.model.mission import Mission
from grammars.oracle import (
    Amount,
    CustomCall,
    Oracle,
    Reached,
    Statistic,
    Temporal,
    Until,
    check_references,
    custom_signal_names,
    parse_oracle,
    unit_of,
)
from grammars.text.diagnostics import InputError, Where


def judge(
    trace: Trace, oracles: Sequence[OracleText], *, sampler: SignalSampler | None = None
) -> tuple[Verdict, ...]:
    """Judge ``trace`` by each oracle, in order.

    A trace that cannot be trusted (``problems``) and an oracle that cannot be read or speaks of
    what is not in the scene give ``error`` verdicts that say why; nothing is raised. A trace that
    is not ``complete`` is judged as a prefix: its verdicts hold for the whole run or are
    inconclusive. With a ``sampler`` of that trace, signals it has sampled already cost nothing.
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
    """Judge a run that goes on by each oracle, in order, as if it ended now.

    A failure that what is still to come may mend is ``inconclusive`` instead. With a ``sampler`` of
    that trace, signals it has sampled already cost nothing. Nothing is raised.
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
    robot. What its oracles had seen before is kept in their verdicts.
    """
    valid = trace.ended != "crashed" and not trace_problems(trace)
    return combine(verdicts, valid=valid)


def _judge_one(written: OracleText, sampler: SignalSampler) -> Verdict:
    try:
        oracle = bind_oracle(written, sampler.trace)
        interval = _evaluate(oracle, sampler)
    except InputError as error:
        return _error_verdict(written, "; ".join(d.message for d in error.findings))
    except PluginError as error:
        return _error_verdict(written, str(error))
    evidence = interval.evidence
    if isinstance(oracle.judgement, Reached) and interval.outcome is Outcome.FAIL:
        why = standstill_note(sampler.trace)
        evidence = replace(evidence, note=join_notes(evidence.note, why))
    return Verdict(
        written.name,
        written.text,
        interval.outcome,
        _bound_or_none(interval.lower),
        _bound_or_none(interval.upper),
        unit_of(oracle),
        evidence,
    )


def written_oracle(written: OracleText) -> Oracle | None:
    """Return an oracle that is bound to no scene; ``None`` when it cannot be read."""
    try:
        return _parse(written.name, written.text)
    except InputError:
        return None


def bind_oracle(written: OracleText, trace: Trace) -> Oracle:
    """Parse an oracle and bind it to the scene and the mission of a run.

    Raises :class:`InputError`.
    """
    building = DigestedScene(trace.spec.scene, trace.scene)
    return _bind(written.name, written.text, building, trace.spec.mission)


# Once for the thousands of runs that an oracle judges in one building.
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


def warm_up() -> None:
    """Load what judging a trace takes, so that forked children need not."""
    trace.warm_up()
    custom_signal_names()  # looks through all that is installed
    # A limit with a unit loads the registry of units.
    parse_oracle("warm-up", "always(clearance >= 0.1 m)", Where("warm-up"))
