"""YAML files of people: strict YAML 1.2, with the place of every value.

Duplicate keys, tags, aliases and unreadable files are reported with line and column.
:func:`read_model` checks a document against a pydantic model and reports each problem at the place
of its value.
"""

from __future__ import annotations

import dataclasses
import functools
import operator
import re
import threading
import types
import typing
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Self, TypeVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    ValidationError,
)
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from grammars.text.diagnostics import Finding, InputError, Where, closest, did_you_mean
from grammars.text.file_kinds import HEAD, kind_of_content, kind_of_keys, refuse_kind
from grammars.text.sources import read_text as read_text
from grammars.text.yaml_composer import KeyPath as KeyPath
from grammars.text.yaml_composer import compose, kind_of, source_at, source_line
from grammars.text.yaml_text import flow_text

M = TypeVar("M", bound="StrictModel")

_MOST_FINDINGS: Final = 50
"""Findings reported for one file at most."""
_BUILDING: Final = threading.Lock()


@dataclass(frozen=True, slots=True)
class OtherName:
    """The ``name`` used here for a key that people know under another one, and a ``remark``."""

    name: str
    remark: str = ""

    def __str__(self) -> str:
        return f"it is called {self.name}{self.remark}"


@dataclass(frozen=True, slots=True)
class RemovedKey:
    """A key of earlier releases, with the ``reason`` for its removal."""

    reason: str


class StrictModel(BaseModel):
    """Base of models for files of people: unknown keys are errors, values are frozen.

    Messages about a missing or malformed value show the first of the ``examples`` of its field.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)

    elsewhere: ClassVar[Mapping[str, str | OtherName | RemovedKey]] = {}
    """Advice for keys that belong somewhere else, have another name or were removed; the entry of
    the empty key is advice for all other unknown keys."""

    @classmethod
    def model_validate(cls, obj: Any, **options: Any) -> Self:
        """Check input; the first call builds the validator."""
        # Most of the forty models of a campaign are never used. Two threads may call this at once.
        with _BUILDING:
            cls.model_rebuild()
        return super().model_validate(obj, **options)


def as_list(value: Any) -> Any:
    """Return a list unchanged, and any other value as a list of one item."""
    return value if isinstance(value, list) else [value]


ONE_OR_MORE: Final = BeforeValidator(as_list, json_schema_input_type=str | list[str])
"""Marks a list of texts that may be written as a single text."""


def text_or(*kinds: type[bool | int | float], unit: str = "") -> BeforeValidator:
    """Mark a text that may be written as a value of ``kinds``, then a number of ``unit``."""

    def read(value: Any) -> Any:
        # The exact type: in Python, true is an integer.
        return f"{flow_text(value, plain=True)} {unit}".rstrip() if type(value) in kinds else value

    return BeforeValidator(read, json_schema_input_type=functools.reduce(operator.or_, kinds, str))


@dataclass(frozen=True)
class YamlDocument:
    """A parsed file: ``data`` in plain dicts, lists and scalars, and ``places`` by key path."""

    file: str
    data: Any
    places: Mapping[KeyPath, Where]
    text: str

    def where(self, path: KeyPath = ()) -> Where:
        """Return the place of the value at ``path``, or of its closest enclosing value."""
        for length in range(len(path), -1, -1):
            place = self.places.get(path[:length])
            if place is not None:
                return place
        return Where(self.file)

    def where_text(self, *path: str) -> Where:
        """Return the start of the text at ``path``, behind its key.

        The result is the line of the key, without a column, if the file lays the text out
        differently: over several lines, with escapes, or on the next line.
        """
        # YAML marks the key, but a message about a part of the value points to that part.
        key, value = self.where(path), self.data
        for part in path:
            value = value[part]
        line = source_line(self.text, key)
        column = line.find(value, line.find(":", key.column))
        return Where(key.file, key.line, column + 1)


def paths_inside(value: Any) -> Iterator[KeyPath]:
    """Yield the paths to all values nested in a list or mapping."""
    pairs = enumerate(value) if isinstance(value, list) else ()
    for key, below in value.items() if isinstance(value, Mapping) else pairs:
        yield (key,)
        for path in paths_inside(below):
            yield (key, *path)


def leaves(
    tree: Mapping[str, Any], above: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield the path and value of every leaf of nested mappings; an empty mapping is a leaf."""
    for name, value in tree.items():
        path = (*above, name)
        if isinstance(value, Mapping) and value:
            yield from leaves(value, path)
        else:
            yield path, value


def load_yaml(path: str | Path) -> YamlDocument:
    """Read a YAML 1.2 file; raises :class:`InputError` with line and column."""
    text = read_text(path)
    refuse_kind(kind_of_content(text[:HEAD].encode()), Where(str(path), 1, 1))
    return parse_yaml(text, str(path))


def parse_yaml(text: str, file: str) -> YamlDocument:
    """Parse YAML 1.2 text; ``file`` is the name used in messages.

    Raises :class:`InputError` with line and column.
    """
    data, places = compose(text, file)
    return YamlDocument(file, data, places, text)


_REST_OF_VALUE: Final = re.compile(r"[-+]?\.?\d")
"""Start of a "key" that is really the end of a value with a comma: {budget: 60 runs, 10 min}."""
_VALUE: Final = re.compile(r"(?:[^\s:]+\s*:\s+)?([^\s,\]}#]+)")


def read_model(document: YamlDocument, model: type[M]) -> M:
    """Check ``document`` against ``model``; raises :class:`InputError` with every finding."""
    if not isinstance(document.data, dict):
        keys = ", ".join([*written_fields(model)][:6])
        raise InputError.at(document.where(), f"expected keys such as {keys}")
    try:
        return model.model_validate(document.data)
    except ValidationError as error:
        findings = error.errors(include_url=False)
        refuse_kind(kind_of_keys(document.data, written_fields(model)), document.where())
        reported = [_explain(document, model, finding) for finding in findings[:_MOST_FINDINGS]]
        if len(findings) > len(reported):
            more = f"and {len(findings) - len(reported)} more problems"
            reported.append(Finding(Where(document.file), more))
        raise InputError(reported) from None


def _explain(document: YamlDocument, model: type[BaseModel], finding: Any) -> Finding:
    path, message, hint = explain_finding(model, finding)
    where = document.where(path)
    if finding["type"] == "string_type" and hint:
        # YAML has turned 3.10 into 3.1: quote the text of the file.
        value = finding["input"]
        is_here = where.file == document.file
        text = (source_at(document.text, where, _VALUE) if is_here else "") or str(value)
        hint = _text_hint(text, value)
    return Finding(where, message, hint)


def explain_finding(model: type[BaseModel], finding: Any) -> tuple[KeyPath, str, str]:
    """Return path, message and hint for one of pydantic's errors about ``model``."""
    path = tuple(finding["loc"])
    kind = finding["type"]
    if kind in ("extra_forbidden", "unexpected_keyword_argument"):
        key = str(path[-1])
        message, hint = _explain_key(_model_at(model, path[:-1]), key, finding.get("input"))
        if finding.get("input") is None and _REST_OF_VALUE.match(key):
            hint = f'inside {{ }} put a value with a comma in quotes: "..., {key}"'
        return path, message, hint
    if kind == "missing":
        return path[:-1], f'key "{path[-1]}" is missing', _example(model, path)
    value = finding.get("input")
    is_scalar = kind == "string_type" and isinstance(value, bool | int | float)
    hint = _text_hint(str(value), value) if is_scalar else ""
    if kind in _SHAPES:
        hint = _example(model, path)
    words = [str(part) for part in path if isinstance(part, str) and part != "[key]"]
    message = plain_message(finding)
    return path, f"{words[-1]}: {message}" if words else message, hint


def _explain_key(model: Any, key: str, value: Any) -> tuple[str, str]:
    """Return message and hint for a key with a value that ``model`` does not have."""
    fields, elsewhere = written_fields(model), getattr(model, "elsewhere", {})
    if key and key in elsewhere:
        if isinstance(elsewhere[key], RemovedKey):
            return f"{key}: {elsewhere[key].reason}", "remove this line"
        renamed = isinstance(elsewhere[key], OtherName)
        wrong = f'unknown key "{key}"' if renamed else f'key "{key}" is in the wrong place'
        return wrong, str(elsewhere[key])
    # A key with keys below it is mostly the name of something.
    is_known = closest(key, fields) or isinstance(value, dict)
    other = "" if is_known else closest(key, elsewhere)
    hint = f"{other}: {elsewhere[other]}" if other else did_you_mean(key, fields)
    if not other and not closest(key, fields) and elsewhere.get(""):
        hint = f"{elsewhere['']}; {hint}"
    return f'unknown key "{key}"', hint


_WRONG_FORM: Final = "wrong_form"
_SHAPES: Final = (
    *("dict_type", "model_type", "dataclass_type", "list_type", "too_short", "too_long"),
    *("float_parsing", "bool_parsing", _WRONG_FORM),
)
"""Findings about the form of a value, for which the hint is an example."""


def wrong_form(message: str) -> PydanticCustomError:
    """Return the error that validators raise for a value unlike the examples of its field."""
    return PydanticCustomError(_WRONG_FORM, "{message}", {"message": message})


def _example(model: type[BaseModel], path: KeyPath) -> str:
    """Return a valid line for ``path``, empty if its field has no examples."""
    while path and isinstance(path[-1], int):
        path = path[:-1]
    field = written_fields(_model_at(model, path[:-1])).get(str(path[-1])) if path else None
    if field is None or not field.examples:
        return ""
    return f"such as: {path[-1]}: {flow_text(field.examples[0], plain=True)}"


def _text_hint(text: str, value: Any) -> str:
    return f'{text} is {kind_of(value)}: write it as "{text}"'


_PLAIN_MESSAGES: Final = {
    "missing": "is missing",
    "string_type": "must be text",
    "float_type": "must be a number",
    "float_parsing": "must be a number",
    "int_type": "must be a whole number",
    "int_parsing": "must be a whole number",
    "int_from_float": "must be a whole number",
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
    "list_type": "must be a list",
    "tuple_type": "must be a list",
    "dict_type": "must be keys with values",
    "model_type": "must be keys with values",
    "dataclass_type": "must be keys with values",
    "unexpected_keyword_argument": "is not a known key",
    "too_short": "must have {min_length} or more",
    "string_too_short": "must not be empty",
    "too_long": "must have {max_length} or fewer",
    "string_too_long": "must have {max_length} characters or fewer",
}
"""Messages for the types of pydantic's findings."""


def plain_message(finding: Any) -> str:
    """Return one of pydantic's findings in plain words."""
    kind, context = finding["type"], finding.get("ctx", {})
    if kind == "string_pattern_mismatch":
        return _pattern_in_words(context["pattern"])
    if kind in ("dict_type", "model_type") and finding["input"] is None:
        return "has no keys: indent those that belong to it below its name"
    if kind in _PLAIN_MESSAGES:
        return _PLAIN_MESSAGES[kind].format(**context)
    message: str = finding["msg"].removeprefix("Value error, ")
    return re.sub(r"^Input should ", "must ", message)


_PATTERNS: Final = {
    "^[A-Za-z_][A-Za-z0-9_]*$": (
        'must be letters (a to z), digits and "_", and not begin with a digit'
    ),
    "^[~/]?[A-Za-z][A-Za-z0-9_/]*$": "must be a name such as scan or /robot1/scan",
    "^/[A-Za-z][A-Za-z0-9_/]*$": "must be a full name such as /robot1/amcl",
    "^[a-z][a-z0-9_]*$": (
        'must be lower-case letters (a to z), digits and "_", and begin with a letter'
    ),
}


def _pattern_in_words(pattern: str) -> str:
    """Describe a pattern of names, such as ``^[A-Za-z0-9][A-Za-z0-9._-]{0,59}$``."""
    if pattern in _PATTERNS:
        return _PATTERNS[pattern]
    match = re.fullmatch(r"\^\[A-Za-z0-9\]\[A-Za-z0-9(\.?)_-\](?:\*|\{0,(\d+)\})\$", pattern)
    if match is None:
        return f"must match {pattern}"
    signs = '".", "_" and "-"' if match[1] else '"_" and "-"'
    length = f", {int(match[2]) + 1} at most" if match[2] else ""
    return f"must be letters (a to z), digits, {signs}{length}, and begin with a letter or digit"


def written_fields(kind: Any) -> Mapping[str, FieldInfo]:
    """Return the fields of a model or dataclass by their keys in files."""
    if dataclasses.is_dataclass(kind):
        hints = typing.get_type_hints(kind, include_extras=True)
        names = [field.name for field in dataclasses.fields(kind)]
        return {name: FieldInfo.from_annotation(hints[name]) for name in names}
    fields: Mapping[str, FieldInfo] = getattr(kind, "model_fields", {})
    return {field.alias or name: field for name, field in fields.items()}


def _model_at(model: Any, path: KeyPath) -> Any:
    """Return the class that describes the mapping at ``path`` (best effort)."""
    current = model
    for part in path:
        fields = written_fields(current)
        if fields:
            field = fields.get(str(part))
            current = _strip(field.annotation) if field is not None else None
        else:
            arguments = typing.get_args(current)
            current = _strip(arguments[-1]) if arguments else None
    return current


def _strip(annotation: Any) -> Any:
    """Return an annotation without ``None`` and ``Annotated``; of a union, return the model."""
    if typing.get_origin(annotation) is Annotated:
        return _strip(typing.get_args(annotation)[0])
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        members = [_strip(a) for a in typing.get_args(annotation) if a is not type(None)]
        return next((m for m in members if written_fields(m)), members[0])
    return annotation
