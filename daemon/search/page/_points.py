"""The runs of a search as they are drawn and listed: one a point, in the order of proposals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from daemon.model.proposals import Phase, ProposalRow
from daemon.model.search import PointValue, SearchParameter, SearchTask
from daemon.model.search_answer import PointResult
from daemon.search.execution.results import median_result, point_result


@dataclass(frozen=True, slots=True)
class DrawnPoint:
    """A point that was run, and how it was chosen."""

    number: int
    method: str
    guided: bool
    result: PointResult

    @property
    def value(self) -> float:
        """What the search compares; not a number for a run without a margin."""
        found = self.result.value
        return math.nan if found is None else found.value


def drawn_points(
    task: SearchTask, rows: Iterable[ProposalRow], phase: Phase = "explore"
) -> tuple[DrawnPoint, ...]:
    """Return the settled points of a phase; of one that was repeated the median counts."""
    groups: dict[int, list[ProposalRow]] = {}
    for row in rows:
        if row.proposal.phase == phase and row.run.settled:
            groups.setdefault(row.proposal.number, []).append(row)
    return tuple(
        DrawnPoint(
            number,
            found[0].proposal.method,
            found[0].proposal.guided,
            median_result([point_result(task, row) for row in found]),
        )
        for number, found in sorted(groups.items())
    )


def smallest_so_far(points: Sequence[DrawnPoint]) -> list[float]:
    """Return the smallest value after each point; not a number before the first that has one."""
    found: list[float] = []
    for point in points:
        before = found[-1] if found else math.nan
        found.append(before if math.isnan(point.value) else min(point.value, before))
        if math.isnan(found[-1]):
            found[-1] = point.value
    return found


def margin_title(task: SearchTask) -> str:
    """Return what the values of a search are, with their unit."""
    if len(task.scales) > 1:
        return "smallest margin, as a share of its scale"
    unit = task.scales[0].unit if task.scales else ""
    return f"margin of {task.minimise} [{unit}]" if unit not in ("", "1") else task.minimise


def coordinate(parameter: SearchParameter, value: PointValue | None) -> float:
    """Return a value as it stands beside an axis: a number, or the place of a choice."""
    if parameter.choices:
        return float(parameter.choices.index(value)) if value in parameter.choices else math.nan
    return float(value) if isinstance(value, float | int) else math.nan


def axis_title(name: str, parameter: SearchParameter) -> str:
    """Return a name with the unit of its values."""
    return f"{name} [{parameter.unit}]" if parameter.unit else name
