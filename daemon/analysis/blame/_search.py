"""The search for what is to blame: delta debugging, first among layers, then among single things.

Zeller and Hildebrandt 2002, "Simplifying and isolating failure-inducing input". Written here and
not taken from a package: the ones on PyPI (picire, ddmin) have not been released since 2021 and
2019, and run tests in their own processes; here whoever asks decides what runs at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, TypeAlias, TypeVar

from daemon.analysis.blame._case import Candidate, RunCase
from daemon.analysis.blame._elements import Blame, Element, ElementKind, NoFailureError, Without
from daemon.analysis.blame._runner import BudgetSpentError, CandidateResult, CandidateRunner
from daemon.model.spec import OracleText
from daemon.model.verdicts import Verdict
from grammars.text.diagnostics import InputError, did_you_mean

T = TypeVar("T")
LINEAR_STEPS: Final = 4
"""So many items are stepped over one by one when looking for a flip: suspects are added last, since
a campaign puts its overrides and parameters on top of layers that others share."""
FirstFailing: TypeAlias = Callable[[Sequence[tuple[T, ...]]], int | None]
"""Returns the index of the first configuration that fails, or ``None`` when none does."""


def ddmin(items: Sequence[T], first_failing: FirstFailing[T]) -> Iterator[tuple[T, ...]]:
    """Yield ever smaller configurations that fail, the last one 1-minimal.

    ``items`` as a whole must fail. A configuration keeps the order of ``items``; it is 1-minimal
    when it fails and does not with any single item taken away. What neither passes nor fails
    counts as not failing. Nothing is yielded when nothing can be taken away.
    """
    current, parts = tuple(items), 2
    # Nothing at all first: where none of a kind matters, that is one run instead of a logarithm.
    if current and first_failing([()]) == 0:
        yield ()
        return
    while len(current) > 1:
        chunks = split_evenly(current, parts)
        # The complement of one half is the other half.
        complements = [_complement(current, chunk) for chunk in chunks] if parts > 2 else []
        tried = [*chunks, *complements]
        hit = first_failing(tried)
        if hit is not None:
            current = tried[hit]
            parts = 2 if hit < len(chunks) else max(parts - 1, 2)
            yield current
        elif parts == len(current):
            return
        else:
            parts = min(2 * parts, len(current))


def split_evenly(items: Sequence[T], parts: int) -> list[tuple[T, ...]]:
    """Return ``items`` in ``parts`` runs of nearly equal length, none of them empty."""
    bounds = [index * len(items) // parts for index in range(parts + 1)]
    return [tuple(items[low:high]) for low, high in pairwise(bounds)]


def _complement(items: tuple[T, ...], chunk: tuple[T, ...]) -> tuple[T, ...]:
    start = items.index(chunk[0])
    return items[:start] + items[start + len(chunk) :]


def find_flip(items: Sequence[T], first_failing: FirstFailing[T]) -> int:
    """Return the index of an item that makes the items before it fail when it is added.

    All ``items`` together must fail, none of them must not. Where several do, it is the last of
    them if that is among the last few items, else one near the end: steps backwards, at first one
    by one, grow until something does not fail, then the gap is halved.
    """
    low, high, probes = 0, len(items), 0

    def fails(count: int) -> bool:
        return first_failing([tuple(items[:count])]) == 0

    while (probe := high - 2 ** max(0, probes - LINEAR_STEPS + 1)) > low:
        if not fails(probe):
            low = probe
            break
        high, probes = probe, probes + 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if fails(middle) else (middle, high)
    return high - 1


Elements: TypeAlias = tuple[Element, ...]
_PHASES: tuple[tuple[ElementKind, ...], ...] = (
    ("waypoint",),
    ("object",),
    ("behaviour", "parameter"),
)
"""Kinds that are reduced together, in this order: a shorter mission makes all later runs short."""


_MOST_SUSPECTS: Final = 12
"""Up to so many layers and parameters, each is left out once: what passes then is a reason.

Each costs a run of the budget; with more of them only the flip itself is held to be one."""


@dataclass(frozen=True, slots=True)
class BlameResult:
    """The story of a failure and the smallest run that still fails, with what it is made of."""

    story: Blame
    smallest: Candidate
    left: Elements


@dataclass(slots=True)
class _Search:
    """A search while it lasts: the smallest failing run so far and what is known about it."""

    case: RunCase
    oracle: OracleText
    runner: CandidateRunner
    left: Elements
    flips: Element | None = None
    reasons: Elements = ()
    layers: tuple[Without, ...] = ()
    minimal: bool = False

    def fails(self, configurations: Sequence[Collection[Element]]) -> int | None:
        """Return the first of these configurations that fails for the same reasons.

        What fails as well without a layer or parameter that is known to make the difference fails
        for another reason: because of a door that is shut from the beginning, not one that shuts.
        """
        start = 0
        while True:
            built = [self.build(kept) for kept in configurations[start:]]
            hit = self.runner.first_failing(built)
            if hit is None or self._fails_for_same_reason(configurations[start + hit]):
                return None if hit is None else start + hit
            start += hit + 1

    def _fails_for_same_reason(self, kept: Collection[Element]) -> bool:
        without = [self.build([e for e in kept if e != reason]) for reason in self.reasons]
        return self.runner.first_failing(without) is None

    def build(self, kept: Collection[Element]) -> Candidate | None:
        """Return the run of these elements, ``None`` when they make none."""
        try:
            return self.case.candidate(kept, self.oracle)
        except (InputError, ValueError):
            return None

    def with_parts(self, added: Collection[Element]) -> Elements:
        """Return these layers and parameters with everything that is in a run of them."""
        try:
            return (*added, *self.case.parts(added))
        except InputError:
            return tuple(added)  # and no waypoint: it makes no run

    def layers_fail(self, configurations: Sequence[Collection[Element]]) -> int | None:
        """Return the first of these sets of layers and parameters whose whole run fails."""
        return self.fails([self.with_parts(added) for added in configurations])

    def blame_layers(self) -> None:
        """Find what flips the verdict when it is added, and the layers that are needed."""
        added = self.case.added
        if self.layers_fail([()]) == 0:
            self.left = self.with_parts(())
            return
        at = find_flip(added, self.layers_fail)
        self.flips, before = added[at], added[:at]
        self.left = self.with_parts(added[: at + 1])
        self.reasons = self._reasons_among(added[: at + 1])
        flip = added[at]
        for fewer in ddmin(before, lambda tried: self.layers_fail([(*b, flip) for b in tried])):
            before = fewer
            self.left = self.with_parts((*before, flip))
        needed = (*before, flip)
        self.layers = tuple(self._removal_result(element, needed) for element in needed)
        # From here on only what is needed can be a reason.
        self.reasons = tuple(one.element for one in self.layers if one.word == "pass")

    def _reasons_among(self, added: Elements) -> Elements:
        """Return the last element, the flip, and those without which the run passes as well."""
        if len(added) > _MOST_SUSPECTS:
            return added[-1:]
        ended = self.runner.results([self._without(element, added) for element in added])
        return tuple(
            element
            for element, one in zip(added, ended, strict=True)
            if element == added[-1] or (one is not None and one.word == "pass")
        )

    def _without(self, element: Element, among: Elements) -> Candidate | None:
        return self.build(self.with_parts([e for e in among if e != element]))

    def _removal_result(self, element: Element, needed: Elements) -> Without:
        """Say how the run ends without one of the layers it needs; it has been executed."""
        candidate = self._without(element, needed)
        known = self.runner.known(candidate) if candidate is not None else None
        if known is None:
            return Without(element, "unresolved", "there is no run, another layer needs it")
        return Without(element, known.word, known.verdict.evidence.note)

    def reduce(self) -> None:
        """Take single things away, kind by kind; then prove that no one thing can go."""
        # One by one at the end: what was needed beside a thing of a later kind may not be any more.
        for kinds in _PHASES:
            self._reduce([e for e in self.left if e.kind in kinds])
        while self._drop_one():
            pass
        self.minimal = True

    def _reduce(self, items: Sequence[Element]) -> None:
        """Reduce ``items`` among what is left; the rest of it stays."""
        whole = self.left

        def kept(chosen: Collection[Element]) -> Elements:
            return tuple(e for e in whole if e not in items or e in chosen)

        for chosen in ddmin(items, lambda tried: self.fails([kept(c) for c in tried])):
            self.left = kept(chosen)

    def _drop_one(self) -> bool:
        items = [e for kinds in _PHASES for e in self.left if e.kind in kinds]
        smaller = [tuple(e for e in self.left if e != item) for item in items]
        hit = self.fails(smaller)
        if hit is not None:
            self.left = smaller[hit]
        return hit is not None


def explain_failure(case: RunCase, runner: CandidateRunner, oracle: str = "") -> BlameResult:
    """Find out why a run fails, and return the story with the smallest run that still does.

    ``oracle`` names the one whose verdict matters; without it, it is the first that fails. What
    was found before the budget was spent or Ctrl-C was pressed is kept and told as such. Raises
    :class:`NoFailureError` for a run that does not fail, and :class:`BudgetSpentError` or
    ``KeyboardInterrupt`` before that is known.
    """
    asked, first = _reproduce_failure(case, runner, oracle)
    whole = (*case.added, *case.parts(case.added))
    search = _Search(case, asked, runner, whole)
    stopped = ""
    try:
        search.blame_layers()
        search.reduce()
    except BudgetSpentError:
        stopped = f"the budget of {runner.budget} runs is spent"
    except KeyboardInterrupt:
        stopped = "interrupted"
    smallest = case.candidate(search.left, asked)
    last = runner.known(smallest) or first
    story = _summarise(search, first.verdict, last.verdict, whole, smallest, stopped)
    return BlameResult(story, smallest, search.left)


def _reproduce_failure(
    case: RunCase, runner: CandidateRunner, oracle: str
) -> tuple[OracleText, CandidateResult]:
    """Execute the run as it is; return the oracle that fails and its verdict."""
    names = [o.name for o in case.spec.oracles]
    if oracle and oracle not in names:
        hint = did_you_mean(oracle, names)
        raise NoFailureError(f'{case.spec.label} has no oracle "{oracle}", {hint}')
    endings = runner.judge_all(Candidate(case.spec, case.cell.scene))
    whole = (*case.added, *case.parts(case.added))
    for one, ended in zip(case.spec.oracles, endings, strict=True):
        if ended.word == "fail" and oracle in ("", one.name):
            runner.remember(case.candidate(whole, one), ended)
            return one, ended
    said = ", ".join(f"{v.verdict.oracle} {v.verdict.outcome}" for v in endings)
    raise NoFailureError(f"{case.spec.label} does not fail{' ' + oracle if oracle else ''}: {said}")


def _summarise(
    search: _Search,
    verdict: Verdict,
    last: Verdict,
    whole: Elements,
    smallest: Candidate,
    stopped: str,
) -> Blame:
    spec, scene = smallest.spec, smallest.scene
    kinds: tuple[ElementKind, ...] = ("object", "waypoint", "behaviour", "parameter")
    return Blame(
        run=search.case.spec.label,
        verdict=verdict,
        flips=search.flips,
        layers=search.layers,
        objects=tuple(thing.name for thing in scene.objects),
        behaviours=tuple(e.name for e in search.left if e.kind == "behaviour"),
        waypoints=tuple(waypoint.id for waypoint in spec.mission.waypoints),
        parameters=tuple(e.name for e in search.left if e.kind == "parameter"),
        before=tuple((kind, sum(e.kind == kind for e in whole)) for kind in kinds),
        last=last,
        minimal=search.minimal,
        stopped=stopped,
        settings=tuple(e.short_name for e in search.left if e.kind == "parameter"),
    )
