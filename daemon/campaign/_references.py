"""Reference values: what somebody else found of the same, written in a campaign file.

They are drawn and told beside what is found here. No verdict follows from them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeAlias

from pydantic import BeforeValidator, Field

from daemon.model.assessments import ReferenceValue
from grammars.text.diagnostics import Diagnostic, InputError, Where, did_you_mean
from grammars.text.documents import KeyPath, StrictModel, YamlDocument
from grammars.text.quantity import parse_in

_COUNT: Final = re.compile(r"\s*(?P<passed>\d{1,6})\s+of\s+(?P<runs>\d{1,6})\s*")


def _as_list(value: Any) -> Any:
    return value if isinstance(value, list) else [value]


def _as_text(value: Any) -> Any:
    """Take a plain number for its text: a count needs no unit, and so no quotes."""
    plain = isinstance(value, int | float) and not isinstance(value, bool)
    return str(value) if plain else value


_Names: TypeAlias = Annotated[
    list[str], BeforeValidator(_as_list, json_schema_input_type=str | list[str])
]
_Amount: TypeAlias = Annotated[
    str, BeforeValidator(_as_text, json_schema_input_type=str | int | float)
]


class _ValueText(StrictModel):
    """One value that somebody found."""

    scenario: str = ""
    """Name of a scenario, or a pattern such as S3.*; left out for a comparison."""
    sut: _Names = Field(default_factory=list)
    """Systems under test, names or patterns; all when left out."""
    oracle: str = Field(min_length=1)
    """Name of a measure, of an oracle, or of a comparison; duration is there always."""
    value: _Amount
    """With the unit of the measure, such as 696.08 s; of an oracle with a limit how many runs
    passed, such as 3 of 5."""
    statistic: Literal["mean", "median", "min", "max"] = "mean"
    """What the source made of its runs: the mean, or for instance the largest value of all."""
    deviation: _Amount | None = None
    """Standard deviation of the runs."""
    range: Annotated[list[_Amount], Field(min_length=2, max_length=2)] | None = None
    """Least and greatest value, or the bounds of an interval."""
    runs: int | None = Field(default=None, ge=1)
    """Of how many runs it is."""
    note: str = ""
    """Where in the source it stands, and what else is to be said about it."""


class ReferenceText(StrictModel):
    """What one source found."""

    source: str = Field(min_length=1)
    """Who found it and where it stands; it is shown beside the values."""
    values: list[_ValueText] = Field(min_length=1)
    """The values, one for each scenario, system and quantity."""


@dataclass(frozen=True, slots=True)
class KnownQuantities:
    """What reference values may speak of.

    ``oracles`` and ``suts`` of each scenario by its name, ``units`` of each measure (``None`` for
    an oracle with a limit), ``comparisons`` with the unit of each.
    """

    oracles: Mapping[str, tuple[str, ...]]
    suts: Mapping[str, tuple[str, ...]]
    units: Mapping[str, str | None]
    comparisons: Mapping[str, str]


def read_references(
    written: Mapping[str, ReferenceText], document: YamlDocument, known: KnownQuantities
) -> tuple[tuple[ReferenceValue, ...], list[Diagnostic]]:
    """Return the reference values of a campaign file, and what is wrong with them."""
    found: list[ReferenceValue] = []
    problems: list[Diagnostic] = []
    for name, group in written.items():
        for index, value in enumerate(group.values):
            place = _ValuePlace(document, ("reference", name, "values", index))
            try:
                found.append(_reference(name, group.source, value, place, known))
            except InputError as error:
                problems.extend(error.diagnostics)
    return tuple(found), problems


@dataclass(frozen=True, slots=True)
class _ValuePlace:
    """Where a value stands in the file."""

    document: YamlDocument
    path: KeyPath

    def at(self, *key: str | int) -> Where:
        return self.document.where((*self.path, *key))


def _reference(
    name: str, source: str, text: _ValueText, place: _ValuePlace, known: KnownQuantities
) -> ReferenceValue:
    unit = _unit(text, place, known)
    where = place.at()
    common: dict[str, Any] = {
        "name": name, "source": source, "scenario": text.scenario, "suts": tuple(text.sut),
        "oracle": text.oracle, "note": text.note, "where": f"{Path(where.file).name}:{where.line}",
    }  # fmt: skip
    if unit is None:
        return ReferenceValue(**common, **_rate(text, place))
    value = parse_in(text.value, unit, text.oracle, place.at("value"))
    words, deviation, low, high = text.value.strip(), None, None, None
    if text.deviation is not None:
        deviation = parse_in(text.deviation, unit, text.oracle, place.at("deviation"))
        if deviation < 0.0:
            raise InputError(Diagnostic(place.at("deviation"), "a deviation is never negative"))
        words += f" ± {text.deviation.strip()}"
    if text.range is not None:
        bounds = enumerate(text.range)
        low, high = (parse_in(b, unit, text.oracle, place.at("range", i)) for i, b in bounds)
        if low > high:
            raise InputError(Diagnostic(place.at("range"), "write the smaller value first"))
        words += f" ({text.range[0].strip()} to {text.range[1].strip()})"
    return ReferenceValue(
        **common, statistic=text.statistic, value=value, unit=unit, text=words,
        deviation=deviation, low=low, high=high, runs=text.runs,
    )  # fmt: skip


def _unit(text: _ValueText, place: _ValuePlace, known: KnownQuantities) -> str | None:
    """Return the unit of what a value is about, ``None`` of a rate; raises :class:`InputError`."""
    if text.oracle in known.comparisons:
        if text.scenario:
            message = f'"{text.oracle}" is a comparison and names its scenarios itself'
            raise InputError(Diagnostic(place.at("scenario"), message, 'leave "scenario" out'))
        _check_suts(text, place, known, known.suts)
        return known.comparisons[text.oracle]
    if not text.scenario:
        message, hint = f'no comparison "{text.oracle}"', 'say of which "scenario" it is'
        if text.oracle not in known.units:
            hint = did_you_mean(text.oracle, known.comparisons)
        raise InputError(Diagnostic(place.at("oracle"), message, hint))
    scenarios = _matching(text.scenario, known.oracles)
    if not scenarios:
        hint = did_you_mean(text.scenario, known.oracles)
        raise InputError(
            Diagnostic(place.at("scenario"), f'no scenario "{text.scenario}" to compare', hint)
        )
    names = {oracle for scenario in scenarios for oracle in known.oracles[scenario]}
    # A value beside which nothing can ever stand would never be missed.
    if text.oracle not in names:
        message = f'{text.scenario} has neither measure nor oracle "{text.oracle}"'
        hint = did_you_mean(text.oracle, (*names, *known.comparisons))
        raise InputError(Diagnostic(place.at("oracle"), message, hint))
    _check_suts(text, place, known, scenarios)
    return known.units[text.oracle]


def _check_suts(
    text: _ValueText, place: _ValuePlace, known: KnownQuantities, scenarios: Iterable[str]
) -> None:
    suts = tuple(dict.fromkeys(sut for scenario in scenarios for sut in known.suts[scenario]))
    for index, pattern in enumerate(text.sut):
        if not _matching(pattern, suts):
            hint = did_you_mean(pattern, suts)
            message = f'no system under test "{pattern}" there'
            raise InputError(Diagnostic(place.at("sut", index), message, hint))


def _rate(text: _ValueText, place: _ValuePlace) -> dict[str, Any]:
    found = _COUNT.fullmatch(text.value)
    passed, runs = (int(found["passed"]), int(found["runs"])) if found else (0, 0)
    if not 0 <= passed <= runs or runs == 0:
        message = f'"{text.oracle}" has a limit: "{text.value}" does not say how many runs passed'
        raise InputError(Diagnostic(place.at("value"), message, "write it as 3 of 5"))
    for key in _forbidden(text):
        message = f'"{key}" goes with a measure, "{text.oracle}" has a limit'
        raise InputError(Diagnostic(place.at(key), message))
    words = f"{passed} of {runs}"
    return {"statistic": "rate", "value": passed / runs, "unit": "1", "text": words, "runs": runs}


def _forbidden(text: _ValueText) -> Iterator[str]:
    """Yield the keys that say nothing about a rate and are there."""
    for key in ("statistic", "deviation", "range", "runs"):
        if key in text.model_fields_set:
            yield key


def _matching(pattern: str, names: Iterable[str]) -> list[str]:
    return [name for name in names if fnmatchcase(name, pattern)]
