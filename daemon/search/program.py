"""A search from its first proposal to its answer, as plain synchronous code.

It depends only on the search's files and on the results of its runs, in the order of their numbers.
A second execution issues the same runs, and after a crash it finds the existing ones. Only with a
budget of wall clock time does a clock decide how many points are explored; runs issued before a
crash are continued.
"""

from __future__ import annotations

import textwrap
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from daemon.analysis.blame import (
    Blame,
    BudgetSpentError,
    Candidate,
    CandidateRunner,
    NoFailureError,
    RunCase,
    candidate_verdicts,
    explain_failure,
    story_lines,
)
from daemon.model.search import Phase, Proposal, SearchTask
from daemon.model.search_answer import Confirmation, NearestFailure, SearchAnswer, ShrunkScenario
from daemon.model.trials import Trial, first_failure
from daemon.model.verdicts import Outcome, RunState, Verdict
from daemon.search.answers.facts import (
    FailureKey,
    confirmation,
    failure_key,
    make_answer,
    parameter_influence,
)
from daemon.search.answers.sentences import headline_of, margin_words
from daemon.search.client import DaemonRuns, SearchStoppedError
from daemon.search.composition import SearchCase
from daemon.search.methods import SearchMethod
from daemon.search.nearest import NEAREST_POINTS, find_nearest
from daemon.search.point_runner import MEDIAN_OF, PointRunner
from daemon.search.space import SearchSpace
from grammars.text.words import count_noun, enumerate_words, first_words

ERRORS_IN_A_ROW: Final = 5
"""Errors in a row that end a search: the next run would be one too."""
_WIDTH: Final = 98
"""Characters of a line of a comment."""
_SETTLED_RUNS: Final = 20
_SETTLED_WINDOWS: Final = 3
"""Results, or windows of them if that is more, without a better margin or a new failure."""
SHRINK_RUNS: Final = 100
"""Most runs to shrink a failure."""
_NAMED: Final = 3
"""Most things of a kind that are named; more are counted."""


def run_search(case: SearchCase, runs: DaemonRuns) -> SearchAnswer:
    """Explore, confirm, bring near and shrink, and return the answer.

    Raises :class:`SearchStoppedError`, with the answer so far, if no more runs are executed.
    """
    search = _SearchProgram(case, runs)
    try:
        return search.run()
    except SearchStoppedError as error:
        error.answer = search.with_found(search.answer())
        raise


@dataclass(slots=True)
class _StopRules:
    """Counters that decide when a search is over."""

    task: SearchTask
    failures: int = 0
    errors: int = 0
    quiet: int = 0
    _best: float = float("inf")
    _kinds: set[FailureKey] = field(default_factory=set)

    def learn(self, trial: Trial) -> bool:
        """Count a trial, and return whether it is a better or a new one."""
        self.quiet += 1
        # A point without a run is not an error.
        if trial.outcome is None:
            return False
        self.errors = self.errors + 1 if trial.outcome is Outcome.ERROR else 0
        news = trial.compared < self._best
        if news:
            self._best = trial.compared
        if trial.fails:
            self.failures += 1
            news = news or failure_key(trial) not in self._kinds
            self._kinds.add(failure_key(trial))
        if news:
            self.quiet = 0
        return news

    def ended(self) -> str:
        """Return the reason to stop, empty if there is none."""
        stop, long = self.task.stop, max(_SETTLED_RUNS, _SETTLED_WINDOWS * self.task.window)
        if self.errors >= ERRORS_IN_A_ROW:
            return "errors"
        if stop == "failures" and self.failures >= self.task.failures:
            return "failures"
        return "settled" if stop == "settled" and self.quiet >= long else ""


@dataclass(slots=True)
class _SearchProgram:
    """A search in progress."""

    case: SearchCase
    runs: DaemonRuns
    explored: list[Trial] = field(default_factory=list)
    confirmed: Confirmation | None = None
    nearest: NearestFailure | None = None
    shrunk: ShrunkScenario | None = None
    space: SearchSpace = field(init=False)
    points: PointRunner = field(init=False)

    def __post_init__(self) -> None:
        self.space = SearchSpace(self.case.task)
        self.points = PointRunner(self.case, self.runs, self.space.allowed)

    @property
    def task(self) -> SearchTask:
        """The task of the search."""
        return self.case.task

    def answer(self, ended: str = "") -> SearchAnswer:
        """Return the answer so far."""
        # If runs differ, every point is a median of several, and needs no repeats.
        failures = self._failures() if self.task.repeatable else []
        answers = [self.points.holds(failure) for failure in failures]
        return make_answer(
            self.task,
            self.explored,
            ended=ended,
            executed=self.points.executed,
            reused=self.points.reused,
            confirmed=self.confirmed,
            nearest=self.nearest,
            shrunk=self.shrunk,
            holding=[holds for holds in answers if holds is not None],
        )

    def run(self) -> SearchAnswer:
        """Go through all phases."""
        ended = self._explore(SearchMethod(self.task, self.space))
        first = first_failure(self.explored)
        if first is not None:
            self.confirmed = self._confirm(first)
            if "nearest" in self.task.then:
                self._bring_near()
            if "shrink" in self.task.then:
                failure = first if self.nearest is None else self.nearest.result
                self._report("shrink", f"shrinking run {failure.number}")
                self.shrunk = shrink_failure(self.points, failure)
        return self.with_found(self.answer(ended))

    def _failures(self) -> list[Trial]:
        return [trial for trial in self.explored if trial.fails]

    def _explore(self, method: SearchMethod) -> str:
        """Issue proposals in a window, learn from them in order, and return the reason to stop."""
        rules, out = _StopRules(self.task), deque[Proposal]()
        while not (ended := rules.ended() or self._spent()):
            proposal = method.propose()
            if proposal is None:
                ended = "exhausted"
                break
            out.append(
                self.points.begin(
                    proposal.values, "explore", proposal.method, guided=proposal.guided
                )
            )
            # Proposal n depends on the results up to n - window, even if there are more.
            if len(out) == self.task.window:
                self._learn(out.popleft(), method, rules)
        while out:
            self._learn(out.popleft(), method, rules)
        return ended

    def _spent(self) -> str:
        # If runs differ, a point takes several runs, which all count.
        if self.points.number * self.points.repeats >= self.task.runs:
            return "budget"
        if self.task.seconds <= 0.0 or self.runs.elapsed() < self.task.seconds:
            return ""
        # Runs issued before a crash are continued, otherwise their results would be lost.
        issued = self.runs.issued(self.points.position)
        return "" if issued is not None and issued.phase == "explore" else "time"

    def _learn(self, proposal: Proposal, method: SearchMethod, rules: _StopRules) -> None:
        trial = self.points.finish(proposal)
        method.learn(None if trial.value is None else trial.value.value)
        self.explored.append(trial)
        # Not after every run: the answer so far is large, and most runs change nothing.
        if rules.learn(trial) or trial.number % self.task.window == 0:
            answer = self.answer()
            self.runs.report("explore", self._progress_note(answer), answer)

    def _progress_note(self, answer: SearchAnswer) -> str:
        note = f"{answer.explored} of {count_noun(self.task.runs, 'run')}"
        if answer.failed:
            note += f", {count_noun(answer.failed, 'failure')}"
        return f"{note}, best {margin_words(answer.best)}" if answer.best is not None else note

    def _confirm(self, failure: Trial) -> Confirmation | None:
        """Run a failure again with other noise, and reuse earlier repeats."""
        count = self.task.confirm if self.task.repeatable else max(self.task.confirm, MEDIAN_OF)
        if not count:
            return None
        times = count_noun(count, "time")
        self._report("confirm", f"run {failure.number} again, {times} with other noise")
        return confirmation(self.points.repeat(failure, count))

    def _bring_near(self) -> None:
        influence = parameter_influence(self.task, self.explored)
        self._report("nearest", f"at most {NEAREST_POINTS} points for the smallest change")
        self.nearest = find_nearest(
            self.points, self._failures(), {one.parameter: one.correlation for one in influence}
        )
        if self.nearest is not None:
            self.nearest = replace(self.nearest, confirmed=self._confirm(self.nearest.result))

    def with_found(self, answer: SearchAnswer) -> SearchAnswer:
        """Return an answer with the campaign file of its failure, if it has one."""
        failure = answer.reported_failure
        if failure is None:
            return answer
        about = headline_of(self.task, answer)
        words = f"Found by the search {self.task.name}: {about}."
        comment = "\n".join(textwrap.wrap(words, _WIDTH, break_on_hyphens=False))
        text = self.case.found_text(failure, comment=comment, why=about)
        return replace(answer, found=text)

    def _report(self, phase: Phase, note: str) -> None:
        self.runs.report(phase, note, self.answer())


def shrink_failure(points: PointRunner, failure: Trial) -> ShrunkScenario:
    """Return the smallest scenario that still fails; its candidates are runs of the search."""
    oracle = "" if failure.verdict is None else failure.verdict.oracle
    case = points.case.run_case(failure.point, failure.number)
    executor = _SearchExecutor(points, failure, case)
    runner = CandidateRunner(SHRINK_RUNS, executor=executor)
    try:
        result = explain_failure(case, runner, oracle)
    except (NoFailureError, BudgetSpentError) as error:
        # For example, a system that is not repeatable passes this time.
        return ShrunkScenario((f"nothing to shrink: {error}",), minimal=False, runs=executor.issued)
    story, words = story_lines(result.story, case.settings.like), remaining_words(result.story)
    return ShrunkScenario(story, result.story.minimal, executor.issued, words)


def remaining_words(story: Blame) -> str:
    """Return ``1 of 3 objects (kitchen_door), 1 of 4 waypoints (home) and … are left``."""
    before = dict(story.before)
    parts = [
        _some(story.objects, before["object"], "object"),
        _some(story.waypoints, before["waypoint"], "waypoint"),
        _some(story.behaviours, before["behaviour"], "behaviour"),
    ]
    return f"{enumerate_words(parts)} {'are' if story.minimal else 'are so far'} left"


def _some(names: Sequence[str], whole: int, noun: str) -> str:
    """Return ``2 of 3 objects (kitchen_door, living_room_door)``."""
    more = ["…"] if len(names) > _NAMED else []
    in_brackets = f" ({', '.join([*names[:_NAMED], *more])})" if names else ""
    return f"{len(names)} of {count_noun(whole, noun)}{in_brackets}"


@dataclass(slots=True)
class _SearchExecutor:
    """Executes candidates as runs of the search; ``issued`` counts them."""

    points: PointRunner
    failure: Trial
    case: RunCase
    issued: int = 0

    def __call__(self, candidates: Sequence[Candidate]) -> list[tuple[Verdict, ...]]:
        # Issue all before waiting for the first, so that they run at the same time.
        positions = [self._position(candidate) for candidate in candidates]
        return list(map(self._verdicts, candidates, positions))

    def _position(self, candidate: Candidate) -> int:
        if candidate.spec.digest == self.failure.digest:
            return self.failure.proposal.position
        points = self.points
        number = points.number
        points.number += 1
        self.issued += 1
        # Its own name distinguishes it in tables and traces of the search.
        name = points.case.task.scenario_of(number)
        spec = replace(candidate.spec, scenario=name, repeat=0)
        note = missing_words(Candidate(self.case.spec, self.case.cell.scene), candidate)
        proposal = Proposal(
            points.position, number, 0, "shrink", "shrink", True, self.failure.point, note
        )
        return points.issue(proposal, Candidate(spec, candidate.scene))

    def _verdicts(self, candidate: Candidate, position: int) -> tuple[Verdict, ...]:
        row = self.points.wait(position)
        verdicts = row.verdicts if row.state is RunState.DONE else ()
        return candidate_verdicts(candidate, verdicts, row.ended, row.note or "it left no result")


def missing_words(whole: Candidate, part: Candidate) -> str:
    """Return the missing parts of a candidate: ``without bedroom_door, waypoint home``."""
    remaining = _part_names(part)
    missing = [name for name in _part_names(whole) if name not in remaining]
    return f"without {first_words(missing, _NAMED)}" if missing else "with fewer values"


def _part_names(candidate: Candidate) -> list[str]:
    spec = candidate.spec
    names = [
        *(one.name for one in candidate.scene.objects),
        *(f"waypoint {one.id}" for one in spec.mission.waypoints),
        *(f"behaviour {one.joint}" for one in spec.behaviours),
    ]
    return list(dict.fromkeys(names))
