"""Two recorded runs beside each other: one clock, other verdicts, other specifications."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from daemon.spec import RunSpec
from daemon.verdict import Verdict
from grammars import codec
from scenario_tui.wording import NOTHING

_IDENTITY: Final = ("campaign", "repeat")
"""What tells runs apart without making them different."""
_LONGEST: Final = 40
_FEW: Final = 2
"""Differences of one part that are listed one by one."""


@dataclass(frozen=True, slots=True)
class Pair:
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


def pairs(first: tuple[Verdict, ...], second: tuple[Verdict, ...]) -> tuple[Pair, ...]:
    """Return the verdicts of two runs oracle by oracle, those that differ first."""
    ours, theirs = ({v.oracle: v for v in verdicts} for verdicts in (first, second))
    found = [Pair(name, ours.get(name), theirs.get(name)) for name in ours | theirs]
    return tuple(sorted(found, key=lambda pair: not pair.differs))


@dataclass(frozen=True, slots=True)
class Difference:
    """A part of the specification, by its path, that is not the same: as texts."""

    path: str
    first: str
    second: str


def differences(first: RunSpec, second: RunSpec) -> tuple[Difference, ...]:
    """Return what is not the same in two specifications, part by part."""
    ours, theirs = (dict(_flat("", codec.to_plain(spec))) for spec in (first, second))
    found = [
        Difference(path, *_shown(ours.get(path, NOTHING), theirs.get(path, NOTHING)))
        for path in ours | theirs
        if ours.get(path) != theirs.get(path) and path not in _IDENTITY
    ]
    return tuple(_gathered(found))


def _gathered(found: list[Difference]) -> Iterator[Difference]:
    """Make one line of many that are about the same part, the behaviour of a door, say."""
    for part, group in itertools.groupby(found, key=lambda d: d.path.partition("]")[0]):
        listed = list(group)
        if len(listed) <= _FEW:
            yield from listed
            continue
        sides = ([d.first for d in listed], [d.second for d in listed])
        first, second = (NOTHING if set(side) == {NOTHING} else "differs" for side in sides)
        yield Difference(f"{part}]", first, f"{second} in {len(listed)} places")


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
    elif isinstance(value, list) and any(isinstance(part, Mapping | list) for part in value):
        for index, part in enumerate(value):
            name = str(index + 1)
            if isinstance(part, Mapping):
                name = str(part.get("joint") or part.get("name") or part.get("id") or name)
            yield from _flat(f"{path}[{name}]", part)
    else:
        yield path, str(value)
