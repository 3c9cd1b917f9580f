"""Reader of YAML 1.2 documents: plain data with the place of every key and list item.

PyYAML yields the events, by libyaml or by its own parser. This module alone defines the meaning of
plain scalars: YAML 1.2, core schema, plus underscores in numbers and binary numbers.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, Final, TypeAlias

import yaml

from grammars.text.diagnostics import Finding, InputError, SourceText, Where

Key: TypeAlias = str | int
KeyPath: TypeAlias = tuple[Key, ...]
Places: TypeAlias = dict[KeyPath, Where]

_DEEPEST: Final = 50
"""Levels of nesting at most: reading recurses."""
_MOST_NODES: Final = 150_000
"""Keys and values of a document at most, far more than a real campaign has."""
_LARGEST: Final = 2**64
"""The first whole number that does not fit into 64 bits, as ledgers and readers of JSON need."""
_LONGEST_NUMBER: Final = 400
_MOST_FINDINGS: Final = 20

_CONTROL: Final = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that YAML 1.2 allows only as escapes in quotes."""
_FOREIGN: Final = re.compile(r"^[ -]*(?:[\w.]+:)?\xa0|^<{7} ", re.MULTILINE)
"""Spaces of web pages in the place of separators, and conflicts of git."""


def compose(text: str, file: str) -> tuple[Any, Places]:
    """Return the data of a document and the places in it; ``file`` is its name in messages.

    Data are dicts with text keys, lists, text, numbers, truth values and ``None``. The place of a
    value in a mapping is that of its key. Raises :class:`InputError` with line and column for
    invalid YAML, duplicate keys, keys other than text, too deep or too large documents, aliases,
    merge keys and tags.
    """
    source = SourceText(text, file)
    if (foreign := _FOREIGN.search(text)) is not None:
        is_space = foreign[0][-1] == "\u00a0"
        about = "a no-break space (U+00A0)" if is_space else "the mark of a merge conflict"
        raise InputError.at(source.where(foreign.end() - 1), f"holds {about}", "replace it")
    control = _CONTROL.search(text)
    if control is not None:
        sign = f"U+{ord(control[0]):04X}"
        message = f"is not valid YAML: holds the control character {sign}"
        raise InputError.at(source.where(control.start()), message, "remove it")
    composer = _Composer(source)
    try:
        return composer.read(yaml.parse(text, Loader=yaml_loader()))
    except yaml.YAMLError as error:
        raise InputError(_explain(source, error)) from None
    except (ValueError, OverflowError) as error:
        # The scanner raises plain errors for escapes of characters that do not exist.
        message = f"is not valid YAML: {error}"
        raise InputError.at(composer.last_place, message) from None


def yaml_loader() -> Any:
    """Return PyYAML's loader on libyaml, or its own loader if the wheel has no libyaml."""
    return getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Composer:
    """Reads the events of one document and collects findings that do not end the reading."""

    def __init__(self, source: SourceText) -> None:
        self.last_place = source.where(0)
        self.places: Places = {(): self.last_place}
        self._source = source
        self._events: Iterator[Any] = iter(())
        self._findings: list[Finding] = []
        self._nodes = 0

    def read(self, events: Iterator[Any]) -> tuple[Any, Places]:
        """Return data and places; raises :class:`InputError` and the errors of the events."""
        self._events = events
        data, documents = None, 0
        for event in events:
            name = type(event).__name__
            if name == "DocumentStartEvent":
                documents += 1
                if documents > 1:
                    message = "is not valid YAML: a second document begins here (---)"
                    raise InputError.at(self._place(event), message, "write each in its own file")
                data = self._value(next(events), ())
        if self._findings:
            raise InputError(self._findings)
        return data, self.places

    def _place(self, event: Any) -> Where:
        return mark_place(self._source, event.start_mark)

    def _value(self, event: Any, path: KeyPath) -> Any:
        where = self._check(event, len(path))
        match type(event).__name__:
            case "ScalarEvent":
                return self._scalar(event, where)
            case "SequenceStartEvent":
                return self._sequence(path)
            case _:
                return self._mapping(path)

    def _check(self, event: Any, depth: int) -> Where:
        """Refuse aliases, merge keys, tags and excessive nesting or size."""
        where = self.last_place = self._place(event)
        self._nodes += 1
        name = type(event).__name__
        if name == "AliasEvent":
            raise InputError.at(
                where,
                "YAML aliases (*name) are not used here",
                'repeat the value; a scenario can extend another one with "like: <scenario>"',
            )
        if event.tag is not None:
            raise InputError.at(where, f"YAML tags ({event.tag}) are not used here")
        if name == "ScalarEvent":
            if event.value == "<<" and event.implicit[0]:
                raise InputError.at(where, "YAML merge keys (<<) are not used here")
        elif depth >= _DEEPEST:
            raise InputError.at(where, f"is nested deeper than {_DEEPEST} levels")
        if self._nodes > _MOST_NODES:
            raise InputError.at(where, f"holds more than {_MOST_NODES} keys and values")
        return where

    def _scalar(self, event: Any, where: Where) -> Any:
        if not event.implicit[0]:
            value: Any = event.value
        elif len(event.value) > _LONGEST_NUMBER and _is_number(event.value):
            value = _LARGEST
        else:
            value = read_plain(event.value)
        if isinstance(value, int) and abs(value) >= _LARGEST:
            self._note(where, "this number is too large")
        return value

    def _sequence(self, path: KeyPath) -> list[Any]:
        items: list[Any] = []
        while type(event := next(self._events)).__name__ != "SequenceEndEvent":
            child = (*path, len(items))
            self.places[child] = self._place(event)
            items.append(self._value(event, child))
        return items

    def _mapping(self, path: KeyPath) -> dict[str, Any]:
        result: dict[str, Any] = {}
        while type(event := next(self._events)).__name__ != "MappingEndEvent":
            where = self._place(event)
            key = self._key(event, path, where)
            if key in result:
                self._note(where, "the same key is written twice")
            child = (*path, key)
            self.places[child] = where
            result[key] = self._value(next(self._events), child)
        return result

    def _key(self, event: Any, path: KeyPath, where: Where) -> str:
        """Return a key as text; report a key that is not text."""
        value = self._value(event, (*path, ""))
        if isinstance(value, str):
            return value
        text = source_at(self._source.text, where, _KEY) or str(value)
        message = f"key {text} is {kind_of(value)}, not text"
        hint = "" if isinstance(value, list | dict) else f'write it as "{text}"'
        self._note(where, message, hint)
        return text

    def _note(self, where: Where, message: str, hint: str = "") -> None:
        if len(self._findings) < _MOST_FINDINGS:
            self._findings.append(Finding(where, message, hint))


_TRUTH: Final = {
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}
_NOTHING: Final = frozenset({"", "~", "null", "Null", "NULL"})
_FIRST: Final = frozenset("+-.0123456789")
_FLOAT: Final = re.compile(
    r"[-+]?[0-9][0-9_]*\.[0-9_]*(?:[eE][-+]?[0-9]+)?|[-+]?[0-9][0-9_]*[eE][-+]?[0-9]+"
    r"|[-+]?\.[0-9_]+(?:[eE][-+]?[0-9]+)?"
)
_NOT_FINITE: Final = re.compile(r"[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)")
_WHOLE: Final = re.compile(
    r"(?P<sign>[-+]?)(?P<base>0b(?=[01_]+$)|0x(?=[0-9a-fA-F_]+$)|0o(?=[0-7_]+$)|(?=[0-9_]+$))"
    r"(?P<digits>\w+)"
)
_BASES: Final = {"": 10, "0b": 2, "0o": 8, "0x": 16}


def read_plain(text: str) -> str | int | float | bool | None:
    """Return the YAML 1.2 value of a scalar without quotes; dates are text."""
    if not text or text[0] not in _FIRST:
        return None if text in _NOTHING else _TRUTH.get(text, text)
    if _FLOAT.fullmatch(text):
        digits = text.replace("_", "")
        return float(digits) if digits.strip("+-.") else text
    if _NOT_FINITE.fullmatch(text):
        return float(text.replace(".", ""))
    whole = _WHOLE.fullmatch(text)
    if whole is None:
        return text
    digits = whole["digits"].replace("_", "")
    return int(whole["sign"] + digits, _BASES[whole["base"] or ""]) if digits else text


def _is_number(text: str) -> bool:
    return _WHOLE.fullmatch(text) is not None


def kind_of(value: Any) -> str:
    """Return a phrase for the YAML type of a value."""
    if isinstance(value, bool):
        return "true or false"
    if isinstance(value, int | float):
        return "a number"
    return "empty" if value is None else "keys with values" if isinstance(value, dict) else "a list"


_KEY: Final = re.compile(r"[^\s:]+")


def source_at(text: str, where: Where, pattern: re.Pattern[str]) -> str:
    """Return the match of ``pattern`` (its last group) at a place, empty if there is none."""
    match = pattern.match(source_line(text, where), max(0, where.column - 1))
    return "" if match is None else match[match.lastindex or 0]


def source_line(text: str, where: Where) -> str:
    """Return the line of a text that holds a place."""
    lines = text.split("\n")
    return lines[where.line - 1] if 0 < where.line <= len(lines) else ""


def mark_place(source: SourceText, mark: Any) -> Where:
    """Return the place of a mark of PyYAML."""
    # Use only its offset: YAML 1.1 also ends lines at U+0085, U+2028 and U+2029, unlike editors.
    return source.where(min(mark.index, len(source.text)))


# Only the text tells PyYAML's errors apart.
_REMEDIES: Final = (
    ("found character", "", "put quotes around a value that starts with @ ` % & or *"),
    ("line break", "a value starts with > or |", "put the value in quotes"),
    (
        "expected key",
        "this line is indented like none of those above it",
        "indent the lines of one mapping alike, such as every scenario under scenarios:",
    ),
    (
        "expected '-'",
        "a list goes on with - , but this line begins a key",
        "write it under the key it belongs to: a scenario under scenarios:",
    ),
    ("chomping", "a value starts with > or |", "put the value in quotes"),
    (
        "mapping values",
        "has a second colon or is indented too far",
        "write a space behind each colon, and put text with a colon in quotes",
    ),
)
"""Part of a message of PyYAML, our message (empty: the same), hint."""


def _explain(source: SourceText, error: Any) -> Finding:
    """Return the finding for an error of PyYAML."""
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    if mark is None:
        first_line = str(error).splitlines()[0] if str(error) else type(error).__name__
        position = getattr(error, "position", None)
        return Finding(source.where(position or 0), f"is not valid YAML: {first_line}")
    where = mark_place(source, mark)
    problem = str(error.problem or error.context or "is not valid YAML").splitlines()[0]
    # libyaml and PyYAML's own parser have different messages for these two.
    if source.text.startswith("\t", mark.index):
        return Finding(where, "is not valid YAML: indents with a tab", "indent with spaces")
    if "end of stream" in problem and error.context_mark is not None:
        opened = mark_place(source, error.context_mark)
        return Finding(
            where, "is not valid YAML: ends in quotes", f"they open in line {opened.line}"
        )
    if mark.index >= len(source.text) and "expected" in problem.split():
        message = "is not valid YAML: ends in the middle of a list or mapping"
        return Finding(where, message, "a bracket or value is missing")
    for part, ours, hint in _REMEDIES:
        if part in problem:
            return Finding(where, f"is not valid YAML: {ours or problem}", hint)
    return Finding(where, f"is not valid YAML: {problem}")
