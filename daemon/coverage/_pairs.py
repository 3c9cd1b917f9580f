"""Which features and pairs of features a set of runs exercises."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

from daemon.coverage._facts import Facts
from daemon.coverage._model import Feature, FeatureModel
from daemon.coverage._types import FeatureCount, PairCount, Pairs


@dataclass(frozen=True, slots=True)
class Recognised:
    """Paths of the leaves one run plans, and of those it exercised: by its trace if it has one."""

    planned: tuple[str, ...]
    exercised: tuple[str, ...]
    recorded: bool


def recognise(model: FeatureModel, facts: Facts) -> Recognised:
    """Return the leaves of ``model`` that a run has."""
    planned, exercised = [], []
    for feature in model.features:
        path = _present(feature, facts)
        if path is None:
            continue
        planned.append(path)
        if facts.trace is None or feature.done is None or feature.done(facts):
            exercised.append(path)
    return Recognised(tuple(planned), tuple(exercised), facts.trace is not None)


def _present(feature: Feature, facts: Facts) -> str | None:
    if feature.named is not None:
        return f"{feature.path}/{feature.named(facts)}"
    return feature.path if feature.planned is not None and feature.planned(facts) else None


def leaves(model: FeatureModel, runs: Iterable[Recognised]) -> dict[str, str]:
    """Return every leaf and what it is about, in the order of the model.

    A feature with names from the campaign has one leaf for each name that ``runs`` bring.
    """
    met = dict.fromkeys(path for run in runs for path in run.planned)
    found: dict[str, str] = {}
    for feature in model.features:
        if feature.named is not None:
            prefix = f"{feature.path}/"
            found |= {path: feature.about for path in met if path.startswith(prefix)}
        elif feature.planned is not None:
            found[feature.path] = feature.about
    return found


def feature_counts(model: FeatureModel, runs: Sequence[Recognised]) -> tuple[FeatureCount, ...]:
    """Count runs per leaf."""
    planned = Counter(path for run in runs for path in run.planned)
    done = Counter(path for run in runs if run.recorded for path in run.exercised)
    return tuple(
        FeatureCount(path, about, planned[path], done[path])
        for path, about in leaves(model, runs).items()
    )


def pair_counts(model: FeatureModel, runs: Sequence[Recognised]) -> Pairs:
    """Count runs per pair of leaves; a pair is exercised by a run that exercises both."""
    excluded = {frozenset((e.first, e.second)) for e in model.exclusions}
    choices = {f.path for f in model.features if f.group == "alternative"}
    counted = Counter(
        pair for run in runs for pair in combinations(sorted(run.exercised), 2)
    )  # sorted, so that a pair is counted under one key
    exercised, missing, impossible = [], [], 0
    for first, second in combinations(leaves(model, runs), 2):
        either = _parent(first) == _parent(second) and _parent(first) in choices
        if either or frozenset((first, second)) in excluded:
            impossible += 1
            continue
        low, high = sorted((first, second))
        if counted[low, high]:
            exercised.append(PairCount(first, second, counted[low, high]))
        else:
            missing.append((first, second))
    possible = len(exercised) + len(missing)
    return Pairs(possible, impossible, tuple(exercised), tuple(missing))


def _parent(path: str) -> str:
    return path.rpartition("/")[0]
