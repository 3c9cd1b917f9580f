"""What a campaign declares about its results, and what its runs make of that."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, Literal, TypeAlias

from daemon.model.run_state import UNFINISHED_STATES, RunState
from daemon.model.verdicts import Outcome, Verdict

PolicyRule: TypeAlias = Literal["all", "rate", "mean"]
ExpectedVerdict: TypeAlias = Literal["pass", "fail", "mixed", "any"]
ComparisonOperator: TypeAlias = Literal["<=", "<", ">=", ">"]
ReferenceStatistic: TypeAlias = Literal["mean", "median", "min", "max", "rate"]

MISSING_STATES: Final = (*UNFINISHED_STATES, RunState.LOST, RunState.CANCELLED)
"""States of runs without a result, in the order in which one of them is said of several runs."""
_ENDED_STATES: Final = ("done", "lost")

DELAY: Final = "delay"
"""The quantity of a comparison that every run has: how long it took [s]."""
DURATION: Final = "duration"
"""The measure every run has: the simulated time it took [s]."""


@dataclass(frozen=True, slots=True)
class RepeatPolicy:
    """How many repeats a cell has, and when all of them together pass.

    ``all``: every repeat passes. ``rate``: the share that passes is shown to be at least ``rate``.
    ``mean``: the mean margin is shown to be at least 0. With ``until_decided`` a cell that is
    neither shown to pass nor to fail after ``n`` repeats gets more of them, up to ``at_most``.
    """

    n: int = 1
    rule: PolicyRule = "all"
    rate: float = 1.0
    until_decided: bool = False
    at_most: int = 1

    @property
    def looks(self) -> tuple[int, ...]:
        """Numbers of repeats after which a cell is judged: one, or each time twice as many."""
        if not self.until_decided:
            return (self.n,)
        # Doubled each time: every look costs confidence in all of them (see ``confidence_of``), and
        # intervals shrink by the square root of the number of repeats only.
        found = [self.n]
        while found[-1] < self.at_most:
            found.append(min(2 * found[-1], self.at_most))
        return tuple(found)


@dataclass(frozen=True, slots=True)
class ScenarioComparison:
    """A sentence about two scenarios: ``delay(S3.2 vs S3.5) <= 30 s``.

    ``quantity`` is ``delay`` or the name of a measure of both; what is compared with ``limit`` [SI
    unit ``unit``] is left minus right, paired by repeat. ``leg`` is the waypoint, or the number, of
    the leg meant, ``None`` for the whole run; ``measure`` then names the measure that times it.
    """

    name: str
    quantity: str
    left: str
    right: str
    leg: str | None
    op: ComparisonOperator
    limit: float
    unit: str
    text: str
    measure: str = ""


@dataclass(frozen=True, slots=True)
class Expectation:
    """What is known to be otherwise than passing, and why.

    ``scenario``, ``oracle`` (or the name of a comparison) and ``suts`` are patterns with ``*`` and
    ``?``; the last expectation that matches counts. ``fail``: every repeat fails; ``mixed``: at
    least one does. ``where`` is file and line.
    """

    scenario: str
    oracle: str
    suts: tuple[str, ...]
    verdict: ExpectedVerdict
    why: str
    where: str = ""


@dataclass(frozen=True, slots=True)
class RegressionGate:
    """Against what a campaign must not get worse, and by how much (a ratio).

    ``baseline`` is a campaign, a file of results, or ``last-green``: the newest one before of the
    same name in which everything was as expected.
    """

    baseline: str
    worse_by: float


@dataclass(frozen=True, slots=True)
class ReferenceValue:
    """What somebody else found of the same, shown beside what is found here; it judges nothing.

    ``name`` is short (``paper``), ``source`` says whose it is. ``scenario`` and ``suts`` are as in
    an :class:`Expectation`; ``scenario`` is empty when ``oracle`` names a comparison.
    ``statistic`` is what the source made of its runs: of a measure or comparison ``value`` [SI unit
    ``unit``], perhaps with the standard ``deviation`` of its runs and a range, ``low`` to ``high``;
    of an oracle with a limit the ``rate`` that passed. ``runs`` is how many there were, ``None``
    when nobody says. ``text`` is the value as written, ``where`` file and line.
    """

    name: str
    source: str
    scenario: str
    suts: tuple[str, ...]
    oracle: str
    statistic: ReferenceStatistic
    value: float
    unit: str
    text: str
    deviation: float | None = None
    low: float | None = None
    high: float | None = None
    runs: int | None = None
    note: str = ""
    where: str = ""


@dataclass(frozen=True, slots=True)
class AssessmentRules:
    """Everything a campaign says about its results beyond its oracles."""

    policy: RepeatPolicy = RepeatPolicy()
    comparisons: tuple[ScenarioComparison, ...] = ()
    expectations: tuple[Expectation, ...] = ()
    gate: RegressionGate | None = None
    references: tuple[ReferenceValue, ...] = ()


def state_of(states: Iterable[str]) -> str:
    """Return how runs in these states stand that are said to be one thing: the first of
    ``MISSING_STATES`` that one of them is in, ``done`` when all have a result.
    """
    found = set(states)
    return next((state for state in MISSING_STATES if state in found), "done")


class ExpectationStatus(StrEnum):
    """Relation of a verdict to its expectation; ``open``: the verdict decides nothing (yet)."""

    MET = "met"
    OPEN = "open"
    CONTRADICTED = "contradicted"


@dataclass(frozen=True, slots=True)
class WorstRun:
    """The run of a cell to look at first and its verdict, with the evidence."""

    run: str
    repeat: int
    verdict: Verdict


class _ExpectedVerdict:
    """Common part of verdicts with an expectation."""

    __slots__ = ()
    verdict: Outcome
    status: ExpectationStatus
    state: str

    @property
    def word(self) -> str:
        """The verdict; where runs are missing that could decide it, what they are."""
        undecided = self.verdict is Outcome.INCONCLUSIVE
        return self.state if undecided and self.state != "done" else str(self.verdict)

    @property
    def needs_attention(self) -> bool:
        """Whether it is contradicted, or open although no more runs will decide it."""
        ended = self.state in _ENDED_STATES
        return self.status is not ExpectationStatus.MET and (
            ended or self.status is ExpectationStatus.CONTRADICTED
        )


@dataclass(frozen=True, slots=True)
class CellVerdict(_ExpectedVerdict):
    """One oracle over all repeats of a scenario with a system under test.

    ``n`` counts all repeats, ``missing`` those without a result. ``low`` and ``high`` bound the
    pass rate, the exact 95 % interval; a repeat not judged may have been either. ``at_least`` is
    the rate shown (one-sided 95 %; ``needed`` is how many more repeats, all passing, would show
    that of the policy, ``None`` when it asks for no rate). ``statement`` says it in words.
    ``verdict`` follows the policy; ``status`` compares it with the ``expected`` one (``why``):
    contradicted whatever the missing runs will be. ``state`` is how the repeats stand
    (:func:`state_of`).
    """

    scenario: str
    sut: str
    oracle: str
    passed: int
    failed: int
    inconclusive: int
    errors: int
    missing: int
    n: int
    low: float
    high: float
    at_least: float
    needed: int | None
    statement: str
    worst: WorstRun | None
    verdict: Outcome
    expected: ExpectedVerdict
    status: ExpectationStatus
    why: str
    state: str = "done"


def group_errors(oracles: Iterable[CellVerdict]) -> list[tuple[CellVerdict, ...]]:
    """Return oracles in groups: those of a cell whose worst run ended in the same error share one.

    Each other oracle is a group of its own; the order is that of the first of each group.
    """
    groups: dict[tuple[str, ...], list[CellVerdict]] = {}
    for oracle in oracles:
        worst = None if oracle.worst is None else oracle.worst.verdict
        key: tuple[str, ...] = (oracle.scenario, oracle.sut, oracle.oracle)
        if worst is not None and worst.outcome is Outcome.ERROR:
            key = (oracle.scenario, oracle.sut, oracle.statement, worst.evidence.note_text)
        groups.setdefault(key, []).append(oracle)
    return [tuple(group) for group in groups.values()]


@dataclass(frozen=True, slots=True)
class CellMeasure:
    """A measured quantity over all repeats of a cell: ``values[i]`` is that of ``repeats[i]``.

    ``low`` and ``high`` are the 95 % t interval of the mean; ``std`` the sample's standard
    deviation. With one value there is neither. The run's ``duration`` [s] is a measure of all.
    """

    scenario: str
    sut: str
    oracle: str
    unit: str
    repeats: tuple[int, ...]
    values: tuple[float, ...]
    mean: float
    std: float | None
    low: float | None
    high: float | None


@dataclass(frozen=True, slots=True)
class CellAssessment:
    """A scenario with a system under test: the gravest verdict of its oracles, and all of them.

    ``state`` is how its ``runs`` stand (:func:`state_of`).
    """

    scenario: str
    sut: str
    verdict: Outcome
    oracles: tuple[CellVerdict, ...]
    measures: tuple[CellMeasure, ...]
    runs: tuple[str, ...] = ()
    state: str = "done"

    @property
    def status(self) -> ExpectationStatus:
        """The status farthest from what is expected of its oracles; open without oracles."""
        found = {oracle.status for oracle in self.oracles} or {ExpectationStatus.OPEN}
        return next(status for status in reversed(ExpectationStatus) if status in found)

    @property
    def word(self) -> str:
        """The one word for it: a failure at once, else what it waits for or lacks."""
        failed = self.verdict is Outcome.FAIL
        return str(self.verdict) if failed or self.state == "done" else self.state

    @property
    def needs_attention(self) -> bool:
        """Whether some oracle is not as expected, see :attr:`CellVerdict.needs_attention`."""
        return any(oracle.needs_attention for oracle in self.oracles)


@dataclass(frozen=True, slots=True)
class ComparisonVerdict(_ExpectedVerdict):
    """A comparison with one system under test: ``mean`` of left minus right [``unit``].

    ``low`` and ``high`` are one-sided 95 % bounds of the mean, by which it is judged, ``interval``
    is the two-sided one; ``method`` is ``paired`` or ``welch`` (no pairs), empty when there is too
    little to say. ``n`` counts the pairs, or the runs of the smaller side; ``left_out`` runs that
    have no such value: they did not end their mission, or have no result. ``note`` says what stands
    in the way of a verdict. ``status`` and ``state`` are as in a :class:`CellVerdict`.
    """

    comparison: str
    text: str
    sut: str
    unit: str
    limit: float
    n: int
    left_out: int
    differences: tuple[float, ...]
    mean: float | None
    low: float | None
    high: float | None
    method: Literal["paired", "welch", ""]
    verdict: Outcome
    note: str
    expected: ExpectedVerdict
    status: ExpectationStatus
    why: str
    state: str = "done"
    interval: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class ReferenceComparison:
    """A reference value beside the same statistic of the runs here.

    ``scenario`` is empty for a comparison. ``value`` [``reference.unit``] is of ``n`` runs (of
    pairs, for a comparison), ``deviation`` their standard deviation, ``low`` and ``high`` the 95 %
    interval: Student's t of a mean, exact of a rate, ``None`` of other statistics and where too few
    runs have a value.
    """

    reference: ReferenceValue
    scenario: str
    sut: str
    n: int
    value: float | None
    deviation: float | None = None
    low: float | None = None
    high: float | None = None

    @property
    def difference(self) -> float | None:
        """How much more was found here than in the reference [``reference.unit``]."""
        return None if self.value is None else self.value - self.reference.value


@dataclass(frozen=True, slots=True)
class UnexpectedVerdict:
    """Something that is not as expected: what to look at, in one line of words.

    ``verdict`` is what came out, ``expected`` what should have. ``run`` is empty for comparisons.
    """

    scenario: str
    sut: str
    oracle: str
    verdict: Outcome
    expected: ExpectedVerdict
    run: str
    repeat: int | None
    why: str
    text: str


@dataclass(frozen=True, slots=True)
class Assessment:
    """A campaign judged: cells in the order of the runs, comparisons in that of the file.

    ``exit_code``: 0 everything as expected, 1 something unexpected, 3 runs that could not be
    executed or judged, 4 runs or statistics that decide nothing.
    """

    cells: tuple[CellAssessment, ...]
    comparisons: tuple[ComparisonVerdict, ...]
    surprises: tuple[UnexpectedVerdict, ...]
    exit_code: int


@dataclass(frozen=True, slots=True)
class Mark:
    """Mark of a verdict: ``letter`` is the sign to show, ``!`` for news, ``reason`` its meaning.

    ``known``: every failure was expected, and ``reason`` is the one people gave. Letters of known
    failures may follow the sign of news. Without a kind there is nothing to say.
    """

    kind: Literal["news", "known", ""] = ""
    letter: str = ""
    reason: str = ""


NO_MARK: Final = Mark()
