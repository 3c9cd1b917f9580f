"""Search for the causes of a failure: delta debugging, first of layers, then of single things.

Zeller and Hildebrandt 2002, "Simplifying and isolating failure-inducing input". This is our own
code: the packages on PyPI (picire, ddmin) had their last releases in 2021 and 2019. They also run
tests in their own processes, while here the caller decides which runs go together.
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
    TestOutcome,
    Without,
)
from daemon.analysis.blame._runner import BudgetSpentError, CandidateRunner
from daemon.model.spec import OracleText
from daemon.model.verdicts import Outcome, Verdict
from grammars.text.diagnostics import Finding, InputError, Where, did_you_mean

T = TypeVar("T")
FirstFailing: TypeAlias = Callable[[Sequence[tuple[T, ...]]], int | None]
"""Returns the index of the first failing configuration, ``None`` if all pass."""


def ddmin(items: Sequence[T], first_failing: FirstFailing[T]) -> Iterator[tuple[T, ...]]:
    """Yield ever smaller failing configurations, the last one 1-minimal.

    ``items`` as a whole must fail. A configuration keeps the order of ``items``. It is 1-minimal if
    it fails, but not after the removal of any single item. A configuration that neither passes nor
    fails counts as not failing. Without removable items nothing is yielded.
    """
    current, parts = tuple(items), 2
    # Try the empty one first: if no item matters, this takes one run instead of a logarithm.
    if current and first_failing([()]) == 0:
        yield ()
        return
    while len(current) > 1:
        bounds = [part * len(current) // parts for part in range(parts + 1)]
        chunks = [current[low:high] for low, high in pairwise(bounds)]
        # The complement of one half is the other half.
        complements = [current[:low] + current[high:] for low, high in pairwise(bounds)]
        configurations = [*chunks, *(complements if parts > 2 else [])]
        hit = first_failing(configurations)
        if hit is not None:
            current = configurations[hit]
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
"""Kinds reduced together, in this order: a shorter mission shortens all later runs."""
_MOST_SUSPECTS: Final = 12
"""Most layers and parameters that are each left out of the whole run, at the cost of a run."""


@dataclass(frozen=True, slots=True)
class BlameResult:
    """The story of a failure and the smallest run that still fails, without ``away``."""

    story: Blame
    smallest: Candidate
    away: Elements


@dataclass(slots=True)
class _Search:
    """Search state: the elements taken ``away`` so far, and the ``reasons`` of the failure.

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
        # From now on only needed elements can be reasons.
        self.layers = self._try_without_each([e for e in added if e not in self.away])

    def reduce(self) -> None:
        """Take single things away, kind by kind, until no further one can be removed."""
        for kinds in _PHASES:
            self._take_away(self._remaining(kinds))
        # One by one: things needed before the removal of a later kind may be removable now.
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
        """Take away as many of ``items`` as possible."""
        away = self.away

        def without(rest: Collection[Element]) -> Elements:
            return away.union(item for item in items if item not in rest)

        for rest in ddmin(items, lambda tried: self._first_failing(list(map(without, tried)))):
            self.away = without(rest)

    def _try_without_each(self, elements: Sequence[Element]) -> tuple[Without, ...]:
        """Return the outcome without each element, and note the reasons."""
        results = self.runner.results([self._candidate(self.away | {one}) for one in elements])
        ends = tuple(
            Without(element, "unresolved", "there is no run, another layer needs it")
            if result is None
            else Without(element, _word(result), result.evidence.note)
            for element, result in zip(elements, results, strict=True)
        )
        self.reasons = tuple(end.element for end in ends if end.word == "pass")
        return ends

    def _first_failing(self, configurations: Sequence[Elements]) -> int | None:
        """Return the first run, without one of ``configurations``, that fails for the same reasons.

        A run that also fails without one of the reasons has another reason, such as a door that is
        shut from the beginning.
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
        """Return the run without these elements, ``None`` if the rest is not a run."""
        try:
            return self.case.candidate(away, self.oracle)
        except (InputError, ValueError):
            return None


def _word(verdict: Verdict) -> TestOutcome:
    words: dict[Outcome, TestOutcome] = {Outcome.PASS: "pass", Outcome.FAIL: "fail"}
    return words.get(verdict.outcome, "unresolved")


def explain_failure(case: RunCase, runner: CandidateRunner, oracle: str = "") -> BlameResult:
    """Find the causes of a failure; return their story with the smallest run that still fails.

    ``oracle`` names the oracle whose verdict counts, by default the first failing one. A spent
    budget and Ctrl-C keep the smallest run so far, and the story says so. Raises
    :class:`NoFailureError` for a run that does not fail, :class:`InputError` for an unknown oracle,
    and :class:`BudgetSpentError` or ``KeyboardInterrupt`` before the failure is reproduced.
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
        verdict=first,
        layers=search.layers,
        objects=tuple(thing.name for thing in smallest.scene.objects),
        behaviours=tuple(one.name for one in remaining if one.kind == "behaviour"),
        waypoints=tuple(waypoint.id for waypoint in smallest.spec.mission.waypoints),
        parameters=tuple(one.name for one in parameters),
        before=tuple((kind, sum(one.kind == kind for one in whole)) for kind in kinds),
        last=runner.recall(smallest) or first,
        minimal=search.minimal,
        stopped=stopped,
        settings=tuple(one.short_name for one in parameters),
    )
    return BlameResult(story, smallest, search.away)


def _reproduce_failure(
    case: RunCase, runner: CandidateRunner, oracle: str
) -> tuple[OracleText, Verdict]:
    """Execute the whole run; return the failing oracle and its verdict."""
    names = [o.name for o in case.spec.oracles]
    if oracle and oracle not in names:
        message = f'{case.spec.label} has no oracle "{oracle}"'
        where = Where(case.campaign.file)
        raise InputError(Finding(where, message, did_you_mean(oracle, names)))
    verdicts = runner.verdicts(Candidate(case.spec, case.cell.scene))
    for one, verdict in zip(case.spec.oracles, verdicts, strict=True):
        if verdict.outcome is Outcome.FAIL and oracle in ("", one.name):
            runner.remember(case.candidate(frozenset(), one), verdict)
            return one, verdict
    outcomes = ", ".join(f"{verdict.oracle} {verdict.outcome}" for verdict in verdicts)
    name = f" {oracle}" if oracle else ""
    raise NoFailureError(f"{case.spec.label} does not fail{name}: {outcomes}")
