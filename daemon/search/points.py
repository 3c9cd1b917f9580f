"""Distances of points from the scenario as written, and the points in between."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Final

from daemon.model.search import Point, PointValue, SearchParameter, SearchTask

_STEPS: Final = 1000
"""Number of steps of a range without a step."""
_SAME: Final = 1e-9
"""Values that differ by less than this share are equal: 0.1 + 0.2 is 0.3."""


def is_as_written(parameter: SearchParameter, value: PointValue) -> bool:
    """Return whether the scenario has this value; false for a parameter without a written value."""
    origin = parameter.written
    if origin is None or isinstance(origin, str) or isinstance(value, str):
        return origin == value
    return math.isclose(value, origin, rel_tol=_SAME, abs_tol=1e-12)


def written_point(task: SearchTask) -> Point | None:
    """Return the scenario as written; ``None`` if a parameter has no written value."""
    values = tuple(p.written for p in task.parameters if p.written is not None)
    return values if len(values) == len(task.parameters) else None


def changed_parameters(task: SearchTask, point: Point) -> tuple[int, ...]:
    """Return the indices of the changed parameters, without those that have no written value."""
    pairs = enumerate(zip(task.parameters, point, strict=True))
    return tuple(i for i, (p, v) in pairs if p.written is not None and not is_as_written(p, v))


def change_size(parameter: SearchParameter, value: PointValue) -> float:
    """Return the distance of a value from the written one, as a share of the range or 1."""
    if parameter.written is None or is_as_written(parameter, value):
        return 0.0
    if parameter.choices:
        return 1.0
    places = position_in_range(parameter, value), position_in_range(parameter, parameter.written)
    size = abs(places[0] - places[1])
    return size if math.isfinite(size) else 1.0


def distance_from_written(task: SearchTask, point: Point) -> float:
    """Return the sum of all changes, each as a share of its range."""
    return math.fsum(map(change_size, task.parameters, point))


def taken_back(task: SearchTask, point: Point, indices: Collection[int]) -> Point:
    """Return a point with the parameters at ``indices`` as written."""
    return tuple(
        value if i not in indices or p.written is None else p.written
        for i, (p, value) in enumerate(zip(task.parameters, point, strict=True))
    )


def with_value(point: Point, index: int, value: PointValue) -> Point:
    """Return a point with another value of one parameter."""
    return (*point[:index], value, *point[index + 1 :])


def value_between(
    parameter: SearchParameter, one: PointValue, other: PointValue
) -> PointValue | None:
    """Return a value in the middle, a multiple of the step; ``None`` between neighbours."""
    step = parameter.step or (parameter.high - parameter.low) / _STEPS
    if parameter.choices or isinstance(one, str) or isinstance(other, str) or step <= 0.0:
        return None
    is_log = parameter.log and min(one, other) > 0.0
    middle = math.sqrt(one * other) if is_log else 0.5 * (one + other)
    value = float(f"{round(middle / step) * step:.10g}")
    inside = min(one, other) < value < max(one, other)
    apart = min(abs(value - one), abs(value - other)) > _SAME * abs(value)
    return value if inside and apart else None


def position_in_range(parameter: SearchParameter, value: PointValue | None) -> float:
    """Return the position of a value in its range, 0 to 1 inside; NaN if it has none.

    Choices lie evenly, in their order. Zero and negative values lie infinitely far below a
    logarithmic range.
    """
    if parameter.choices:
        last = max(1, len(parameter.choices) - 1)
        return parameter.choices.index(value) / last if value in parameter.choices else math.nan
    if value is None or isinstance(value, str) or parameter.high <= parameter.low:
        return math.nan
    low, high, at = parameter.low, parameter.high, float(value)
    if parameter.log:
        if low <= 0.0:
            return math.nan
        if at <= 0.0:
            return -math.inf
        low, high, at = math.log(low), math.log(high), math.log(at)
    return (at - low) / (high - low)


def range_text(parameter: SearchParameter) -> str:
    """Return the values of a parameter in words: ``48 .. 72 deg/s``, ``a, b``."""
    if parameter.choices:
        return ", ".join(parameter.shown(choice) for choice in parameter.choices)
    low = parameter.shown(parameter.low)
    if parameter.unit:
        low = low.removesuffix(f" {parameter.unit}")
    return f"{low} .. {parameter.shown(parameter.high)}{', log' if parameter.log else ''}"
