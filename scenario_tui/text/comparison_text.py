"""How two runs differ: verdicts and margins oracle by oracle, then their specifications."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from rich.text import Text

from daemon.model.spec import RunSpec
from daemon.model.verdicts import Verdict
from grammars.text import codec
from scenario_tui.text.formatting import (
    DASHBOARD_STYLES,
    NOTHING,
    QUIET,
    glyph_word,
    margin,
    quantity,
)

_IDENTITY: Final = ("campaign", "repeat")
"""What tells runs apart without making them different."""
_LONGEST: Final = 40
"""Characters of a value that are shown, unless two that differ would look the same."""
_FEW: Final = 2
"""Differences of one part that are listed one by one."""


@dataclass(frozen=True, slots=True)
class VerdictPair:
    """What one oracle says of two runs; ``None`` where a run was not judged by it."""

    oracle: str
    first: Verdict | None
    second: Verdict | None

    @property
    def differs(self) -> bool:
        """Whether the two have different verdicts, or only one has any."""
        a, b = self.first, self.second
        return a is None or b is None or a.outcome is not b.outcome

    @property
    def change(self) -> float | None:
        """How much larger the margin of the second is, or the measured value."""
        a, b = _amount(self.first), _amount(self.second)
        return None if a is None or b is None else b - a


def _amount(verdict: Verdict | None) -> float | None:
    if verdict is None:
        return None
    return verdict.margin if verdict.margin is not None else verdict.evidence.value


def pair_verdicts(
    first: tuple[Verdict, ...], second: tuple[Verdict, ...]
) -> tuple[VerdictPair, ...]:
    """Return the verdicts of two runs oracle by oracle, those that differ first."""
    ours, theirs = ({v.oracle: v for v in verdicts} for verdicts in (first, second))
    found = [VerdictPair(name, ours.get(name), theirs.get(name)) for name in ours | theirs]
    return tuple(sorted(found, key=lambda pair: not pair.differs))


@dataclass(frozen=True, slots=True)
class SpecDifference:
    """A part of the specification, by its path, that is not the same: as texts."""

    path: str
    first: str
    second: str


def spec_differences(first: RunSpec, second: RunSpec) -> tuple[SpecDifference, ...]:
    """Return what is not the same in two specifications, part by part."""
    ours, theirs = (dict(_flat("", codec.to_plain(spec))) for spec in (first, second))
    found = [
        SpecDifference(path, *_shown(ours.get(path, NOTHING), theirs.get(path, NOTHING)))
        for path in ours | theirs
        if ours.get(path) != theirs.get(path) and path not in _IDENTITY
    ]
    return tuple(_grouped(found))


def _grouped(found: list[SpecDifference]) -> Iterator[SpecDifference]:
    """Make one line of many that are about the same part, the behaviour of a door, say."""
    for part, group in itertools.groupby(found, key=lambda d: d.path.partition("]")[0]):
        listed = list(group)
        if len(listed) <= _FEW:
            yield from listed
            continue
        sides = ([d.first for d in listed], [d.second for d in listed])
        first, second = (NOTHING if set(side) == {NOTHING} else "differs" for side in sides)
        yield SpecDifference(f"{part}]", first, f"{second} in {len(listed)} places")


def _shown(first: str, second: str) -> tuple[str, str]:
    """Return two texts as short as they can be and still differ."""
    short = (_short(first), _short(second))
    return short if short[0] != short[1] else (first, second)


def _short(text: str) -> str:
    try:
        number = float(text)
    except ValueError:
        return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
    return f"{number:.6g}" if "." in text else text


def _flat(path: str, value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping) and value:
        for key, part in value.items():
            yield from _flat(f"{path}.{key}" if path else str(key), part)
    # Lists of numbers, a pose say, are one value; lists of things are told apart by their names,
    # or one that is new would make all behind it different.
    elif isinstance(value, list) and any(isinstance(part, Mapping | list) for part in value):
        for index, part in enumerate(value):
            name = str(index + 1)
            if isinstance(part, Mapping):
                name = str(part.get("joint") or part.get("name") or part.get("id") or name)
            yield from _flat(f"{path}[{name}]", part)
    else:
        yield path, str(value)


def comparison_text(
    first: tuple[Verdict, ...], second: tuple[Verdict, ...], one: RunSpec, other: RunSpec
) -> Text:
    """Return verdicts, margins and specifications of two runs, those that differ first."""
    text = Text()
    text.append("oracle               first              second             change\n", style=QUIET)
    for pair in pair_verdicts(first, second):
        unit = next(v.unit for v in (pair.first, pair.second) if v is not None)
        text.append(f"{pair.oracle:<20.20} ", style="bold" if pair.differs else "")
        for verdict in (pair.first, pair.second):
            text.append(*_cell(verdict))
        change = "" if pair.change is None else margin(pair.change, unit)
        text.append(f"{change}{'  ≠' if pair.differs else ''}\n")
    found = spec_differences(one, other)
    text.append("\nspecification\n", style="bold")
    if not found:
        text.append("the same, but for the repeat\n", style=QUIET)
    for part in found:
        text.append(f"{part.path}\n  ", style="")
        text.append(f"{part.first}  →  {part.second}\n", style=QUIET)
    return text


def _cell(verdict: Verdict | None) -> tuple[str, str]:
    """Return a verdict in 19 columns and its style."""
    if verdict is None:
        return f"{NOTHING:<19}", QUIET
    amount = verdict.margin
    shown = margin(amount, verdict.unit)
    if amount is None:
        shown = quantity(verdict.evidence.value, verdict.unit)
    sign = glyph_word(verdict.outcome).split()[0]
    return f"{f'{sign} {verdict.outcome:.4} {shown}':<18.18} ", DASHBOARD_STYLES[verdict.outcome]
