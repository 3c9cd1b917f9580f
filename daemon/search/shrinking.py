"""The smallest scenario that still fails, by the delta debugging of ``scenario blame``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from daemon.analysis.blame import (
    Blame,
    BudgetSpentError,
    Candidate,
    CandidateResult,
    CandidateRunner,
    NoFailureError,
    RunCase,
    explain_failure,
    judge_verdict,
    story_lines,
    unresolved_candidate,
)
from daemon.model.search import Proposal
from daemon.model.search_answer import ShrunkScenario
from daemon.model.trials import Trial
from daemon.model.verdicts import RunState
from daemon.search.point_runner import PointRunner
from grammars.text.words import count_noun, enumerate_words

SHRINK_RUNS: Final = 100
"""Most runs to shrink a failure."""
_NAMED: Final = 3
"""Most things of a kind that are named; more are counted."""


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

    def __call__(self, candidates: Sequence[Candidate]) -> list[tuple[CandidateResult, ...]]:
        # Issue all before waiting for the first, so that they run at the same time.
        positions = [self._position(candidate) for candidate in candidates]
        return list(map(self._endings, candidates, positions))

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

    def _endings(self, candidate: Candidate, position: int) -> tuple[CandidateResult, ...]:
        row = self.points.wait(position)
        if row.state is not RunState.DONE or len(row.verdicts) != len(candidate.spec.oracles):
            return unresolved_candidate(candidate, row.note or "it left no result")
        return tuple(judge_verdict(verdict, row.ended) for verdict in row.verdicts)


def missing_words(whole: Candidate, part: Candidate) -> str:
    """Return the missing parts of a candidate: ``without bedroom_door, waypoint home``."""
    remaining = _part_names(part)
    missing = [name for name in _part_names(whole) if name not in remaining]
    more = f" and {len(missing) - _NAMED} more" if len(missing) > _NAMED else ""
    return f"without {', '.join(missing[:_NAMED])}{more}" if missing else "with fewer values"


def _part_names(candidate: Candidate) -> list[str]:
    spec = candidate.spec
    names = [
        *(one.name for one in candidate.scene.objects),
        *(f"waypoint {one.id}" for one in spec.mission.waypoints),
        *(f"behaviour {one.joint}" for one in spec.behaviours),
    ]
    return list(dict.fromkeys(names))
