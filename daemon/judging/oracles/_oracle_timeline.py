"""The course of a run by one oracle: its signals, its limits, the times it did not hold.

For drawing only. A verdict sums up a run; its course says at which moments the run spoke against
it, also where a limit on the sum (80 % of the time, say) let that pass.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from daemon.judging.oracles._judge import bind_oracle
from daemon.judging.oracles._operators import true_stretches
from daemon.judging.oracles._predicate import (
    evaluate_predicate,
    evaluate_quantity,
    margin_of,
    scope_of,
    window_of,
)
from daemon.judging.oracles._sampler import PluginError, SignalSampler
from daemon.model.spec import OracleText
from grammars.oracle import (
    Amount,
    ComparedLimit,
    Oracle,
    Signal,
    Statistic,
    Temporal,
    Until,
    compared_limits,
)
from grammars.text.diagnostics import InputError
from grammars.text.expressions import render

Stretch = tuple[float, float]


@dataclass(frozen=True, slots=True)
class OracleTimeline:
    """One oracle over a run.

    ``signals`` as written, each once; ``limits`` are the constants they are compared with;
    ``against`` are the stretches [s] in which the run spoke against the oracle, ascending and
    disjoint.
    """

    oracle: str
    signals: tuple[Signal, ...]
    limits: tuple[ComparedLimit, ...]
    against: tuple[Stretch, ...]


def oracle_timeline(written: OracleText, sampler: SignalSampler) -> OracleTimeline:
    """Return the course of an oracle; an empty one when it cannot be read or evaluated."""
    try:
        oracle = bind_oracle(written, sampler.trace)
        against = _violations(oracle, sampler) if len(sampler.time_base.time) else ()
    except (InputError, PluginError):
        return OracleTimeline(written.name, (), (), ())
    named = {render(signal): signal for signal in oracle.signals()}
    return OracleTimeline(written.name, tuple(named.values()), compared_limits(oracle), against)


def _violations(oracle: Oracle, sampler: SignalSampler) -> tuple[Stretch, ...]:
    match oracle.judgement:
        case Temporal(operator=operator, predicate=predicate) if operator != "eventually":
            values = evaluate_predicate(predicate, sampler, negated=operator == "never").margin
            wrong = values < 0.0
        case Until(operator=operator, predicate=predicate, release=release):
            values = evaluate_predicate(predicate, sampler, negated=operator == "never").margin
            # Once released, always released: what comes afterwards is no violation.
            released = np.logical_or.accumulate(evaluate_predicate(release, sampler).margin >= 0.0)
            wrong = (values < 0.0) & ~released
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
    # As in judging: what was seen holds until the next sample, the last one until the end.
    ends = np.append(sampler.time_base.time[1:], sampler.time_base.end)
    return tuple(
        (float(sampler.time_base.time[part.start]), float(ends[part.stop - 1]))
        for part in true_stretches(allowed & wrong)
    )
