"""Values, changes and failures of a search in words: ``kitchen_opens 0.54 s later``."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Final

from daemon.judging.statistics import cut_percentage
from daemon.model.search import PointValue, SearchParameter, SearchTask
from daemon.model.search_answer import Confirmation, ParameterChange, PointResult
from daemon.search.points import changed_parameters, is_as_written
from grammars.text.words import count_noun, enumerate_words

AS_WRITTEN: Final = "as written"
"""Said of a point that has every value as the scenario has it."""
_DIGITS: Final = 3
_TIMES: Final = frozenset({"s", "ms", "us", "min", "h"})
_MOMENTS: Final = re.compile(
    r"(opens?|closes?|shuts?|starts?|begins?|ends?|stops?|leaves?|arrives?|comes?|goes|moves?|"
    r"departs?|enters?|at|time|when|again|back|going|returning|first|second|third|last)\d*\Z"
)
"""The last word of a parameter that is a moment, not how long something takes."""
_SPREADS: Final = re.compile(r"noise|bias|error|tolerance|deviation|drift|std|sigma")


def rounded(value: float) -> str:
    """Return three significant digits, without an exponent where people write none."""
    if value == 0.0 or not math.isfinite(value):
        return minus(f"{value:g}")
    if not 1e-5 <= abs(value) < 1e7:
        return minus(f"{value:.3g}")
    decimals = max(0, _DIGITS - 1 - math.floor(math.log10(abs(value))))
    text = minus(f"{value:.{decimals}f}")
    return text.rstrip("0").rstrip(".") if "." in text else text


def minus(number: str) -> str:
    """Return a number with the sign that is as wide as a plus: U+2212."""
    return number.replace("-", "−")


def quantity(value: float, unit: str) -> str:
    """Return a value with three significant digits and its unit: ``0.0183 m``."""
    return f"{rounded(value)} {unit}" if unit else rounded(value)


def percentage(share: float) -> str:
    """Return a bound such as ``18.2 %``, rounded up: no less than was shown."""
    return f"{math.ceil(share * 1000 - 1e-9) / 10:g} %"


def short_name(task: SearchTask, parameter: SearchParameter) -> str:
    """Return a parameter's name without its layer, where no other one is called so."""
    return task.short_name(parameter.name)


def value_words(task: SearchTask, parameter: SearchParameter, value: PointValue) -> str:
    """Return ``kitchen_opens 8.54 s``."""
    return f"{short_name(task, parameter)} {parameter.shown(value)}"


def point_words(task: SearchTask, result: PointResult, most: int = 4) -> str:
    """Return the values that are not as written, at most so many of them."""
    changed = [
        i
        for i, (p, value) in enumerate(zip(task.parameters, result.values, strict=True))
        if p.written is None or not is_as_written(p, value)
    ]
    if not changed:
        return AS_WRITTEN
    told = [value_words(task, task.parameters[i], result.values[i]) for i in changed[:most]]
    more = len(changed) - len(told)
    return ", ".join(told) + (f" and {more} more" if more else "")


def change_words(task: SearchTask, change: ParameterChange) -> str:
    """Return ``kitchen_opens 0.54 s later (8.54 s instead of 8 s)``."""
    parameter = next(p for p in task.parameters if p.name == change.parameter)
    name, value, written = short_name(task, parameter), change.value, change.written
    if written is None:
        return f"{name} {parameter.shown(value)}"
    words = f"{parameter.shown(value)} instead of {parameter.shown(written)}"
    if isinstance(value, str) or isinstance(written, str):
        return f"{name} {words}"
    size = parameter.text(float(f"{abs(value - written):.6g}"))
    return f"{name} {size} {_comparative(parameter, value > written)} ({words})"


def _comparative(parameter: SearchParameter, more: bool) -> str:
    """Return ``later`` for a moment that is put off, ``faster`` for a speed that grows."""
    last = re.split(r"[._/\s-]", parameter.name.lower())[-1]
    if parameter.unit in _TIMES and _MOMENTS.match(last):
        return "later" if more else "earlier"
    if parameter.unit in _TIMES:
        return "longer" if more else "shorter"
    is_speed = re.fullmatch(r"[a-zµ°]+/(s|min|h)|rpm", parameter.unit) is not None
    if is_speed and not _SPREADS.search(parameter.name.lower()):
        return "faster" if more else "slower"
    return "larger" if more else "smaller"


def failure_words(result: PointResult) -> str:
    """Return ``keeps-clear fails by 0.018 m near kitchen_door``."""
    oracle, about, margin, unit = "", result.about, None, ""
    if result.verdict is not None:
        oracle = result.verdict.oracle
        margin, unit = result.verdict.margin, result.verdict.unit
    if result.value is not None and result.value.oracle == oracle:
        margin, unit = result.value.margin, result.value.unit
    by = "" if not margin else f" by {quantity(abs(margin), unit)}"
    return f"{oracle} fails{by}{f' near {about}' if about else ''}"


def margin_words(result: PointResult) -> str:
    """Return the margin of a run: ``0.105 m``; empty when it has none."""
    return "" if result.value is None else quantity(result.value.margin, result.value.unit)


def nearest_sentence(
    task: SearchTask,
    result: PointResult,
    changes: Sequence[ParameterChange],
    passes: PointResult | None,
    luck: str = "",
) -> str:
    """Return what to change for the scenario to fail, how it fails, and what still passes.

    ``luck`` are the :func:`noise_words` of a failure that hangs on the noise.
    """
    fails = f"{failure_words(result)}{f', {luck}' if luck else ''}"
    if not changes:
        rest = [p for p in task.parameters if p.written is None]
        how = f" with {point_words(task, result)}" if rest else ""
        return f"the scenario as written{how}: {fails}"
    told = enumerate_words([change_words(task, change) for change in changes])
    comma = "," if len(changes) > 1 else ""
    sentence = f"{told}{comma} and {fails}"
    if passes is None:
        return sentence
    return f"{sentence}; {_passing(task, result, changes, passes)}"


def _passing(
    task: SearchTask, result: PointResult, changes: Sequence[ParameterChange], passes: PointResult
) -> str:
    margin = margin_words(passes)
    ends = f"it passes with {margin}" if margin else "it passes"
    if not changed_parameters(task, passes.values):
        return f"as written {ends}"
    for change in changes:
        index = next(i for i, p in enumerate(task.parameters) if p.name == change.parameter)
        parameter = task.parameters[index]
        pairs = zip(result.values, passes.values, strict=True)
        differing = [i for i, (value, other) in enumerate(pairs) if value != other]
        if change.passing is not None and differing == [index]:
            words = parameter.shown(passes.values[index])
            if len(changes) == 1:
                return f"{'with' if isinstance(change.passing, str) else 'at'} {words} {ends}"
            return f"with {short_name(task, parameter)} {words} {ends}"
    return f"with {point_words(task, passes)} {ends}"


def noise_words(confirmed: Confirmation | None) -> str:
    """Return ``with this noise alone: 1 of 5 repeats``, of a failure that does not hold."""
    words = "with this noise alone"
    if confirmed is None or not confirmed.failed:
        return words if confirmed is None else f"{words}: none of {confirmed.runs} repeats"
    return f"{words}: {confirmed.failed} of {count_noun(confirmed.runs, 'repeat')}"


def confirmation_words(confirmed: Confirmation) -> str:
    """Return ``fails in 5 of 5 repeats with other noise (in at least 47.8 % ...)``."""
    low, high = cut_percentage(confirmed.low), percentage(confirmed.high)
    return (
        f"fails in {confirmed.failed} of {confirmed.runs} repeats with other noise "
        f"({low} to {high} with 95 % certainty)"
    )
