"""From trace and oracles to verdicts: live, after the run and years later, one function."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from daemon.oracles._finding import Finding
from daemon.oracles._operators import amount, statistic, temporal
from daemon.oracles._predicate import unit_of_margin
from daemon.oracles._reached import reached
from daemon.oracles._sampler import Sampler
from daemon.spec import OracleText
from daemon.verdict import Evidence, Outcome, Verdict, combine
from grammars.diagnostics import InputError, Where
from grammars.oracle import (
    Amount,
    Oracle,
    Reached,
    Statistic,
    Temporal,
    check_scene,
    kind_of,
    parse_oracle,
)

if TYPE_CHECKING:
    from daemon.trace import Trace


def judge(trace: Trace, oracles: Sequence[OracleText]) -> tuple[Verdict, ...]:
    """Judge ``trace`` by each oracle, in order.

    A trace that cannot be trusted (``problems``) and an oracle that cannot be read or speaks of
    what is not in the scene give ``error`` verdicts that say why; nothing is raised. A trace that
    is not ``complete`` is judged as a prefix: its verdicts hold for the whole run or are
    inconclusive.
    """
    problems = problems_of(trace)
    sampler = None if problems else Sampler(trace)
    return tuple(
        _error(oracle, f"invalid trace: {'; '.join(problems)}")
        if sampler is None
        else _judge_one(oracle, sampler)
        for oracle in oracles
    )


def overall(trace: Trace, verdicts: Sequence[Verdict]) -> Outcome:
    """Combine the verdicts of a run: invalid > fail > error > inconclusive > pass.

    A run in which the system under test crashed is an error unless it had failed before.
    """
    outcome = combine(verdicts, valid=not problems_of(trace))
    if trace.ended == "crashed" and outcome is not Outcome.FAIL:
        return Outcome.ERROR
    return outcome


def problems_of(trace: Trace) -> tuple[str, ...]:
    """Return why ``trace`` cannot be trusted: what its reader found, and impossible motion."""
    truth = trace.ground_truth
    found = list(trace.problems)
    channels = (truth.time, truth.x, truth.y, truth.yaw, truth.vx, truth.vy, truth.wz)
    if not all(np.isfinite(channel).all() for channel in channels):
        found.append("the ground truth is not finite")
    elif len(truth.time) > 1 and float(np.diff(truth.time).min()) < 0.0:
        found.append("the clock runs backwards")
    return tuple(found)


def _judge_one(written: OracleText, sampler: Sampler) -> Verdict:
    trace = sampler.trace
    try:
        oracle = parse_oracle(written.name, written.text, Where(f"oracle {written.name}"))
        found = check_scene(oracle, trace.scene, trace.spec.mission)
        if found:
            raise InputError(found)
    except InputError as error:
        return _error(written, "; ".join(d.message for d in error.diagnostics))
    finding = _find(oracle, sampler)
    return Verdict(
        written.name,
        written.text,
        finding.outcome,
        _bound(finding.lower),
        _bound(finding.upper),
        _unit(oracle),
        finding.evidence,
    )


def _find(oracle: Oracle, sampler: Sampler) -> Finding:
    match oracle.judgement:
        case Temporal() as judgement:
            return temporal(oracle, judgement, sampler)
        case Amount() as judgement:
            return amount(oracle, judgement, sampler)
        case Statistic() as judgement:
            return statistic(oracle, judgement, sampler)
        case Reached() as judgement:
            return reached(oracle, judgement, sampler)


def _unit(oracle: Oracle) -> str:
    match oracle.judgement:
        case Temporal(predicate=predicate):
            return unit_of_margin(predicate)
        case Amount(operator=operator):
            return "s" if operator in ("time", "longest") else "1"
        case Statistic(signal=signal):
            kind = kind_of(signal)
            return kind.unit if kind is not None else ""
        case Reached():
            return "m"


def _bound(value: float) -> float | None:
    return None if math.isinf(value) else value


def _error(oracle: OracleText, note: str) -> Verdict:
    evidence = Evidence(note=note)
    return Verdict(oracle.name, oracle.text, Outcome.ERROR, None, None, "", evidence)
