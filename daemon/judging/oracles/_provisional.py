"""Verdicts on a run that goes on: what they would be if it ended now, and which of them stand.

Judged twice: as a run that is over, and as the beginning of one. What an oracle says of the
beginning holds for every way in which the run can go on, so that is what is final. Never final is

- what plug-ins say, as what they say of a moment may depend on what comes after it;
- what is said of a robot that has not moved yet: if it never does, its trace says nothing;
- what depends on an estimate later than the last one: those of external systems come late, and
  hold from their stamps on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from daemon.judging.oracles._judge import bind_oracle, judge, judge_one
from daemon.judging.oracles._sampler import SignalSampler
from daemon.judging.oracles._validity import never_moved, trace_problems
from daemon.model.live_judgement import ProvisionalVerdict
from daemon.model.spec import OracleText
from daemon.model.verdicts import Outcome, Verdict, deciding_verdict
from daemon.trace import Trace
from grammars.oracle import (
    Amount,
    CustomCall,
    Oracle,
    Reached,
    Signal,
    Statistic,
    Temporal,
    Until,
    custom_signal_names,
    signals_of,
)
from grammars.text.diagnostics import InputError

_DECIDED: Final = (Outcome.PASS, Outcome.FAIL)
_ESTIMATED: Final = ("loc.", "estimate.")


def judge_so_far(
    trace: Trace, oracles: Sequence[OracleText], *, sampler: SignalSampler | None = None
) -> tuple[ProvisionalVerdict, ...]:
    """Judge a run that goes on by each oracle, in order; of one that is over all are final.

    ``sampler`` is one of that trace: what it has sampled costs nothing. Nothing is raised.
    """
    if trace.complete or trace_problems(trace):
        final = trace.complete
        return tuple(ProvisionalVerdict(v, final) for v in judge(trace, oracles, sampler=sampler))
    sampler = sampler or SignalSampler(trace)
    ended = sampler.with_trace(replace(trace, complete=True, ended="limit"))
    # Contacts alone make a standstill a matter of the robot, see trace_problems.
    moved = bool(trace.contacts) or not never_moved(ended.trace)
    return tuple(_judge_provisionally(one, sampler, ended, moved) for one in oracles)


def _judge_provisionally(
    written: OracleText, sampler: SignalSampler, ended: SignalSampler, moved: bool
) -> ProvisionalVerdict:
    verdict = judge_one(written, ended)
    try:
        oracle = bind_oracle(written, sampler.trace)
    except InputError:
        return ProvisionalVerdict(verdict)
    final = moved and _is_final(written, oracle, verdict, sampler)
    return ProvisionalVerdict(verdict, final, not final and _is_open(oracle, verdict))


def _is_final(
    written: OracleText, oracle: Oracle, verdict: Verdict, sampler: SignalSampler
) -> bool:
    signals = tuple(signals_of(oracle))
    if verdict.outcome not in _DECIDED or _plugs_in(oracle, signals):
        return False
    beginning = sampler
    if any(signal.name.startswith(_ESTIMATED) for signal in signals):
        settled = _last_estimate(sampler.trace)
        if settled is None:
            return False
        if settled < sampler.time_base.end:
            beginning = SignalSampler(replace(sampler.trace, valid_until=settled))
    return judge_one(written, beginning).outcome is verdict.outcome


def _plugs_in(oracle: Oracle, signals: Sequence[Signal]) -> bool:
    if isinstance(oracle.judgement, CustomCall):
        return True
    own = custom_signal_names()
    return any(signal.name in own for signal in signals)


def _last_estimate(trace: Trace) -> float | None:
    """Return until when nothing of an estimate can change, if those come in their order [s]."""
    tracks = (trace.estimate.time, trace.cloud.time)
    return min((float(stamps[-1]) for stamps in tracks if len(stamps)), default=None)


def _is_open(oracle: Oracle, verdict: Verdict) -> bool:
    """Whether an oracle that is not decided waits for something, so that it has not failed yet."""
    if verdict.outcome is Outcome.INCONCLUSIVE:
        return True
    if verdict.outcome is not Outcome.FAIL:
        return False
    match oracle.judgement:
        case Temporal(operator=operator):
            return operator == "eventually"
        case Until() | Reached() | CustomCall():
            return True
        case Amount(operator="time" | "longest" | "count", limit=limit) if limit is not None:
            return limit.operator in (">=", ">", "==")
        case Statistic(operator="max", limit=limit) if limit is not None:
            return limit.operator in (">=", ">", "==")
        case Statistic(operator="min", limit=limit) if limit is not None:
            return limit.operator in ("<=", "<", "==")
        case Statistic(operator="final"):
            return True
    # Shares and means say something at any moment.
    return False


def least_margin(found: Sequence[ProvisionalVerdict]) -> Verdict | None:
    """Return the verdict a list shows of a run that goes on, of the oracles that wait for nothing.

    By the rule of finished runs, :func:`daemon.model.verdicts.deciding_verdict`.
    """
    decided = (one.verdict for one in found if not one.open and one.verdict.outcome in _DECIDED)
    return deciding_verdict(verdict for verdict in decided if verdict.margin is not None)
