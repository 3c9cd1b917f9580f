"""Reader of one namespace of a ROS parameter tree into the model of a component.

The original silently ignores unknown names and values of a wrong type, and then runs with a
default. Here an unknown name is a warning; a value of a wrong type or out of range is an error.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Annotated, Any, ClassVar, Final, NamedTuple, TypeAlias, TypeVar

from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError
from pydantic.json_schema import SkipJsonSchema

from daemon.stacks.findings import FindingCollector, ParameterFinding, ParameterLocation
from grammars.text.diagnostics import closest, did_you_mean
from grammars.text.documents import plain_message

Finite: TypeAlias = Annotated[float, Field(allow_inf_nan=False)]
Positive: TypeAlias = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NotNegative: TypeAlias = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
M = TypeVar("M", bound="Section")
_ANGLES: Final = frozenset(
    ("yaw_goal_tolerance", "update_min_a", "oscillation_reset_angle", "angular_sim_granularity")
)
_LARGEST_ANGLE: Final = 1.1 * math.tau
"""[rad] 6.3 and the like stand for any angle."""
ALTERNATIVE: Final = "(either)"
"""Prefix of tags of alternatives (:class:`pydantic.Tag`), which do not belong to a place."""


class Entry(NamedTuple):
    """A value and its place."""

    value: Any
    place: ParameterLocation


@dataclass(slots=True)
class ParameterNamespace:
    """Parameters of one namespace by name; nested namespaces are mappings."""

    path: ParameterLocation
    entries: dict[str, Entry] = field(default_factory=dict)

    @classmethod
    def of(cls, values: Mapping[str, Any], path: ParameterLocation) -> ParameterNamespace:
        """Return the namespace at ``path``."""
        return cls(path, {name: Entry(value, (*path, name)) for name, value in values.items()})

    def below(self, name: str) -> ParameterNamespace:
        """Return the namespace ``name`` in this one, empty if it does not exist."""
        entry = self.entries.get(name)
        if entry is None or not isinstance(entry.value, Mapping):
            return ParameterNamespace((*self.path, name))
        return ParameterNamespace.of(entry.value, entry.place)

    def value(self, name: str) -> Any:
        """Return the value of ``name``, ``None`` without an entry."""
        entry = self.entries.get(name)
        return None if entry is None else entry.value

    def words(self, name: str) -> list[str]:
        """Return the words of the text ``name``, an empty list without a text."""
        text = self.value(name)
        return text.split() if isinstance(text, str) else []


@dataclass(frozen=True, slots=True)
class ParameterTree:
    """A tree of parameters; a missing namespace counts as empty."""

    data: Mapping[str, Any]
    report: FindingCollector

    def at(self, *path: str) -> ParameterNamespace:
        """Return a namespace; report an error if the value is not a namespace."""
        space = ParameterNamespace.of(self.data, ())
        for name in path:
            if name in space.entries and not isinstance(space.value(name), Mapping):
                self.report.refuse(space.entries[name].place, "must be keys with values")
                return ParameterNamespace(path)
            space = space.below(name)
        return space


class Objection(NamedTuple):
    """A message about values that contradict each other, and their ``names``.

    Without ``fatal`` it is a doubt: the values will probably not do what their user intends.
    """

    names: tuple[str, ...]
    text: str
    fatal: bool = True


class Section:
    """A namespace of parameters; each field of a subclass has the name and default of ROS."""

    __slots__ = ()
    without_effect: ClassVar[Mapping[str, str]] = {}
    """Names without effect here, with the reason."""
    renamed: ClassVar[Mapping[str, str]] = {}
    """Names of older ROS releases, with those of Noetic."""
    strict: ClassVar[bool] = False
    """No ROS node reads this section, so an unknown name is an error."""

    def rules(self) -> Iterator[Objection]:
        """Yield objections to combinations of values."""
        yield from ()


def read_section(
    model: type[M],
    space: ParameterNamespace,
    report: FindingCollector,
    *,
    inherited: Mapping[str, Any] | None = None,
    without_effect: Mapping[str, str] | None = None,
    elsewhere: Collection[str] = (),
) -> M:
    """Return ``model`` (a pydantic dataclass) with the values of a namespace.

    ``inherited`` are values for names without an entry. ``without_effect`` holds further names
    without effect here, with the reason. Names in ``elsewhere`` belong to other readers. Errors
    and warnings go to ``report``. A bad value becomes a default, and the rules of the model are
    then skipped.
    """
    kind: Any = model
    adapters, idle = _adapters(kind), {**model.without_effect, **(without_effect or {})}
    values: dict[str, Any] = {}
    errors = len(report.fatal)
    for name, (value, place) in space.entries.items():
        if "$(" in str(value) and (name in adapters or name.endswith("_frame")):
            hint = "that is for launch files to fill in: write the value"
            report.refuse(place, f"ROS takes {value} to the letter", hint)
            continue
        if name in idle:
            report.ignore(place, idle[name])
        if name in adapters:
            _take(name, adapters[name], value, place, values, report)
        elif name in model.renamed:
            _say_renamed(place, name, model.renamed[name], space.entries, idle, report)
        elif name not in elsewhere and name not in idle:
            where = report.fatal if model.strict else report.problems
            where.append(_unknown_name(place, value, (*adapters, *idle), elsewhere))
    section = model(**{**(inherited or {}), **values})
    # With a default in the place of a bad value, objections would not be about the file.
    objections = list(section.rules()) if len(report.fatal) == errors else []
    for each in [one for one in objections if one.fatal] or objections:
        places = (space.entries[name].place for name in each.names if name in values)
        place = next(places, space.path)
        (report.refuse if each.fatal else report.warn)(place, each.text)
    return section


def refuse(values: Collection[Any], message: str) -> BeforeValidator:
    """Return a validator that refuses some ``values`` that ROS takes, with this message."""

    def check(value: Any) -> Any:
        if value in values:
            raise ValueError(message)
        return value

    return BeforeValidator(check)


def _say_renamed(
    place: ParameterLocation,
    name: str,
    new: str,
    entries: Mapping[str, Any],
    idle: Mapping[str, str],
    report: FindingCollector,
) -> None:
    """Report the Noetic name of a parameter under an outdated name."""
    message = f"ROS Noetic calls it {new} and ignores {name}"
    if new in idle:
        report.ignore(place, f"{message}; {idle[new]}")
    elif new in entries:
        report.ignore(place, f"{message}; {new} is there as well")
    else:
        report.warn(place, f"{message}: {new} has its default", f"write {new}")


def _unknown_name(
    place: ParameterLocation, value: Any, names: Iterable[str], namespaces: Iterable[str]
) -> ParameterFinding:
    """Return the finding that a name is unknown, with the nearest name of the same sort."""
    name = str(place[-1])
    if isinstance(value, Mapping):
        # A list of all namespaces would not help: this one may belong to another program.
        near = closest(name, namespaces)
        hint = f'did you mean "{near}"?' if near else ""
        message = f'nothing reads a namespace "{name}"'
    else:
        hint, message = did_you_mean(name, names), f'nothing reads a parameter "{name}"'
    return ParameterFinding(place, message, hint, unread=True)


@cache
def _adapters(model: type[Any]) -> dict[str, TypeAdapter[Any]]:
    """Return a validator for each field, so that one bad field does not hide another.

    Fields with ``SkipJsonSchema`` are not parameters.
    """
    fields = model.__pydantic_fields__
    return {
        name: TypeAdapter(_constrained(info.annotation, info.metadata))
        for name, info in fields.items()
        if not any(type(mark) is SkipJsonSchema for mark in info.metadata)
    }


def _constrained(annotation: Any, constraints: list[Any]) -> Any:
    return Annotated[(annotation, *constraints)] if constraints else annotation


def _take(
    name: str,
    adapter: TypeAdapter[Any],
    value: Any,
    place: ParameterLocation,
    values: dict[str, Any],
    report: FindingCollector,
) -> None:
    """Store a valid ``value`` under its name; JSON is strict about types but not about tuples."""
    if isinstance(value, float) and not math.isfinite(value):
        report.refuse(place, f"must be a finite number (given: {value})")
        return
    try:
        values[name] = adapter.validate_json(json.dumps(_integral_as_int(value)), strict=True)
        if name in _ANGLES and value > _LARGEST_ANGLE:
            turns = f"{value:g} rad is {value / math.tau:.1f} turns"
            report.warn(place, turns, f"write radians: {math.radians(value):.4g} for {value:g} deg")
    except ValidationError as error:
        report.fatal += [_finding(issue, place) for issue in error.errors()]
    except TypeError:
        report.refuse(place, f"cannot be a {type(value).__name__}")


def _integral_as_int(value: Any) -> Any:
    """Return 3.0 as 3, which roscpp accepts as an integer and as a real number."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _finding(issue: Any, path: ParameterLocation) -> ParameterFinding:
    parts = (part for part in issue["loc"] if part != "[key]")
    place = (*path, *(part for part in parts if not str(part).startswith(ALTERNATIVE)))
    few_corners = (issue["type"], place[-1]) == ("too_short", "footprint")
    message = "a polygon needs at least three points" if few_corners else plain_message(issue)
    value = issue["input"]
    simple = isinstance(value, str | int | float) or value is None
    return ParameterFinding(
        place, f"{message} (given: {value!r})" if simple else message, _advice(value)
    )


def _advice(value: Any) -> str:
    """Return advice for a text in the place of a number."""
    if not isinstance(value, str):
        return ""
    if degrees := re.fullmatch(r"\s*([-+.\d]+)\s*(?:deg|°).*", value):
        return f"ROS takes that for text: write deg({degrees[1]})"
    try:
        float(value)
    except ValueError:
        return ""
    return "ROS takes that for text: write it with a point and without quotes, such as 1.0e-3"
