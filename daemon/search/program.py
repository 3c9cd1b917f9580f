"""A search from its first proposal to its answer, as plain synchronous code.

Everything in it is a function of the search's files and of what its runs say, in the order of
their numbers: run again from the start it issues the same runs, so whoever executes them may begin
anew after a crash and finds those that are there. Only where wall clock is budgeted does a clock
decide how many points are explored; what was issued by then is gone on with.
"""

from __future__ import annotations

import textwrap
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from daemon.model.proposals import Phase
from daemon.model.search import Point, SearchTask
from daemon.model.search_answer import Confirmation, NearestFailure, PointResult, SearchAnswer
from daemon.model.verdicts import Outcome
from daemon.search.answers.answer import LaterResults, make_answer, told_failure
from daemon.search.answers.findings import FailureKey, failure_key, parameter_influence
from daemon.search.answers.wording import failure_words, quantity
from daemon.search.execution.point_runner import MEDIAN_OF, BegunPoint, PointRunner, RunPurpose
from daemon.search.execution.results import ExploredPoint, confirmation, first_failure
from daemon.search.execution.runs import Case, Runs, SearchStoppedError
from daemon.search.methods import MethodProposal, SearchMethod, make_method
from daemon.search.nearest import (
    NEAREST_POINTS,
    NearestQuestion,
    find_nearest,
    instead,
    larger_changes,
    with_repeats,
)
from daemon.search.shrinking import shrink_failure
from daemon.search.space import SearchSpace
from grammars.text.words import count_noun

__all__ = ["ERRORS_IN_A_ROW", "Case", "Runs", "SearchStoppedError", "run_search"]

ERRORS_IN_A_ROW: Final = 5
"""So many errors one after another end a search: the next one would be another."""
_WIDTH: Final = 98
"""Of a line of a comment."""
_SETTLED_RUNS: Final = 20
_SETTLED_WINDOWS: Final = 3
"""Nothing better and nothing new for so many results, or windows of them if that is more."""


def run_search(case: Case, runs: Runs) -> SearchAnswer:
    """Explore, confirm, bring near and shrink, and return the answer.

    Raises :class:`SearchStoppedError`, with the answer so far, when nothing more is executed.
    """
    search = _SearchProgram(case, runs)
    try:
        return search.run()
    except SearchStoppedError as error:
        error.answer = search.with_found(search.answer("cancelled"))
        raise


@dataclass(frozen=True, slots=True)
class _Issued:
    """A proposal that is out; nothing was begun of a point that makes no run."""

    number: int
    proposal: MethodProposal
    begun: BegunPoint | None


@dataclass(slots=True)
class _StopRules:
    """What has to be known to say when a search is over."""

    task: SearchTask
    failures: int = 0
    errors: int = 0
    quiet: int = 0
    _best: float = float("inf")
    _seen: set[FailureKey] = field(default_factory=set)

    def learn(self, result: PointResult | None) -> bool:
        """Take in a result, and return whether it is a better or a new one."""
        self.quiet += 1
        # A point that makes no run is none of the errors: nothing has gone wrong.
        if result is None:
            return False
        self.errors = self.errors + 1 if result.outcome is Outcome.ERROR else 0
        news = result.value is not None and result.value.value < self._best
        if news and result.value is not None:
            self._best = result.value.value
        if result.fails:
            self.failures += 1
            news = news or failure_key(result) not in self._seen
            self._seen.add(failure_key(result))
        if news:
            self.quiet = 0
        return news

    def ended(self) -> str:
        """Return why nothing else is to be proposed; empty while there is no reason."""
        task = self.task
        if self.errors >= ERRORS_IN_A_ROW:
            return "errors"
        if task.stop == "failures" and self.failures >= task.failures:
            return "failures"
        long = max(_SETTLED_RUNS, _SETTLED_WINDOWS * task.window)
        return "settled" if task.stop == "settled" and self.quiet >= long else ""


@dataclass(slots=True)
class _SearchProgram:
    """A search while it lasts."""

    case: Case
    runs: Runs
    explored: list[ExploredPoint] = field(default_factory=list)
    later: LaterResults = field(default_factory=LaterResults)
    space: SearchSpace = field(init=False)
    points: PointRunner = field(init=False)
    _confirmed: dict[int, Confirmation | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.space = SearchSpace(self.case.task)
        self.points = PointRunner(self.case, self.runs, self.space.allowed)

    @property
    def task(self) -> SearchTask:
        """What is searched."""
        return self.case.task

    def answer(self, ended: str = "") -> SearchAnswer:
        """Return what was found so far."""
        return make_answer(
            self.task,
            self.explored,
            ended=ended,
            executed=self.points.executed,
            reused=self.points.reused,
            later=self.later,
            holding=self._holding(),
        )

    def _failures(self) -> list[PointResult]:
        return [r for p in self.explored if (r := p.result) is not None and r.fails]

    def _holding(self) -> list[bool]:
        """Return of the explored failures whose repeats tell whether they hold."""
        if not self.task.repeatable:
            return []
        known = [self.points.holds(failure) for failure in self._failures()]
        return [holds for holds in known if holds is not None]

    def run(self) -> SearchAnswer:
        """Go through all phases."""
        ended = self._explore(make_method(self.task, self.space))
        failures = self._failures()
        first = first_failure(failures)
        if first is not None:
            self.later = LaterResults(self._confirm(first))
            if "nearest" in self.task.then:
                self._bring_near(failures)
            told = told_failure(self.answer())
            if "shrink" in self.task.then and told is not None:
                self._report("shrink", f"shrinking run {told.number}")
                self.later = replace(self.later, shrunk=shrink_failure(self.points, told))
        return self.with_found(self.answer(ended))

    def _explore(self, method: SearchMethod) -> str:
        """Issue proposals in a window, learn from them in order, and return why it ended."""
        rules, out, number = _StopRules(self.task), deque[_Issued](), 0
        ended = ""
        while not ended:
            # Proposal n is made knowing the results up to n - window, whatever else is there.
            if len(out) == self.task.window:
                self._learn(out.popleft(), method, rules)
            ended = rules.ended() or self._spent(number)
            if ended:
                break
            proposal = method.propose(number)
            if proposal is None:
                ended = "exhausted"
                break
            purpose = RunPurpose("explore", proposal.method, proposal.guided)
            begun = self.points.begin(proposal.values, purpose)
            out.append(_Issued(number, proposal, begun))
            number += 1
        while out:
            self._learn(out.popleft(), method, rules)
        return ended

    def _spent(self, number: int) -> str:
        # Where runs differ a point takes several, which the budget counts.
        if number * self.points.repeats >= self.task.runs:
            return "budget"
        if self.task.seconds <= 0.0 or self.runs.elapsed() < self.task.seconds:
            return ""
        # What was issued before a crash is gone on with, else its results would be lost.
        issued = self.runs.issued(self.points.position)
        return "" if issued is not None and issued.phase == "explore" else "time"

    def _learn(self, issued: _Issued, method: SearchMethod, rules: _StopRules) -> None:
        result = None if issued.begun is None else self.points.finish(issued.begun)
        value = None if result is None or result.value is None else result.value.value
        proposal, number = issued.proposal, issued.number
        method.learn(number, proposal.values, value)
        self.explored.append(
            ExploredPoint(number, proposal.values, proposal.method, proposal.guided, result)
        )
        # Not after every run: an answer so far is large, and most change nothing.
        if rules.learn(result) or number % self.task.window == 0:
            answer = self.answer()
            self.runs.report("explore", self._progress_note(answer), answer)

    def _progress_note(self, answer: SearchAnswer) -> str:
        told = f"{answer.explored} of {count_noun(self.task.runs, 'run')}"
        if answer.failed:
            told += f", {count_noun(answer.failed, 'failure')}"
        value = None if answer.best is None else answer.best.value
        return f"{told}, best {quantity(value.margin, value.unit)}" if value is not None else told

    def _confirm(self, failure: PointResult, least: int = 0) -> Confirmation | None:
        """Run a failure again with other noise, ``least`` times at least, unless that was done."""
        number, count = failure.number, max(self.task.confirm, least)
        if not self.task.repeatable:
            count = max(count, MEDIAN_OF)
        if count and number not in self._confirmed:
            times = count_noun(count, "time")
            self._report("confirm", f"run {number} again, {times} with other noise")
            self._confirmed[number] = confirmation(self.points.repeat(failure, count))
        return self._confirmed.get(number)

    def _bring_near(self, failures: Sequence[PointResult]) -> None:
        influence = parameter_influence(self.task, self.explored)
        question = NearestQuestion(
            self.task,
            failures,
            {one.parameter: one.correlation for one in influence},
        )
        self._report("nearest", f"at most {NEAREST_POINTS} points for the smallest change")
        found = find_nearest(question, _NearestProber(self.points, self.points.position))
        if found is None:
            return
        self.later = replace(self.later, nearest=found)
        # Where one noise decided it is not known yet what the others say of this very point.
        repeats = self._confirm(found.result, 0 if found.holds else self.points.others)
        holds = self.points.holds(found.result) is not False and not _is_doubtful(repeats)
        found = with_repeats(self.task, found, repeats, holds=holds)
        self.later = replace(self.later, nearest=found)
        if _is_doubtful(repeats) and found.changes:
            self._look_further(found)

    def _look_further(self, found: NearestFailure) -> None:
        """Take a larger change that noise confirms instead of one that fails by chance."""
        for larger in larger_changes(self.task, found, self.points.failures()):
            repeats = self._confirm(larger)
            if repeats is not None and not _is_doubtful(repeats):
                found = instead(self.task, found, larger, repeats)
                self.later = replace(self.later, nearest=found)
                return

    def with_found(self, answer: SearchAnswer) -> SearchAnswer:
        """Return an answer with the campaign file of its failure, if it has one."""
        failure = told_failure(answer)
        if failure is None:
            return answer
        # The nearest failure's own words, where it was looked for.
        about = answer.nearest.sentence if answer.nearest is not None else failure_words(failure)
        words = f"Found by the search {self.task.name}: {about}."
        comment = "\n".join(textwrap.wrap(words, _WIDTH, break_long_words=False))
        text = self.case.found_text(failure, comment=comment, why=about)
        return replace(answer, found=text, found_label=failure.label, found_digest=failure.digest)

    def _report(self, phase: Phase, note: str) -> None:
        self.runs.report(phase, note, self.answer())


def _is_doubtful(confirmed: Confirmation | None) -> bool:
    return confirmed is not None and not confirmed.holds


@dataclass(frozen=True, slots=True)
class _NearestProber:
    """Runs the points that the way to the nearest failure leads over."""

    points: PointRunner
    before: int

    @property
    def runs(self) -> int:
        """How many runs were made."""
        return self.points.position - self.before

    def is_known(self, point: Point, *, one_noise: bool) -> bool:
        """Return whether nothing is run to find out about a point."""
        if one_noise or not self.points.is_known(point):
            return self.points.is_known(point)
        result = self.points.known(point)
        return result is None or self.points.holds(result) is not None

    def results(
        self, tried: Sequence[tuple[Point, str]], *, one_noise: bool
    ) -> list[PointResult | None]:
        """Return what points say."""
        purposes = [(point, RunPurpose("nearest", "nearest", note=note)) for point, note in tried]
        found = self.points.results(purposes)
        return found if one_noise else self.points.with_most_noises(found)
