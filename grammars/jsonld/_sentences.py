"""What scenery layers say, as nodes in words of our own, and back.

Groups, parameters, settings, behaviours and places in entryways are plain values; each becomes a
node whose type is the value's class and whose predicates are its fields. Reading checks every
value again: JSON-LD comes from outside. Frames of the floor plan are published as
``hall-wall-2-frame`` and called ``hall.walls[2]`` in a layer.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import re
import typing
from typing import Any, Final

from pydantic import TypeAdapter, ValidationError

from grammars.floorplan import WORLD_FRAME
from grammars.jsonld._nodes import NodeGraph, Ref, Value
from grammars.jsonld.vocabulary import SCN, local_name
from grammars.scenery import model
from grammars.scenery.measure import LARGEST, Measure
from grammars.scenery.model import FrameName
from grammars.text.diagnostics import InputError, Where, did_you_mean
from grammars.text.documents import plain_message
from grammars.text.quantity import unit_of

_WALL: Final = re.compile(r"(?P<space>.+)-wall-(?P<index>\d{1,9})-frame")
_FEATURE: Final = re.compile(r"(?:column|divider|wall)-(?P<name>.+)-frame")
_OPENING: Final = re.compile(r"(?:entryway|window)-(?P<name>.+)-frame")
# As frames were called in 2023: frame-hall-wall-2, frame-center-hall.
_EARLIER_WALL: Final = re.compile(r"frame-(?P<space>.+)-wall-(?P<index>\d{1,9})")
_EARLIER_SPACE: Final = re.compile(r"frame-center-(?P<name>.+)")


def frame_name(published: str, where: Where) -> FrameName:
    """Return what the scenery language calls a published frame."""
    if published == WORLD_FRAME:
        return FrameName("world", None, "", where)
    wall = _WALL.fullmatch(published) or _EARLIER_WALL.fullmatch(published)
    if wall is not None:
        return FrameName(wall["space"], int(wall["index"]), "", where)
    patterns = (_FEATURE, _OPENING, _EARLIER_SPACE)
    thing = next(filter(None, (pattern.fullmatch(published) for pattern in patterns)), None)
    name = thing["name"] if thing is not None else published.removesuffix("-frame")
    return FrameName(name, None, "", where)


def is_on_floor(published: str) -> bool:
    """Return whether the origin of a frame is on the floor: that of an opening is in its middle."""
    return _OPENING.fullmatch(published) is None


_DEEPEST: Final = 16


@functools.cache
def _layer_classes() -> dict[str, type]:
    found = {
        name: value
        for name, value in vars(model).items()
        if inspect.isclass(value) and dataclasses.is_dataclass(value)
    }
    return {**found, "Measure": Measure}


@functools.cache
def _adapter(kind: type) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


@functools.cache
def sentence_fields() -> dict[str, tuple[type, ...]]:
    """Return what a layer says besides objects and instances: its fields, and their values."""
    hints = typing.get_type_hints(model.SceneryLayer)
    found = {}
    for field in dataclasses.fields(model.SceneryLayer):
        if field.name not in ("name", "file", "models", "instances"):
            kind = typing.get_args(hints[field.name])[0]
            found[field.name] = typing.get_args(kind) or (kind,)
    return found


def value_to_jsonld(value: Any) -> Any:
    """Return a value of a scenery layer as JSON-LD; places in source texts are left out."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        # Class and field names are the words of the file: renaming one changes the format.
        node: dict[str, Any] = {"@type": f"scn:{type(value).__name__}"}
        for field in dataclasses.fields(value):
            content = getattr(value, field.name)
            if field.name != "where" and content is not None:
                node[f"scn:{field.name.replace('_', '-')}"] = value_to_jsonld(content)
        return node
    if isinstance(value, tuple):
        return {"@list": [value_to_jsonld(item) for item in value]}
    return value


class SentenceReader:
    """Reads such nodes back."""

    def __init__(self, nodes: NodeGraph, file: str) -> None:
        self._nodes = nodes
        self._file = file

    def read(self, id: str, *kinds: type) -> Any:
        """Return the value at ``id``; raises :class:`InputError` unless it is one of ``kinds``."""
        value = self._value(Ref(id), self._nodes.where(id, Where(self._file, 1, 1)), 0)
        if not isinstance(value, kinds):
            names = " or ".join(kind.__name__ for kind in kinds)
            where = self._nodes.where(id, Where(self._file, 1, 1))
            raise InputError.at(where, f"{local_name(id)} is no {names}")
        return value

    def _value(self, value: Value, where: Where, depth: int) -> Any:
        if depth > _DEEPEST:
            raise InputError.at(where, "a sentence is nested too deeply")
        if isinstance(value, tuple):
            return tuple(self._value(item, where, depth + 1) for item in value)
        if not isinstance(value, Ref):
            return value
        node = self._nodes.by_id.get(value)
        names = [local_name(kind) for kind in node.types] if node is not None else []
        kind = next((_layer_classes()[name] for name in names if name in _layer_classes()), None)
        if node is None or kind is None:
            shown = f"{local_name(value)}, a {', '.join(names)}" if names else local_name(value)
            hint = did_you_mean(names[0] if names else "", _layer_classes())
            raise InputError.at(where, f"{shown} is nothing a layer can say", hint)
        here = self._nodes.places.get(value, where)
        return self._made(kind, node.values, here, depth)

    def _made(self, kind: type, values: dict[str, list[Value]], where: Where, depth: int) -> Any:
        content: dict[str, Any] = {}
        optional = set()
        for field in dataclasses.fields(kind):
            if field.name == "where":
                content["where"] = where
                continue
            said = values.get(SCN[field.name.replace("_", "-")], [])
            if said:
                content[field.name] = self._value(said[0], where, depth + 1)
            # None is written by leaving the field out; pydantic says whether it may be None.
            elif field.default is dataclasses.MISSING:
                optional.add(field.name)
                content[field.name] = None
        try:
            value = _adapter(kind).validate_python(content)
            # pydantic checks types; numbers and names are checked as the parser of the language
            # does.
            _check_sense(value)
            return value
        except ValueError as error:
            if not isinstance(error, ValidationError):
                message = f"a {kind.__name__}: {error}"
                raise InputError.at(where, message) from error
            first = error.errors()[0]
            name = ".".join(str(part) for part in first["loc"][:1]).replace("_", "-")
            missing = name.replace("-", "_") in optional
            problem = "is missing" if missing else plain_message(first).lower()
            message = f'"{name}" of a {kind.__name__}: {problem}'
            raise InputError.at(where, message) from error


def _check_sense(value: Any) -> None:
    """Refuse what the text of a layer cannot say; raises ``ValueError``."""
    for field in dataclasses.fields(value):
        content = getattr(value, field.name)
        if isinstance(content, float) and not abs(content) <= LARGEST:
            raise ValueError(f"{field.name} is more than anything in a building")
    if isinstance(value, Measure):
        try:
            unit_of(value.dimension)
        except KeyError:
            raise ValueError(f'"{value.dimension}" is no dimension known here') from None
    if isinstance(value, model.Name) and not value.text:
        raise ValueError("a name is empty")
    probability = getattr(value, "probability", 0.0)
    if not 0.0 <= probability <= 1.0:
        raise ValueError("a probability lies between 0 and 1")
