"""What failures have in common, and which parameters decide."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, TypeAlias

import numpy as np

from daemon.judging.statistics import chance_correlation
from daemon.model.search import PointValue, SearchTask
from daemon.model.search_answer import Finding, Influence, PointResult, UnsoughtFailure
from daemon.search.execution.results import ExploredPoint, smallest_margin

FailureKey: TypeAlias = tuple[str, str, str]
"""Oracle, object, and the waypoint that the robot was on its way to."""
_FEWEST: Final = 5
"""With fewer runs than these, a correlation says nothing."""


def failure_key(result: PointResult) -> FailureKey:
    """Return what makes two failures one."""
    if result.verdict is None:
        return "", "", ""
    oracle, waypoint = result.verdict.oracle, ""
    if result.value is not None and result.value.oracle == oracle:
        waypoint = result.value.waypoint
    return oracle, result.about, waypoint


def distinct_failures(results: Sequence[PointResult]) -> tuple[Finding, ...]:
    """Return the failures that differ, the most frequent first, each with its worst example."""
    groups: dict[FailureKey, list[PointResult]] = {}
    for result in results:
        if result.fails:
            groups.setdefault(failure_key(result), []).append(result)
    found = []
    for (oracle, about, waypoint), members in groups.items():
        example = smallest_margin(members) or members[0]
        if example.verdict is not None:
            evidence = example.verdict.evidence
            found.append(Finding(oracle, about, waypoint, len(members), example, evidence))
    return tuple(sorted(found, key=lambda one: (-one.count, one.example.number)))


def unsought_failures(explored: Sequence[ExploredPoint]) -> tuple[UnsoughtFailure, ...]:
    """Return which oracles fail that the search is not about, in the order they were met."""
    found: dict[str, UnsoughtFailure] = {}
    for one in explored:
        for oracle in one.result.unsought if one.result is not None else ():
            before = found.get(oracle, UnsoughtFailure(oracle, 0, False))
            written = before.as_written or one.method == "written"
            found[oracle] = UnsoughtFailure(oracle, before.runs + 1, written)
    return tuple(found.values())


def drawn_points(explored: Sequence[ExploredPoint]) -> list[ExploredPoint]:
    """Return the points that were drawn without looking at results: only they show frequencies.

    The scenario as written was not drawn.
    """
    return [one for one in explored if not one.guided and one.method != "written"]


def parameter_influence(
    task: SearchTask, explored: Sequence[ExploredPoint]
) -> tuple[Influence, ...]:
    """Return how much each parameter decides, by the points that were drawn; empty for too few."""
    pairs = [
        (one.values, one.result.value.value)
        for one in drawn_points(explored)
        if one.result is not None and one.result.value is not None
    ]
    if len(pairs) < _FEWEST:
        return ()
    margins = np.array([value for _, value in pairs])
    found = []
    for index, parameter in enumerate(task.parameters):
        values = [point[index] for point, _ in pairs]
        numbers = [value for value in values if not isinstance(value, str)]
        if parameter.choices or len(numbers) < len(values):
            correlation = correlation_ratio(values, margins)
        else:
            correlation = rank_correlation(np.array(numbers), margins)
        found.append(Influence(parameter.name, correlation, len(pairs)))
    return tuple(found)


def is_by_chance(task: SearchTask, influence: Influence) -> bool:
    """Return whether a parameter that decides nothing gives such a correlation as well."""
    named = next((p for p in task.parameters if p.name == influence.parameter), None)
    groups = len(named.choices) if named is not None else 0
    bound = chance_correlation(influence.runs, max(groups, 2))
    return not abs(influence.correlation) > bound


def rank_correlation(values: np.ndarray[Any, Any], margins: np.ndarray[Any, Any]) -> float:
    """Return Spearman's rank correlation of (n,) and (n,), -1 to 1; 0 where one does not vary.

    Equal values share the mean of their ranks: plateaus of the margin are common.
    """
    left, right = _ranks(values), _ranks(margins)
    left, right = left - left.mean(), right - right.mean()
    spread = math.sqrt(float(left @ left) * float(right @ right))
    return float(left @ right) / spread if spread > 0.0 else 0.0


def _ranks(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    _, inverse, counts = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    means: np.ndarray[Any, Any] = (last - 0.5 * (counts - 1))[inverse]
    return means


def correlation_ratio(values: Sequence[PointValue], margins: np.ndarray[Any, Any]) -> float:
    """Return the correlation ratio of margins (n,) by choice, 0 to 1.

    The square root of the variance between choices over the whole variance (Pearson 1905).
    """
    whole = float(((margins - margins.mean()) ** 2).sum())
    if whole <= 0.0:
        return 0.0
    between = 0.0
    for choice in dict.fromkeys(values):
        members = margins[[value == choice for value in values]]
        between += len(members) * float(members.mean() - margins.mean()) ** 2
    return math.sqrt(min(between / whole, 1.0))
