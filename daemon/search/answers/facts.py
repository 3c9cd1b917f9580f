"""The facts of a search: its answer, kinds of failures, influence of parameters."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final, TypeAlias

import numpy as np

from daemon.judging.statistics import proportion_interval
from daemon.model.search import PointValue, SearchTask
from daemon.model.search_answer import (
    Confirmation,
    DistinctFailure,
    Influence,
    SearchAnswer,
    UnsoughtFailure,
)
from daemon.model.trials import Trial, first_failure, smallest_margin
from daemon.model.verdicts import Outcome
from daemon.search.answers.sentences import answer_sentences

FailureKey: TypeAlias = tuple[str, str, str]
"""Oracle, object, and the waypoint that the robot was driving to."""
_FEWEST: Final = 5
"""Least number of runs for a meaningful correlation."""


def make_answer(
    task: SearchTask, explored: Sequence[Trial], *, holding: Sequence[bool] = (), **others: Any
) -> SearchAnswer:
    """Return the answer of a search from its explored points, with its sentences.

    ``holding`` says for each repeated failure whether it fails with most noises; ``others`` are
    further fields of the answer. The caller adds the text of the found scenario at the end.
    """
    outcomes = Counter(trial.outcome for trial in explored)
    judged = [
        one for one in explored if one.is_drawn and one.outcome in (Outcome.PASS, Outcome.FAIL)
    ]
    counts: dict[str, Any] = {"ended": "", "executed": 0, "reused": 0} | others
    answer = SearchAnswer(
        **counts,
        explored=len(explored),
        failed=outcomes[Outcome.FAIL],
        errors=outcomes[Outcome.ERROR],
        inconclusive=outcomes[Outcome.INCONCLUSIVE],
        space_filling=len(judged),
        space_filling_failed=sum(trial.fails for trial in judged),
        first=first_failure(explored),
        best=smallest_margin(explored),
        findings=distinct_failures(explored),
        influence=parameter_influence(task, explored),
        refused=outcomes[None],
        repeated=len(holding),
        holding=sum(holding),
        unsought=unsought_failures(explored),
    )
    return replace(answer, sentences=answer_sentences(task, answer))


def failure_key(trial: Trial) -> FailureKey:
    """Return the key of a failure; failures with the same key count as one."""
    if trial.verdict is None:
        return "", "", ""
    oracle, waypoint = trial.verdict.oracle, ""
    if trial.value is not None and trial.value.oracle == oracle:
        waypoint = trial.value.waypoint
    return oracle, trial.about, waypoint


def distinct_failures(trials: Sequence[Trial]) -> tuple[DistinctFailure, ...]:
    """Return the kinds of failures, the most frequent first, each with its worst example."""
    groups: dict[FailureKey, list[Trial]] = {}
    for trial in trials:
        if trial.fails:
            groups.setdefault(failure_key(trial), []).append(trial)
    findings = [
        DistinctFailure(*key, len(members), smallest_margin(members) or members[0])
        for key, members in groups.items()
    ]
    return tuple(sorted(findings, key=lambda one: (-one.count, one.example.number)))


def unsought_failures(trials: Sequence[Trial]) -> tuple[UnsoughtFailure, ...]:
    """Return the failing oracles that the search does not minimise, in order of appearance."""
    failures: dict[str, UnsoughtFailure] = {}
    for trial in trials:
        for oracle in trial.unsought:
            before = failures.get(oracle, UnsoughtFailure(oracle, 0, False))
            as_written = before.as_written or trial.is_written
            failures[oracle] = UnsoughtFailure(oracle, before.runs + 1, as_written)
    return tuple(failures.values())


def confirmation(repeats: Sequence[Trial]) -> Confirmation | None:
    """Return how many repeats with a verdict fail; ``None`` without any verdict."""
    judged = [one for one in repeats if one.outcome in (Outcome.PASS, Outcome.FAIL)]
    if not judged:
        return None
    failed = sum(trial.fails for trial in judged)
    return Confirmation(failed, len(judged), *proportion_interval(failed, len(judged)))


def parameter_influence(task: SearchTask, trials: Sequence[Trial]) -> tuple[Influence, ...]:
    """Return the influence of each parameter over the drawn points; empty for too few."""
    pairs = [
        (one.point, one.value.value) for one in trials if one.is_drawn and one.value is not None
    ]
    if len(pairs) < _FEWEST:
        return ()
    margins = np.array([value for _, value in pairs])
    influence = []
    for index, parameter in enumerate(task.parameters):
        values = [point[index] for point, _ in pairs]
        numbers = [value for value in values if not isinstance(value, str)]
        if parameter.choices or len(numbers) < len(values):
            correlation = correlation_ratio(values, margins)
        else:
            correlation = rank_correlation(np.array(numbers), margins)
        influence.append(Influence(parameter.name, correlation, len(pairs)))
    return tuple(influence)


def rank_correlation(values: np.ndarray[Any, Any], margins: np.ndarray[Any, Any]) -> float:
    """Return Spearman's rank correlation of (n,) and (n,), -1 to 1; 0 if one does not vary.

    Equal values share the mean of their ranks: plateaus of the margin are common.
    """
    # This loads slowly, and only the end of a search needs it.
    from scipy.stats import spearmanr

    if min(np.ptp(values), np.ptp(margins)) <= 0.0:
        return 0.0
    return float(spearmanr(values, margins).statistic)


def correlation_ratio(values: Sequence[PointValue], margins: np.ndarray[Any, Any]) -> float:
    """Return the correlation ratio of margins (n,) by choice, 0 to 1.

    The square root of the variance between choices over the whole variance (Pearson 1905).
    """
    total = float(((margins - margins.mean()) ** 2).sum())
    if total <= 0.0:
        return 0.0
    between = 0.0
    for choice in dict.fromkeys(values):
        members = margins[[value == choice for value in values]]
        between += len(members) * float(members.mean() - margins.mean()) ** 2
    return math.sqrt(min(between / total, 1.0))
