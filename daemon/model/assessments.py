"""Rules of a campaign for its results, and the assessment of its runs by them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, Literal, TypeAlias

from daemon.model.verdicts import UNFINISHED_STATES, Outcome, RunState, Verdict

PolicyRule: TypeAlias = Literal["all", "rate", "mean"]
ExpectedVerdict: TypeAlias = Literal["pass", "fail", "mixed", "any"]
ComparisonOperator: TypeAlias = Literal["<=", "<", ">=", ">"]
ReferenceStatistic: TypeAlias = Literal["mean", "median", "min", "max", "rate"]

MISSING_STATES: Final = (*UNFINISHED_STATES, RunState.LOST, RunState.CANCELLED)
"""States of runs without a result, in order of precedence as the state of several runs."""
_ENDED_STATES: Final = ("done", "lost")

DELAY: Final = "delay"
"""Quantity of a comparison that every run has: its duration [s]."""
DURATION: Final = "duration"
"""Measure that every run has: its simulated time [s]."""


@dataclass(frozen=True, slots=True)
class RepeatPolicy:
    """Number of repeats of a cell, and the rule by which they pass together.

    ``all``: every repeat passes. ``rate``: the share that passes is shown to be at least ``rate``.
    ``mean``: the mean margin is shown to be at least 0. With ``until_decided`` a cell that is
    undecided after ``n`` repeats gets more of them, up to ``at_most``.
    """

    n: int = 1
    rule: PolicyRule = "all"
    rate: float = 1.0
    until_decided: bool = False
    at_most: int = 1

    @property
    def looks(self) -> tuple[int, ...]:
        """Numbers of repeats after which a cell is judged: one number, or a doubling series."""
        if not self.until_decided:
            return (self.n,)
        # Doubled each time: every look costs confidence in all of them (see ``confidence_of``), and
        # intervals shrink only by the square root of the number of repeats.
        looks = [self.n]
        while looks[-1] < self.at_most:
            looks.append(min(2 * looks[-1], self.at_most))
        return tuple(looks)


@dataclass(frozen=True, slots=True)
class ScenarioComparison:
    """A sentence about two scenarios: ``delay(S3.2 vs S3.5) <= 30 s``.

    ``quantity`` is ``delay`` or the name of a measure of both. Left minus right, paired by repeat,
    is compared with ``limit`` [SI unit ``unit``]. ``leg`` is the waypoint or number of a leg,
    ``None`` for the whole run; ``measure`` then names the measure that times the leg.
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
    """A verdict expected other than passing, with its reason.

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
    """Baseline of a campaign, and the ratio by which it may get worse.

    ``baseline`` is a campaign, a file of results, or ``last-green``: the newest earlier campaign of
    the same name in which everything was as expected.
    """

    baseline: str
    worse_by: float


@dataclass(frozen=True, slots=True)
class ReferenceValue:
    """A value of the same quantity from another source, shown for comparison without judging.

    ``name`` is short (``paper``), ``source`` is the reference. ``scenario`` and ``suts`` are as in
    an :class:`Expectation`; ``scenario`` is empty when ``oracle`` names a comparison.
    ``statistic`` is the source's: for a measure or comparison ``value`` [SI unit ``unit``],
    optionally with the standard ``deviation`` of its runs and a range, ``low`` to ``high``;
    for an oracle with a limit the ``rate`` that passed. ``runs`` is their number, ``None`` if the
    source omits it. ``text`` is the value as written, ``where`` file and line.
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
    """Rules of a campaign for its results beyond its oracles."""

    policy: RepeatPolicy = RepeatPolicy()
    comparisons: tuple[ScenarioComparison, ...] = ()
    expectations: tuple[Expectation, ...] = ()
    gate: RegressionGate | None = None
    references: tuple[ReferenceValue, ...] = ()


def state_of(states: Iterable[str]) -> str:
    """Return the common state of several runs: the first of ``MISSING_STATES`` among them, or
    ``done`` when all have a result.
    """
    present = set(states)
    return next((state for state in MISSING_STATES if state in present), "done")


class ExpectationStatus(StrEnum):
    """Relation of a verdict to its expectation; ``open``: the verdict decides nothing (yet)."""

    MET = "met"
    OPEN = "open"
    CONTRADICTED = "contradicted"


@dataclass(frozen=True, slots=True)
class WorstRun:
    """The worst run of a cell and its verdict, with the evidence."""

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
        """The verdict, or the state of the missing runs that could decide it."""
        undecided = self.verdict is Outcome.INCONCLUSIVE
        return self.state if undecided and self.state != "done" else str(self.verdict)

    @property
    def needs_attention(self) -> bool:
        """True if it is contradicted, or open although no more runs will decide it."""
        ended = self.state in _ENDED_STATES
        return self.status is not ExpectationStatus.MET and (
            ended or self.status is ExpectationStatus.CONTRADICTED
        )


@dataclass(frozen=True, slots=True)
class CellVerdict(_ExpectedVerdict):
    """One oracle over all repeats of a scenario with a system under test.

    ``n`` counts all repeats, ``missing`` those without a result. ``low`` and ``high`` are the exact
    95 % interval of the pass rate; an unjudged repeat counts as either. ``at_least`` is the rate
    shown (one-sided 95 %). ``needed`` more repeats, all passing, would show the rate of the policy
    (``None`` without one). ``statement`` is the summary in words. ``verdict`` follows the policy;
    ``status`` compares it with the ``expected`` one (``why``): contradicted only if missing runs
    cannot change that. ``state`` is that of the repeats (:func:`state_of`).
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
    """Group the oracles of a cell whose worst run ended in the same error.

    Each other oracle is a group of its own. Groups keep the order of their first oracle.
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
    """A measured quantity over all repeats of a cell: ``values[i]`` belongs to ``repeats[i]``.

    ``low`` and ``high`` are the 95 % t interval of the mean, ``std`` the sample's standard
    deviation; one value alone has neither. Every run has the measure ``duration`` [s].
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
    """A scenario with a system under test: its oracles, and the worst verdict of them.

    ``state`` is that of its ``runs`` (:func:`state_of`).
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
        """The worst status of its oracles; open without oracles."""
        present = {oracle.status for oracle in self.oracles} or {ExpectationStatus.OPEN}
        return next(status for status in reversed(ExpectationStatus) if status in present)

    @property
    def word(self) -> str:
        """One word for the cell: a failure at once, else the state of unfinished runs."""
        failed = self.verdict is Outcome.FAIL
        return str(self.verdict) if failed or self.state == "done" else self.state

    @property
    def needs_attention(self) -> bool:
        """True if an oracle is not as expected, see :attr:`CellVerdict.needs_attention`."""
        return any(oracle.needs_attention for oracle in self.oracles)


@dataclass(frozen=True, slots=True)
class ComparisonVerdict(_ExpectedVerdict):
    """A comparison with one system under test: ``mean`` of left minus right [``unit``].

    ``low`` and ``high`` are the one-sided 95 % bounds of the mean, which decide the verdict;
    ``interval`` is two-sided. ``method`` is ``paired`` or ``welch`` (no pairs), empty with too few
    values. ``n`` counts the pairs, or the runs of the smaller side. ``left_out`` counts runs
    without a value: they did not end their mission, or have no result. ``note`` is the reason why
    there is no verdict. ``status`` and ``state`` are as in a :class:`CellVerdict`.
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

    ``scenario`` is empty for a comparison. ``value`` [``reference.unit``] is of ``n`` runs or
    pairs, ``deviation`` their standard deviation. ``low`` and ``high`` are the 95 % interval:
    Student's t for a mean, exact for a rate, ``None`` for other statistics or too few values.
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
        """Value here minus the reference [``reference.unit``]."""
        return None if self.value is None else self.value - self.reference.value


@dataclass(frozen=True, slots=True)
class UnexpectedVerdict:
    """An unexpected verdict, with one line of text.

    ``verdict`` is the actual one. ``run`` is empty for comparisons.
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
    executed or judged, 4 undecided runs or statistics.
    """

    cells: tuple[CellAssessment, ...]
    comparisons: tuple[ComparisonVerdict, ...]
    surprises: tuple[UnexpectedVerdict, ...]
    exit_code: int


@dataclass(frozen=True, slots=True)
class Mark:
    """Mark of a verdict: ``letter`` is the sign to show, ``!`` for news, ``reason`` its meaning.

    ``known``: every failure was expected, for the declared ``reason``. Letters of known failures
    may follow the sign of news. Without a kind the verdict has no mark.
    """

    kind: Literal["news", "known", ""] = ""
    letter: str = ""
    reason: str = ""


NO_MARK: Final = Mark()
