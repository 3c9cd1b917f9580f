"""Running signals and oracles of other people: read-only in, checked values out."""

from __future__ import annotations

import math
from dataclasses import fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from daemon.oracles._finding import Finding
from daemon.oracles._series import Series
from daemon.verdict import Evidence
from grammars.oracle import Custom, custom_oracle, custom_signal
from grammars.plugins import explain
from grammars.values import Floats

if TYPE_CHECKING:
    from daemon.oracles._sampler import Sampler

T = TypeVar("T")


class PluginError(Exception):
    """A plug-in raised or answered nonsense; the message says which and what."""


def sample_custom(name: str, sampler: Sampler, arguments: tuple[float, ...]) -> Series:
    """Sample a signal that plugs in; raises :class:`PluginError`."""
    declared = _usable(custom_signal(name), "signal", name)
    time = read_only(sampler.timeline.time)
    answer = _called(f'the signal "{name}"', declared.sample, sampler.sealed, time, *arguments)
    values = _as_floats(answer, f'the signal "{name}"')
    if values.shape != time.shape:
        raise PluginError(
            f'the signal "{name}" gave values of shape {values.shape} for {len(time)} times'
        )
    if np.isinf(values).any():
        raise PluginError(f'the signal "{name}" is infinite: NaN means it is not known')
    if declared.unit == "bool":
        values = np.where(np.isnan(values), np.nan, (values != 0.0).astype(np.float64))
    return Series(values)


def judge_custom(judgement: Custom, sampler: Sampler) -> Finding:
    """Judge by an oracle that plugs in; raises :class:`PluginError`."""
    name = f'the oracle "{judgement.name}"'
    declared = _usable(custom_oracle(judgement.name), "oracle", judgement.name)
    arguments = tuple(number.value for number in judgement.arguments)
    answer = _called(name, declared.judge, sampler.sealed, *arguments)
    lower, upper, evidence = _interval(answer, name)
    if sampler.timeline.closed or declared.judges_prefixes:
        return Finding(lower, upper, evidence)
    # What it says of a trace that was cut is what it would say of a run that ended there.
    return Finding(-math.inf, math.inf, evidence)


def custom_unit(judgement: Custom) -> str:
    """Return the unit of the margin of an oracle that plugs in, empty for true or false."""
    declared = _usable(custom_oracle(judgement.name), "oracle", judgement.name)
    return "" if declared.unit == "bool" else declared.unit


def read_only(array: Floats) -> Floats:
    """Return a view of ``array`` that nobody can write through."""
    view = array.view()
    view.flags.writeable = False
    return view


def sealed(value: T) -> T:
    """Return a value type whose arrays, however deep, are read-only views; lists stay as they are.

    A plug-in that writes into a trace would change the verdicts of every other oracle.
    """
    changes: dict[str, Any] = {}
    for field in fields(value):  # type: ignore[arg-type]
        part = getattr(value, field.name)
        if isinstance(part, np.ndarray):
            changes[field.name] = read_only(part)
        elif is_dataclass(part) and any(
            isinstance(getattr(part, inner.name), np.ndarray) for inner in fields(part)
        ):
            changes[field.name] = sealed(part)
    return replace(value, **changes)  # type: ignore[type-var]


def _usable(declared: T | None, kind: str, name: str) -> T:
    if declared is None:
        raise PluginError(f'the {kind} "{name}" is not installed')
    return declared


def _called(what: str, function: Any, *arguments: object) -> object:
    try:
        answer: object = function(*arguments)
    except (Exception, SystemExit) as error:
        raise PluginError(explain(f"{what} failed", error, __file__)) from error
    return answer


def _as_floats(answer: object, what: str) -> Floats:
    try:
        return np.array(answer, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise PluginError(f"{what} gave no numbers: {error}") from error


def _interval(answer: object, what: str) -> tuple[float, float, Evidence]:
    """Read ``(lower, upper)`` or ``(lower, upper, evidence)``."""
    if not isinstance(answer, tuple) or len(answer) not in (2, 3):
        raise PluginError(f"{what} must return (lower, upper) or (lower, upper, Evidence)")
    evidence = answer[2] if len(answer) == 3 else Evidence()
    if not isinstance(evidence, Evidence):
        raise PluginError(f"{what} gave {type(evidence).__name__} instead of Evidence")
    lower, upper = _as_floats(answer[:2], what).tolist()
    if not lower <= upper:
        raise PluginError(f"{what} gave the interval [{lower}, {upper}]")
    return lower, upper, _plain(evidence, what)


def _plain(evidence: Evidence, what: str) -> Evidence:
    """Return evidence with nothing in it but finite floats and text, as ledgers keep it."""
    numbers = (evidence.time, evidence.value, evidence.limit)
    given = [number for number in numbers if number is not None]
    if not np.isfinite(_as_floats(given, what)).all():
        raise PluginError(f"{what} gave evidence that is not finite")
    time, value, limit = (None if number is None else float(number) for number in numbers)
    return Evidence(time, value, limit, str(evidence.object), str(evidence.note))
