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

from daemon.model.proposals import Phase, Proposal
from daemon.model.search import SearchTask
from daemon.model.search_answer import (
    Confirmation,
    NearestFailure,
    SearchAnswer,
    ShrunkScenario,
)
from daemon.model.trials import Trial, first_failure
from daemon.model.verdicts import Outcome
from daemon.search.answers.facts import (
    FailureKey,
    confirmation,
    failure_key,
    make_answer,
    parameter_influence,
)
from daemon.search.answers.sentences import headline_of, margin_words
from daemon.search.execution.daemon_runs import DaemonRuns, SearchStoppedError
from daemon.search.execution.point_runner import MEDIAN_OF, PointRunner
from daemon.search.methods import SearchMethod
from daemon.search.nearest import NEAREST_POINTS, find_nearest
from daemon.search.preparation.composition import SearchCase
from daemon.search.shrinking import shrink_failure
from daemon.search.space import SearchSpace
from grammars.text.words import count_noun

ERRORS_IN_A_ROW: Final = 5
"""So many errors one after another end a search: the next one would be another."""
_WIDTH: Final = 98
"""Of a line of a comment."""
_SETTLED_RUNS: Final = 20
_SETTLED_WINDOWS: Final = 3
"""Nothing better and nothing new for so many results, or windows of them if that is more."""


def run_search(case: SearchCase, runs: DaemonRuns) -> SearchAnswer:
    """Explore, confirm, bring near and shrink, and return the answer.

    Raises :class:`SearchStoppedError`, with the answer so far, when nothing more is executed.
    """
    search = _SearchProgram(case, runs)
    try:
        return search.run()
    except SearchStoppedError as error:
        error.answer = search.with_found(search.answer())
        raise


@dataclass(slots=True)
class _StopRules:
    """What has to be known to say when a search is over."""

    task: SearchTask
    failures: int = 0
    errors: int = 0
    quiet: int = 0
    _best: float = float("inf")
    _seen: set[FailureKey] = field(default_factory=set)

    def learn(self, trial: Trial) -> bool:
        """Take in a trial, and return whether it is a better or a new one."""
        self.quiet += 1
        # A point that makes no run is none of the errors: nothing has gone wrong.
        if trial.outcome is None:
            return False
        self.errors = self.errors + 1 if trial.outcome is Outcome.ERROR else 0
        news = trial.compared < self._best
        if news:
            self._best = trial.compared
        if trial.fails:
            self.failures += 1
            news = news or failure_key(trial) not in self._seen
            self._seen.add(failure_key(trial))
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

    case: SearchCase
    runs: DaemonRuns
    explored: list[Trial] = field(default_factory=list)
    confirmed: Confirmation | None = None
    nearest: NearestFailure | None = None
    shrunk: ShrunkScenario | None = None
    space: SearchSpace = field(init=False)
    points: PointRunner = field(init=False)
    _repeated: dict[int, Confirmation | None] = field(default_factory=dict)

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
            confirmed=self.confirmed,
            nearest=self.nearest,
            shrunk=self.shrunk,
            holding=self._holding(),
        )

    def _failures(self) -> list[Trial]:
        return [trial for trial in self.explored if trial.fails]

    def _holding(self) -> list[bool]:
        """Return of the explored failures whose repeats tell whether they hold."""
        if not self.task.repeatable:
            return []
        known = [self.points.holds(failure) for failure in self._failures()]
        return [holds for holds in known if holds is not None]

    def run(self) -> SearchAnswer:
        """Go through all phases."""
        ended = self._explore(SearchMethod(self.task, self.space))
        failures = self._failures()
        first = first_failure(failures)
        if first is not None:
            self.confirmed = self._confirm(first)
            if "nearest" in self.task.then:
                self._bring_near(failures)
            told = self.answer().told_failure
            if "shrink" in self.task.then and told is not None:
                self._report("shrink", f"shrinking run {told.number}")
                self.shrunk = shrink_failure(self.points, told)
        return self.with_found(self.answer(ended))

    def _explore(self, method: SearchMethod) -> str:
        """Issue proposals in a window, learn from them in order, and return why it ended."""
        rules, out, number = _StopRules(self.task), deque[Proposal](), 0
        ended = ""
        while not ended:
            # Proposal n is made knowing the results up to n - window, whatever else is there.
            if len(out) == self.task.window:
                self._learn(out.popleft(), method, rules)
            ended = rules.ended() or self._spent(number)
            if ended:
                break
            proposal = method.propose()
            if proposal is None:
                ended = "exhausted"
                break
            begun = self.points.begin(
                proposal.values, "explore", proposal.method, guided=proposal.guided
            )
            out.append(begun)
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

    def _learn(self, begun: Proposal, method: SearchMethod, rules: _StopRules) -> None:
        trial = self.points.finish(begun)
        value = None if trial.value is None else trial.value.value
        method.learn(value)
        self.explored.append(trial)
        # Not after every run: an answer so far is large, and most change nothing.
        if rules.learn(trial) or trial.number % self.task.window == 0:
            answer = self.answer()
            self.runs.report("explore", self._progress_note(answer), answer)

    def _progress_note(self, answer: SearchAnswer) -> str:
        told = f"{answer.explored} of {count_noun(self.task.runs, 'run')}"
        if answer.failed:
            told += f", {count_noun(answer.failed, 'failure')}"
        return f"{told}, best {margin_words(answer.best)}" if answer.best is not None else told

    def _confirm(self, failure: Trial, least: int = 0) -> Confirmation | None:
        """Run a failure again with other noise, ``least`` times at least, unless that was done."""
        number, count = failure.number, max(self.task.confirm, least)
        if not self.task.repeatable:
            count = max(count, MEDIAN_OF)
        if count and number not in self._repeated:
            times = count_noun(count, "time")
            self._report("confirm", f"run {number} again, {times} with other noise")
            self._repeated[number] = confirmation(self.points.repeat(failure, count))
        return self._repeated.get(number)

    def _bring_near(self, failures: Sequence[Trial]) -> None:
        influence = parameter_influence(self.task, self.explored)
        self._report("nearest", f"at most {NEAREST_POINTS} points for the smallest change")
        nearest = find_nearest(
            self.points, failures, {one.parameter: one.correlation for one in influence}
        )
        if nearest is None:
            return
        self.nearest = nearest
        # Where one noise decided it is not known yet what the others say of this very point.
        repeats = self._confirm(nearest.result, 0 if nearest.holds else self.points.others)
        holds = self.points.holds(nearest.result) is not False
        self.nearest = replace(nearest, confirmed=repeats, holds=holds)

    def with_found(self, answer: SearchAnswer) -> SearchAnswer:
        """Return an answer with the campaign file of its failure, if it has one."""
        failure = answer.told_failure
        if failure is None:
            return answer
        about = headline_of(self.task, answer)
        words = f"Found by the search {self.task.name}: {about}."
        comment = "\n".join(textwrap.wrap(words, _WIDTH, break_long_words=False))
        text = self.case.found_text(failure, comment=comment, why=about)
        return replace(answer, found=text)

    def _report(self, phase: Phase, note: str) -> None:
        self.runs.report(phase, note, self.answer())
