"""ROS parameter files: YAML as ``rosparam load`` reads it, with the place of every value.

These files are YAML 1.1 with duplicate keys (ROS takes the last one), ``yes`` for true, anchors
and angles in degrees. This reader follows ROS, which uses PyYAML too, and warns of probable
mistakes. It runs no code and bounds size, depth and number of values.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, TypeAlias

import yaml

from grammars.text.diagnostics import Finding, InputError, Severity, SourceText, Where
from grammars.text.documents import KeyPath, YamlDocument, read_text
from grammars.text.yaml_composer import mark_place, yaml_loader

_DEEPEST: Final = 20
_MOST_VALUES: Final = 20_000
"""More values than any robot has; this bounds nested aliases."""
_PLAIN: Final = frozenset(f"tag:yaml.org,2002:{kind}" for kind in ("bool", "int", "float", "str"))
_COLLECTIONS: Final = frozenset(f"tag:yaml.org,2002:{kind}" for kind in ("map", "seq"))
_NULL: Final = "tag:yaml.org,2002:null"
_NO_VALUE: Final = "write a value or leave it out"
_DATE: Final = "tag:yaml.org,2002:timestamp"
_ANGLE: Final = re.compile(r"^(deg|rad)\(([^)]*)\)$")
_LONGEST_ANGLE: Final = 100
_ANGLE_TAGS: Final = {"!degrees": "deg", "!radians": "rad"}


@dataclass(frozen=True, slots=True)
class ParameterValue:
    """A value and its place; a list is one value.

    ``missing`` has the reasons why the value is unknown, if any; ``inside`` maps the paths inside
    a list to their places.
    """

    value: Any
    where: Where
    missing: tuple[Finding, ...] = ()
    inside: Mapping[KeyPath, Where] = field(default_factory=dict)


Locate: TypeAlias = Callable[[int, int], Where]
"""Maps a line and column (from 1) of a part of a file to the place in that file."""


def load_ros_yaml(path: str | Path) -> tuple[YamlDocument, tuple[Finding, ...]]:
    """Read a ROS parameter file; the second value holds warnings.

    Raises :class:`InputError` for invalid YAML, anything but a mapping, and too large files.
    """
    return parse_ros_yaml(read_text(path), str(path))


def parse_ros_yaml(
    text: str, file: str, *, locate: Locate | None = None, any_value: bool = False
) -> tuple[YamlDocument, tuple[Finding, ...]]:
    """Parse the text of a ROS parameter file; ``file`` is the name used in messages.

    ``locate`` places a text that is a part of its file. With ``any_value``, the text may also be a
    list or a single value instead of a mapping.
    """
    whole = SourceText(text, file)

    def place(mark: Any) -> Where:
        where = mark_place(whole, mark)
        return where if locate is None else locate(where.line, where.column)

    begin = Where(file, 1, 1) if locate is None else locate(1, 1)
    try:
        _refuse_monstrous(yaml.parse(text, Loader=yaml_loader()), place)
        root = yaml.compose(text, Loader=yaml_loader())
    except yaml.MarkedYAMLError as error:
        where = place(error.problem_mark or error.context_mark)
        message = str(error.problem or error.context or "").splitlines()[0]
        raise InputError.at(where, f"is not valid YAML: {message}") from error
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        first = str(error).splitlines()[0]
        raise InputError.at(begin, f"is not valid YAML: {first}") from error
    reader = _RosYamlReader(place)
    if root is None or root.tag == _NULL:
        return YamlDocument(file, {}, {(): begin}, text), ()
    data = reader.value(root, ())
    if not isinstance(data, dict) and not any_value:
        raise InputError.at(begin, "expected parameters, NAME: VALUE")
    return YamlDocument(file, data, reader.places, text), tuple(reader.warnings)


def _refuse_monstrous(events: Iterable[Any], place: Callable[[Any], Where]) -> None:
    """Refuse too large or too deep documents before composing them, which recurses."""
    depth = 0
    for count, event in enumerate(events):
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if depth > _DEEPEST + 1:
            message = f"is nested deeper than {_DEEPEST} levels"
            raise InputError.at(place(event.start_mark), message)
        if count > 2 * _MOST_VALUES:
            raise InputError.at(place(event.start_mark), f"holds more than {_MOST_VALUES} values")


@dataclass(slots=True)
class _RosYamlReader:
    """Turns YAML nodes into plain data."""

    locate: Callable[[Any], Where]
    constructor: Any = field(default_factory=yaml.constructor.SafeConstructor)
    places: dict[KeyPath, Where] = field(default_factory=dict)
    warnings: list[Finding] = field(default_factory=list)
    count: int = 0

    def value(self, node: Any, path: KeyPath) -> Any:
        """Return the plain value of a node that stands at ``path``."""
        where = self.place(node)
        self.count += 1
        if len(path) > _DEEPEST:
            raise InputError.at(where, f"is nested deeper than {_DEEPEST} levels")
        if self.count > _MOST_VALUES:
            raise InputError.at(where, f"holds more than {_MOST_VALUES} values")
        self.places[path] = where
        if node.id != "scalar" and node.tag not in _COLLECTIONS:
            raise InputError.at(where, f"tag {node.tag} is not read here")
        if node.id == "mapping":
            return self.mapping(node, path)
        if node.id == "sequence":
            return [self.value(item, (*path, i)) for i, item in enumerate(node.value)]
        return self.scalar(node)

    def mapping(self, node: Any, path: KeyPath) -> dict[str, Any]:
        """Return a mapping; for a duplicate name ROS takes the last value."""
        result: dict[str, Any] = {}
        for key, value in self.pairs(node):
            name = str(key.value)
            if value.tag == _NULL:
                message = f"{name}: has no value, which rosparam cannot load"
                raise InputError.at(self.place(key), message, _NO_VALUE)
            if name in result:
                message = f"{name}: is written twice, ROS takes this one"
                self.warn(key, message, f"the other one: line {self.places[(*path, name)].line}")
                self.forget((*path, name))
            result[name] = self.value(value, (*path, name))
        return result

    def pairs(self, node: Any) -> list[tuple[Any, Any]]:
        """Return keys and values, first those merged by ``<<``."""
        own, merged = [], []
        for key, value in node.value:
            if key.id != "scalar":
                raise InputError.at(self.place(key), "a name must be plain text")
            if key.value != "<<":
                own.append((key, value))
                continue
            for part in value.value if value.id == "sequence" else (value,):
                if part.id != "mapping":
                    raise InputError.at(self.place(part), "<< takes mappings only")
                merged += part.value
        # Keys of the mapping itself win over merged ones, wherever the << stands.
        names = {key.value for key, _ in own}
        return [pair for pair in merged if pair[0].value not in names] + own

    def scalar(self, node: Any) -> Any:
        """Return a number, text or truth value by the rules of YAML 1.1."""
        if node.tag == _NULL:
            raise InputError.at(self.place(node), "has no value", _NO_VALUE)
        if node.tag in _ANGLE_TAGS:
            match = _ANGLE.match(node.value.strip())
            return self.angle(node, _ANGLE_TAGS[node.tag], match[2] if match else node.value)
        if node.tag not in _PLAIN:
            # Dates are text: no parameter of a robot is a date.
            if node.tag == _DATE:
                return str(node.value)
            raise InputError.at(self.place(node), f"tag {node.tag} is not read here")
        match = _ANGLE.match(node.value) if node.tag.endswith(":str") else None
        if match:
            return self.angle(node, match[1], match[2])
        try:
            return self.constructor.construct_object(node)
        except (ValueError, LookupError) as error:
            message = f'"{node.value}" is not a valid {node.tag.rpartition(":")[2]}'
            raise InputError.at(self.place(node), message) from error

    def angle(self, node: Any, unit: str, text: str) -> float:
        """Return an angle in radians; radians may be arithmetic with pi, such as rad(pi/2)."""
        try:
            return math.radians(float(text)) if unit == "deg" else _work_out(text)
        except (ValueError, ArithmeticError) as error:
            raise InputError.at(self.place(node), f'"{text}" is not an angle') from error

    def forget(self, path: KeyPath) -> None:
        """Remove the places of a replaced value."""
        for place in [p for p in self.places if p[: len(path)] == path]:
            del self.places[place]

    def place(self, node: Any) -> Where:
        """Return the start of a node."""
        return self.locate(node.start_mark)

    def warn(self, node: Any, message: str, hint: str) -> None:
        """Add a warning about valid input that is probably a mistake."""
        self.warnings.append(Finding(self.place(node), message, hint, Severity.WARNING))


def _work_out(text: str) -> float:
    """Evaluate an expression of numbers and pi, as rosparam does; raises ``ValueError``."""
    import simpleeval  # Late: few files have angles, and it loads slowly.

    if len(text) > _LONGEST_ANGLE:
        raise ValueError("too long to be an angle")
    try:
        return float(simpleeval.simple_eval(text.strip(), functions={}, names={"pi": math.pi}))
    except (simpleeval.InvalidExpression, SyntaxError, TypeError) as error:
        raise ValueError("no arithmetic") from error
