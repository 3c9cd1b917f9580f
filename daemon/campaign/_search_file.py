"""The keys of a search in a campaign file, as people write them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Final, Literal, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Field, PlainValidator

from daemon.model.search import (
    LONGEST_SEARCH,
    MOST_PARAMETERS,
    MOST_PROPOSALS,
    MOST_REPEATS,
    MOST_WINDOW,
    WINDOW,
    SearchParameter,
)
from grammars.text.documents import (
    ONE_OR_MORE,
    OtherName,
    StrictModel,
    as_list,
    text_or,
    wrong_form,
)
from grammars.text.quantity import read_as, read_quantity

_MOST_CHOICES: Final = 1_000

_NUMBER: Final = r"[+-]?(?:\d+(?:\.(?!\.)\d*)?|\.\d+)(?:[eE][+-]?\d+)?"
_UNIT: Final = r"[A-Za-z%°][^.,]*?(?:\^0?\.5[^.,]*?)?"
_RANGE: Final = re.compile(
    rf"\s*(?P<low>{_NUMBER})\s*(?P<low_unit>{_UNIT})?\s*\.\.\s*"
    rf"(?P<high>{_NUMBER})\s*(?P<unit>{_UNIT})?\s*(?P<log>,\s*log)?\s*"
)
_WHOLE: Final = re.compile(r"[+-]?\d+")
_EXAMPLE: Final = "such as 48 .. 72 deg/s, or 0.01 .. 0.05 m, log, or a list: [left, right]"


_UNPLACED: Final = SearchParameter("", "mission", 0, "")
"""A parameter before its name is looked up in the layers of a scenario."""


def _read_range(text: str) -> SearchParameter:
    """Read ``48 .. 72 deg/s`` or ``0.01 .. 0.05 m, log``; raises ``ValueError``.

    The unit stands at the end, or behind both numbers; then the unit at the end holds.
    """
    parts = _RANGE.fullmatch(text)
    if parts is None:
        raise ValueError(f'"{text}" is not a range: write one, {_EXAMPLE}')
    unit = " ".join((parts["unit"] or "").split())
    low_unit = " ".join((parts["low_unit"] or "").split())
    low, high = float(parts["low"]), float(parts["high"])
    if not math.isfinite(high - low):
        raise ValueError(f'"{text}" has no end: write a range, {_EXAMPLE}')
    if unit:
        one = read_quantity(f"1 {unit}")
        if low_unit and low_unit != unit:
            quantity = read_quantity(f"{parts['low']} {low_unit}")
            if quantity.dimension != one.dimension:
                raise ValueError(f'"{text}" goes from {low_unit} to {unit}')
            low = float(f"{quantity.value / one.value:.12g}")
    elif low_unit:
        raise ValueError(f'"{text}": write the unit at the end: .. {parts["high"]} {low_unit}')
    if low == high:
        raise ValueError(f'"{text}" is empty: widen it, a single value is not searched')
    if low > high:
        raise ValueError(f'"{text}" begins above its end: write the smaller value first')
    log = bool(parts["log"])
    if log and low <= 0.0:
        raise ValueError(f'"{text}": a logarithmic range begins above 0')
    integers = not unit and all(_WHOLE.fullmatch(parts[end]) for end in ("low", "high"))
    return replace(_UNPLACED, low=low, high=high, unit=unit, log=log, whole=integers)


def _read_over(value: Any) -> SearchParameter:
    if isinstance(value, str):
        return _read_range(value)
    if not isinstance(value, list):
        kind = "nothing" if value is None else "keys" if isinstance(value, dict) else str(value)
        # Inside braces YAML ends a value at a comma: {speed: 1 .. 2 m/s, log}.
        comma = '; inside { } quote a value with a comma: "0.01 .. 0.05 m, log"'
        raise ValueError(
            f"takes a range or a list, not {kind}: {_EXAMPLE}{comma if value is None else ''}"
        )
    if len(value) < 2:
        raise ValueError("a list has two choices or more; a single value is not searched")
    if len(value) > _MOST_CHOICES:
        raise ValueError(f"a list has {_MOST_CHOICES} choices at most: write a range")
    if any(not isinstance(one, str | int | float) for one in value):
        raise ValueError("a list has names, numbers or quantities as choices")
    truth = all(isinstance(one, bool) for one in value)
    if not truth and any(isinstance(one, bool) for one in value):
        raise ValueError("a list of true and false has nothing else")
    words = tuple(str(one).lower() if isinstance(one, bool) else one for one in value)
    if len(set(words)) < len(words):
        raise ValueError("the list has a choice twice")
    numbers = [one for one in value if not isinstance(one, str)]
    if 0 < len(numbers) < len(value):
        raise ValueError("a list has numbers or words, not both: write units behind all or none")
    whole = not truth and bool(numbers) and all(isinstance(one, int) for one in numbers)
    choices = tuple(one if isinstance(one, str) else float(one) for one in words)
    return replace(_UNPLACED, choices=choices, whole=whole, truth=truth)


OverText: TypeAlias = Annotated[
    SearchParameter,
    PlainValidator(
        _read_over, json_schema_input_type=str | Annotated[list[str | float], Field(min_length=2)]
    ),
]

_RUNS: Final = re.compile(r"\s*(\d{1,9})\s+runs?\s*")
_FAILURES: Final = re.compile(r"\s*(\d{1,9})\s+failures?\s*")
_REPEATS: Final = re.compile(r"\s*(\d{1,9})(?:\s+repeats?)?\s*")

StopRule: TypeAlias = Literal["budget", "failures", "settled"]


def read_budget(text: str) -> tuple[int, float]:
    """Read ``60 runs``, ``10 min`` or both; return proposals and wall clock [s], 0 for any time.

    Raises ``ValueError``.
    """
    runs, seconds = 0, 0.0
    for part in text.split(","):
        count = _RUNS.fullmatch(part)
        if count is not None and not runs:
            runs = int(count[1])
            if not 1 <= runs <= MOST_PROPOSALS:
                raise ValueError(f"a search has 1 to {MOST_PROPOSALS} runs, not {runs}")
        elif count is None and not seconds:
            try:
                seconds = read_as(part.strip(), "time")
            except ValueError as error:
                raise ValueError(
                    f'"{text}" is not a budget: write 60 runs, 10 min, or both: 60 runs, 10 min'
                ) from error
            if not 0.0 < seconds <= LONGEST_SEARCH:
                raise ValueError(f'"{part.strip()}" is not a search time: write up to 30 days')
        else:
            raise ValueError(f'"{text}" has a part twice: write 60 runs, 10 min')
    return runs or MOST_PROPOSALS, seconds


def read_stop(text: str) -> tuple[StopRule, int]:
    """Read ``first failure``, ``5 failures``, ``when settled`` or ``budget``.

    Return the rule and the number of failures that end the search. Raises ``ValueError``.
    """
    words = " ".join(text.split())
    if words == "budget":
        return "budget", 1
    if words in ("when settled", "settled"):
        return "settled", 1
    count = _FAILURES.fullmatch(words)
    failures = 1 if words == "first failure" else int(count[1]) if count else 0
    if failures < 1:
        raise ValueError(
            f'"{text}" cannot end a search: write first failure, 5 failures, when settled or budget'
        )
    return "failures", failures


def read_confirm(text: str) -> int:
    """Read ``5 repeats``; raises ``ValueError``."""
    count = _REPEATS.fullmatch(text)
    if count is None or int(count[1]) > MOST_REPEATS:
        raise ValueError(f'"{text}": write 5 repeats, {MOST_REPEATS} at most')
    return int(count[1])


def checked(read: Callable[[str], Any]) -> AfterValidator:
    """Return a validator that keeps a text and refuses an unreadable one."""

    def check(text: str) -> str:
        read(text)
        return text

    return AfterValidator(check)


def _no_keys(value: Any) -> Any:
    if isinstance(value, dict):
        raise wrong_form("takes words, not keys")
    return value


_Constraints: TypeAlias = Annotated[list[str], ONE_OR_MORE, BeforeValidator(_no_keys)]
_Step: TypeAlias = Literal["nearest", "shrink"]
_Steps: TypeAlias = Annotated[
    list[_Step],
    BeforeValidator(as_list, json_schema_input_type=_Step | list[_Step]),
    BeforeValidator(_no_keys),
]


class SearchText(StrictModel):
    """A search for failures of a scenario."""

    elsewhere: ClassVar[Mapping[str, str | OtherName]] = {
        "minimize": OtherName("minimise"),
        "objective": OtherName("minimise", ": the name of an oracle"),
        "oracle": OtherName("minimise"),
        "parameters": OtherName("over"),
        "constraints": OtherName("such that"),
        "such_that": OtherName("such that"),
        "runs": OtherName("budget", ": 60 runs"),
        "repeats": OtherName("confirm", ": 5 repeats"),
    }

    about: str = ""
    """One line for people."""
    scenario: str = Field(min_length=1, examples=["busy-house"])
    """The scenario to vary."""
    sut: str = ""
    """One of its systems under test; by default the first."""
    minimise: str = Field(min_length=1, examples=["keeps-clear"])
    """An oracle of the scenario with a limit, which shall fail; any: the smallest of all margins,
    each divided by its limit."""
    over: dict[str, OverText] = Field(
        min_length=1,
        max_length=MOST_PARAMETERS,
        examples=[{"doors_moving.swing": "48 .. 72 deg/s"}],
    )
    """Parameters to vary, LAYER.PARAMETER of a layer of the scenario: a range with its unit, such
    as 48 .. 72 deg/s, or a list of choices. LAYER may also be mission, robot, sut or floorplan."""
    such_that: _Constraints = Field(
        default_factory=list, alias="such that", max_length=MOST_PARAMETERS,
        examples=[["doors_moving.bedroom_closes < doors_moving.bedroom_opens"]],
    )  # fmt: skip
    """Conditions on every run: comparisons of parameters and quantities, a < b, a + 1 s <= b, also
    joined by and, or and not."""
    budget: Annotated[str, checked(read_budget), text_or(int, unit="runs")] = "60 runs"
    """Runs, or wall time, or both: 60 runs, 10 min; the first one spent ends the search."""
    stop: Annotated[str, checked(read_stop)] = "budget"
    """End of the search: first failure, a number of failures (5 failures), when settled (without
    further improvement), or budget."""
    method: str = Field(default="auto", min_length=1)
    """auto (halton, then tpe, then cma), halton, random, tpe, cma or boundary."""
    confirm: Annotated[str, checked(read_confirm), text_or(int, unit="repeats")] = "5 repeats"
    """Number of runs that repeat a reported failure with other noise."""
    then: _Steps = Field(default=["nearest", "shrink"])
    """Steps after a failure. nearest: find the smallest change of the scenario that still fails;
    shrink: remove every part that the nearest failure does not need."""
    window: int = Field(default=WINDOW, ge=1, le=MOST_WINDOW)
    """Most runs at a time: the search is the same on any number of cores."""
    seed: int | None = Field(default=None, ge=0, lt=2**63)
    """Seed of the proposals; by default that of the campaign."""
