"""From trace and oracles to verdicts: live, after the run and years later, one function."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from daemon.oracles._custom import PluginError, custom_unit, judge_custom
from daemon.oracles._finding import Finding
from daemon.oracles._operators import amount, statistic, temporal
from daemon.oracles._predicate import unit_of_margin
from daemon.oracles._prefix import prefix
from daemon.oracles._reached import reached
from daemon.oracles._sampler import Sampler
from daemon.oracles._until import until
from daemon.oracles._validity import problems_of
from daemon.spec import OracleText
from daemon.verdict import Evidence, Outcome, Verdict, combine
from grammars.diagnostics import InputError, Where
from grammars.mission import Mission
from grammars.oracle import (
    Amount,
    Custom,
    Oracle,
    Reached,
    Statistic,
    Temporal,
    Until,
    check_scene,
    kind_of,
    parse_oracle,
)
from grammars.scene import Scene

if TYPE_CHECKING:
    from daemon.trace import Trace


def judge(
    trace: Trace, oracles: Sequence[OracleText], *, sampler: Sampler | None = None
) -> tuple[Verdict, ...]:
    """Judge ``trace`` by each oracle, in order.

    A trace that cannot be trusted (``problems``) and an oracle that cannot be read or speaks of
    what is not in the scene give ``error`` verdicts that say why; nothing is raised. A trace that
    is not ``complete`` is judged as a prefix: its verdicts hold for the whole run or are
    inconclusive. With a ``sampler`` of that trace, signals it has sampled already cost nothing.
    """
    problems = problems_of(trace)
    sampler = None if problems else sampler or Sampler(trace)
    return tuple(
        _error(oracle, f"invalid trace: {'; '.join(problems)}")
        if sampler is None
        else _judge_one(oracle, sampler)
        for oracle in oracles
    )


def judge_prefix(trace: Trace, oracles: Sequence[OracleText], at: float) -> tuple[Verdict, ...]:
    """Judge ``trace`` by what is recorded up to ``at`` [s], as if the run were still going on.

    Three-valued: pass and fail are final, whatever the rest of the run brings, unless that makes
    the trace invalid; everything else is inconclusive. The file of a run that is still being
    written can be judged by :func:`judge` itself.
    """
    return judge(prefix(trace, at), oracles)


def overall(trace: Trace, verdicts: Sequence[Verdict]) -> Outcome:
    """Combine the verdicts of a run: invalid > fail > error > inconclusive > pass.

    A run in which the system under test crashed is invalid: an error, never a failure of the
    robot. What its oracles had seen before is kept in their verdicts.
    """
    valid = trace.ended != "crashed" and not problems_of(trace)
    return combine(verdicts, valid=valid)


def _judge_one(written: OracleText, sampler: Sampler) -> Verdict:
    trace = sampler.trace
    try:
        place = Place(trace.spec.scene, trace.spec.mission, trace.scene)
        oracle = bound(written.name, written.text, place)
        finding = _find(oracle, sampler)
    except InputError as error:
        return _error(written, "; ".join(d.message for d in error.diagnostics))
    except PluginError as error:
        return _error(written, str(error))
    return Verdict(
        written.name,
        written.text,
        finding.outcome,
        _finite(finding.lower),
        _finite(finding.upper),
        _unit(oracle),
        finding.evidence,
    )


@dataclass(frozen=True, slots=True)
class Place:
    """Where a run was: equal when the ``digest`` of the scene and the mission are."""

    digest: str
    mission: Mission
    scene: Scene = field(compare=False)


@functools.lru_cache(maxsize=1024)
def bound(name: str, text: str, place: Place) -> Oracle:
    """Parse an oracle and bind it to a scene, once for the thousands of runs it judges there.

    Raises :class:`InputError`.
    """
    oracle = _parsed(name, text)
    found = check_scene(oracle, place.scene, place.mission)
    if found:
        raise InputError(found)
    return oracle


@functools.lru_cache(maxsize=1024)
def _parsed(name: str, text: str) -> Oracle:
    return parse_oracle(name, text, Where(f"oracle {name}"))


def _find(oracle: Oracle, sampler: Sampler) -> Finding:
    match oracle.judgement:
        case Temporal() as judgement:
            return temporal(oracle, judgement, sampler)
        case Until() as judgement:
            return until(oracle, judgement, sampler)
        case Amount() as judgement:
            return amount(oracle, judgement, sampler)
        case Statistic() as judgement:
            return statistic(oracle, judgement, sampler)
        case Reached() as judgement:
            return reached(oracle, judgement, sampler)
        case Custom() as judgement:
            return judge_custom(judgement, sampler)


def _unit(oracle: Oracle) -> str:
    match oracle.judgement:
        case Temporal(predicate=predicate) | Until(predicate=predicate):
            return unit_of_margin(predicate)
        case Amount(operator=operator):
            return "s" if operator in ("time", "longest") else "1"
        case Statistic(signal=signal):
            kind = kind_of(signal)
            return kind.unit if kind is not None else ""
        case Reached():
            return "m"
        case Custom() as judgement:
            return custom_unit(judgement)


def _finite(value: float) -> float | None:
    return None if math.isinf(value) else value


def _error(oracle: OracleText, note: str) -> Verdict:
    evidence = Evidence(note=note)
    return Verdict(oracle.name, oracle.text, Outcome.ERROR, None, None, "", evidence)
