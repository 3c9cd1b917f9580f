"""Search for the causes of a failure: delta debugging, first of layers, then of single things.

Zeller and Hildebrandt 2002, "Simplifying and isolating failure-inducing input". Written here and
not taken from a package: the ones on PyPI (picire, ddmin) have not been released since 2021 and
2019, and run tests in their own processes; here the caller decides which runs go together.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, TypeAlias, TypeVar

from daemon.analysis.blame._case import Candidate, RunCase
from daemon.analysis.blame._elements import (
    Blame,
    Element,
    ElementKind,
    Elements,
    NoFailureError,
    Without,
)
from daemon.analysis.blame._runner import BudgetSpentError, CandidateResult, CandidateRunner
from daemon.model.spec import OracleText
from grammars.text.diagnostics import Finding, InputError, Where, did_you_mean

T = TypeVar("T")
FirstFailing: TypeAlias = Callable[[Sequence[tuple[T, ...]]], int | None]
"""Returns the index of the first configuration that fails, or ``None`` when none does."""


def ddmin(items: Sequence[T], first_failing: FirstFailing[T]) -> Iterator[tuple[T, ...]]:
    """Yield ever smaller configurations that fail, the last one 1-minimal.

    ``items`` as a whole must fail. A configuration keeps the order of ``items``; it is 1-minimal
    when it fails and does not with any single item taken away. A configuration that neither
    passes nor fails counts as not failing. Without anything to take away there are no yields.
    """
    current, parts = tuple(items), 2
    # The empty one first: if no item of a kind matters, that is one run instead of a logarithm.
    if current and first_failing([()]) == 0:
        yield ()
        return
    while len(current) > 1:
        bounds = [part * len(current) // parts for part in range(parts + 1)]
        chunks = [current[low:high] for low, high in pairwise(bounds)]
        # The complement of one half is the other half.
        complements = [current[:low] + current[high:] for low, high in pairwise(bounds)]
        tried = [*chunks, *(complements if parts > 2 else [])]
        hit = first_failing(tried)
        if hit is not None:
            current = tried[hit]
            parts = 2 if hit < len(chunks) else max(parts - 1, 2)
            yield current
        elif parts == len(current):
            return
        else:
            parts = min(2 * parts, len(current))


_PHASES: tuple[tuple[ElementKind, ...], ...] = (
    ("waypoint",),
    ("object",),
    ("behaviour", "parameter"),
)
"""Kinds that are reduced together, in this order: a shorter mission makes all later runs short."""
_MOST_SUSPECTS: Final = 12
"""Up to this many layers and parameters, each is left out of the whole run alone, which costs a run
of the budget."""


@dataclass(frozen=True, slots=True)
class BlameResult:
    """The story of a failure and the smallest run that still fails, without ``away``."""

    story: Blame
    smallest: Candidate
    away: Elements


@dataclass(slots=True)
class _Search:
    """The elements that a failing run does without so far, and the reasons why it fails.

    A reason is a layer or parameter without which the run passes.
    """

    case: RunCase
    oracle: OracleText
    runner: CandidateRunner
    away: Elements = frozenset()
    reasons: tuple[Element, ...] = ()
    layers: tuple[Without, ...] = ()
    minimal: bool = False

    def blame_layers(self) -> None:
        """Find the layers and parameters that the failure needs."""
        added = self.case.added
        if self._first_failing([frozenset(added)]) == 0:
            self.away = frozenset(added)
            return
        if len(added) <= _MOST_SUSPECTS:
            self._try_without_each(added)
        self._take_away([element for element in added if element not in self.reasons])
        # From here on only needed elements can be reasons.
        self.layers = self._try_without_each([e for e in added if e not in self.away])

    def reduce(self) -> None:
        """Take single things away, kind by kind; then prove that no one thing can go."""
        for kinds in _PHASES:
            self._take_away(self._remaining(kinds))
        # One by one: things that were needed beside one of a later kind may not be any more.
        hit: int | None = 0
        while hit is not None:
            smaller = [self.away | {one} for kinds in _PHASES for one in self._remaining(kinds)]
            hit = self._first_failing(smaller)
            if hit is not None:
                self.away = smaller[hit]
        self.minimal = True

    def _remaining(self, kinds: Collection[ElementKind]) -> list[Element]:
        return [one for one in self.case.remaining(self.away) if one.kind in kinds]

    def _take_away(self, items: Sequence[Element]) -> None:
        """Take as many of ``items`` away as the failure can do without."""
        away = self.away

        def without(rest: Collection[Element]) -> Elements:
            return away.union(item for item in items if item not in rest)

        for rest in ddmin(items, lambda tried: self._first_failing(list(map(without, tried)))):
            self.away = without(rest)

    def _try_without_each(self, elements: Sequence[Element]) -> tuple[Without, ...]:
        """Return how the run ends without each one, and note the reasons."""
        results = self.runner.results([self._candidate(self.away | {one}) for one in elements])
        ends = tuple(
            Without(element, "unresolved", "there is no run, another layer needs it")
            if result is None
            else Without(element, result.word, result.verdict.evidence.note)
            for element, result in zip(elements, results, strict=True)
        )
        self.reasons = tuple(end.element for end in ends if end.word == "pass")
        return ends

    def _first_failing(self, configurations: Sequence[Elements]) -> int | None:
        """Return the first of these that fails for the same reasons, each without its elements.

        A run that fails as well without one of the reasons fails for another one: because of a
        door that is shut from the beginning, say, not one that shuts.
        """
        start = 0
        while True:
            hit = self.runner.first_failing([self._candidate(c) for c in configurations[start:]])
            if hit is None:
                return None
            start += hit
            without = [self._candidate(configurations[start] | {one}) for one in self.reasons]
            if self.runner.first_failing(without) is None:
                return start
            start += 1

    def _candidate(self, away: Elements) -> Candidate | None:
        """Return the run without these elements, ``None`` if the rest makes none."""
        try:
            return self.case.candidate(away, self.oracle)
        except (InputError, ValueError):
            return None


def explain_failure(case: RunCase, runner: CandidateRunner, oracle: str = "") -> BlameResult:
    """Find out why a run fails, and return the story with the smallest run that still does.

    ``oracle`` names the one whose verdict matters; without it, it is the first that fails. A spent
    budget and Ctrl-C keep the smallest run so far, and the story says so. Raises
    :class:`NoFailureError` for a run that does not fail, :class:`InputError` for an oracle it does
    not have, and :class:`BudgetSpentError` or ``KeyboardInterrupt`` before that is known.
    """
    judge, first = _reproduce_failure(case, runner, oracle)
    search, stopped = _Search(case, judge, runner), ""
    try:
        search.blame_layers()
        search.reduce()
    except BudgetSpentError:
        stopped = f"the budget of {runner.budget} runs is spent"
    except KeyboardInterrupt:
        stopped = "interrupted"
    smallest = case.candidate(search.away, judge)
    whole, remaining = case.remaining(frozenset()), case.remaining(search.away)
    kinds: tuple[ElementKind, ...] = ("object", "waypoint", "behaviour", "parameter")
    parameters = [one for one in remaining if one.kind == "parameter"]
    story = Blame(
        run=case.spec.label,
        verdict=first.verdict,
        layers=search.layers,
        objects=tuple(thing.name for thing in smallest.scene.objects),
        behaviours=tuple(one.name for one in remaining if one.kind == "behaviour"),
        waypoints=tuple(waypoint.id for waypoint in smallest.spec.mission.waypoints),
        parameters=tuple(one.name for one in parameters),
        before=tuple((kind, sum(one.kind == kind for one in whole)) for kind in kinds),
        last=(runner.known(smallest) or first).verdict,
        minimal=search.minimal,
        stopped=stopped,
        settings=tuple(one.short_name for one in parameters),
    )
    return BlameResult(story, smallest, search.away)


def _reproduce_failure(
    case: RunCase, runner: CandidateRunner, oracle: str
) -> tuple[OracleText, CandidateResult]:
    """Execute the run as it is; return the oracle that fails and its verdict."""
    names = [o.name for o in case.spec.oracles]
    if oracle and oracle not in names:
        message = f'{case.spec.label} has no oracle "{oracle}"'
        where = Where(case.campaign.file)
        raise InputError(Finding(where, message, did_you_mean(oracle, names)))
    endings = runner.judge_all(Candidate(case.spec, case.cell.scene))
    for one, ended in zip(case.spec.oracles, endings, strict=True):
        if ended.word == "fail" and oracle in ("", one.name):
            runner.remember(case.candidate(frozenset(), one), ended)
            return one, ended
    outcomes = ", ".join(f"{v.verdict.oracle} {v.verdict.outcome}" for v in endings)
    name = f" {oracle}" if oracle else ""
    raise NoFailureError(f"{case.spec.label} does not fail{name}: {outcomes}")
