"""Which parts of its space a search has run, parameter by parameter."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from daemon.model.proposals import ProposalRow
from daemon.model.search import PointValue, SearchParameter
from daemon.model.search_answer import SearchRow
from daemon.search.execution.results import point_result
from daemon.search.points import position_in_range, range_text

PARTS: Final = 10
"""Equal parts into which a range is divided; with ``log`` their ratios are equal."""


@dataclass(frozen=True, slots=True)
class ExercisedParameter:
    """A parameter and how many points lie in each part of its range, or have each of its choices.

    ``failed`` are those among ``counts`` that fail; ``range`` is as written. Values outside of the
    range, as the written one may be, are in no part.
    """

    parameter: str
    range: str
    counts: tuple[int, ...]
    failed: tuple[int, ...]

    @property
    def met(self) -> int:
        """In how many parts there is a point."""
        return sum(count > 0 for count in self.counts)


@dataclass(frozen=True, slots=True)
class ExercisedSpace:
    """What the search ``campaign``, called ``name`` in its file, has run of a scenario.

    ``points`` are different values, however often they were repeated.
    """

    campaign: str
    name: str
    scenario: str
    points: int
    failed: int
    parameters: tuple[ExercisedParameter, ...]


def exercised_space(row: SearchRow, proposals: Iterable[ProposalRow]) -> ExercisedSpace:
    """Return what the settled runs of a search have tried while it explored; repeats are one."""
    task = row.task
    points: dict[tuple[PointValue, ...], bool] = {}
    for one in proposals:
        # Those on the way to the nearest failure lie on lines to the written values, and most of
        # their parameters have these: they would hide what was looked at.
        if one.settled and one.proposal.phase == "explore":
            values = one.proposal.values
            points[values] = points.get(values, False) or point_result(task, one).fails
    return ExercisedSpace(
        row.campaign,
        task.name,
        task.scenario,
        len(points),
        sum(points.values()),
        tuple(
            _exercised(parameter, [(values[i], fails) for values, fails in points.items()])
            for i, parameter in enumerate(task.parameters)
        ),
    )


def _exercised(
    parameter: SearchParameter, points: list[tuple[PointValue, bool]]
) -> ExercisedParameter:
    parts = len(parameter.choices) or PARTS
    counts, failed = [0] * parts, [0] * parts
    for value, fails in points:
        part = _part(parameter, value, parts)
        if part is not None:
            counts[part] += 1
            failed[part] += fails
    return ExercisedParameter(parameter.name, range_text(parameter), tuple(counts), tuple(failed))


def _part(parameter: SearchParameter, value: PointValue, parts: int) -> int | None:
    if parameter.choices:
        return parameter.choices.index(value) if value in parameter.choices else None
    at = position_in_range(parameter, value)
    if math.isnan(at) or not 0.0 <= at <= 1.0:
        return None
    # Steps often end where parts do: rounding does not decide to which of them they belong.
    return min(int(at * parts + 1e-9), parts - 1)
