"""Values, changes and failures of a search in words: ``kitchen_opens 8.54 s instead of 8 s``."""

from __future__ import annotations

import math
from typing import Final

from daemon.judging.statistics import cut_percentage
from daemon.model.search import Point, SearchTask
from daemon.model.search_answer import Confirmation, Finding, NearestFailure, ParameterChange
from daemon.model.trials import Trial
from daemon.search.points import changed_parameters, is_as_written
from grammars.text.words import count_noun, enumerate_words

AS_WRITTEN: Final = "as written"
"""Said of a point that has every value as the scenario has it."""
_DIGITS: Final = 3


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


def point_words(task: SearchTask, point: Point, most: int = 4) -> str:
    """Return the values that are not as written, at most so many of them."""
    changed = [
        i
        for i, (p, value) in enumerate(zip(task.parameters, point, strict=True))
        if p.written is None or not is_as_written(p, value)
    ]
    if not changed:
        return AS_WRITTEN
    words = ", ".join(_value_words(task, point, i) for i in changed[:most])
    more = len(changed) - most
    return f"{words} and {more} more" if more > 0 else words


def _value_words(task: SearchTask, point: Point, index: int) -> str:
    """Return ``kitchen_opens 8.54 s``."""
    parameter = task.parameters[index]
    return f"{task.short_name(parameter.name)} {parameter.shown(point[index])}"


def change_words(task: SearchTask, change: ParameterChange) -> str:
    """Return ``kitchen_opens 8.54 s instead of 8 s``."""
    parameter = next(p for p in task.parameters if p.name == change.parameter)
    words = f"{task.short_name(parameter.name)} {parameter.shown(change.value)}"
    if change.written is None:
        return words
    return f"{words} instead of {parameter.shown(change.written)}"


def failure_words(trial: Trial) -> str:
    """Return ``keeps-clear fails by 0.018 m near kitchen_door``."""
    oracle, margin, unit = "", None, ""
    if trial.verdict is not None:
        oracle = trial.verdict.oracle
        margin, unit = trial.verdict.margin, trial.verdict.unit
    if trial.value is not None and trial.value.oracle == oracle:
        margin, unit = trial.value.margin, trial.value.unit
    by = "" if not margin else f" by {quantity(abs(margin), unit)}"
    return f"{oracle} fails{by}{f' near {trial.about}' if trial.about else ''}"


def margin_words(trial: Trial) -> str:
    """Return the margin of a run: ``0.105 m``; empty when it has none."""
    return "" if trial.value is None else quantity(trial.value.margin, trial.value.unit)


def nearest_sentence(task: SearchTask, nearest: NearestFailure) -> str:
    """Return what to change for the scenario to fail, how it fails, and what still passes."""
    failure, changes, passes = nearest.result, nearest.changes, nearest.passes
    fails = failure_words(failure)
    if not nearest.holds:
        fails += f", {_noise_words(nearest.confirmed)}"
    if not changes:
        rest = [p for p in task.parameters if p.written is None]
        how = f" with {point_words(task, failure.point)}" if rest else ""
        return f"the scenario as written{how}: {fails}"
    words = enumerate_words([change_words(task, change) for change in changes])
    comma = "," if len(changes) > 1 else ""
    sentence = f"{words}{comma} and {fails}"
    return sentence if passes is None else f"{sentence}; {_passing(task, failure, passes)}"


def _passing(task: SearchTask, failure: Trial, passes: Trial) -> str:
    margin = margin_words(passes)
    ends = f"it passes with {margin}" if margin else "it passes"
    if not changed_parameters(task, passes.point):
        return f"as written {ends}"
    pairs = zip(failure.point, passes.point, strict=True)
    differing = [i for i, (value, other) in enumerate(pairs) if value != other]
    if len(differing) == 1:
        words = _value_words(task, passes.point, differing[0])
        alone = len(changed_parameters(task, failure.point)) == 1
        return f"at {words.partition(' ')[2]} {ends}" if alone else f"with {words} {ends}"
    return f"with {point_words(task, passes.point)} {ends}"


def _noise_words(confirmed: Confirmation | None) -> str:
    """Return ``with this noise alone: 1 of 5 repeats``, of a failure that does not hold."""
    words = "with this noise alone"
    if confirmed is None or not confirmed.failed:
        return words if confirmed is None else f"{words}: none of {confirmed.runs} repeats"
    return f"{words}: {confirmed.failed} of {count_noun(confirmed.runs, 'repeat')}"


def confirmation_words(confirmed: Confirmation) -> str:
    """Return ``fails in 5 of 5 repeats with other noise (47.8 % to 100 % ...)``."""
    low, high = cut_percentage(confirmed.low), percentage(confirmed.high)
    return (
        f"fails in {confirmed.failed} of {confirmed.runs} repeats with other noise "
        f"({low} to {high} with 95 % certainty)"
    )


def finding_words(finding: Finding) -> str:
    """Return ``keeps-clear near kitchen_door on the way to w3 (4 runs)``."""
    # A mission's failure is about a waypoint, the one that it is on its way to.
    named = finding.object and finding.object != finding.waypoint
    near = f" near {finding.object}" if named else ""
    way = f" on the way to {finding.waypoint}" if finding.waypoint else ""
    return f"{finding.oracle}{near}{way} ({count_noun(finding.count, 'run')})"
