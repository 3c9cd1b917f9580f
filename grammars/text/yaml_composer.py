"""From the text of a YAML 1.2 document to plain data, with the place of every key and list item.

Events come from PyYAML: by libyaml, or by its own parser where it was built without. What a plain
scalar means is said in this module alone: YAML 1.2, core schema, with underscores in numbers and
binary numbers as well.
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
"""Levels of nesting: reading recurses, and nobody follows a file that deep."""
_MOST_NODES: Final = 150_000
"""Keys and values of a document; more are refused: no campaign of people comes near."""
_LARGEST: Final = 2**64
"""Whole numbers from here on fit no 64 bits, neither in a ledger nor in what reads our JSON."""
_LONGEST_NUMBER: Final = 400
_MOST_FINDINGS: Final = 20

_CONTROL: Final = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""What YAML 1.2 allows in no document, escaped in quotes aside."""


def compose(text: str, file: str) -> tuple[Any, Places]:
    """Return the data of a document and the places in it; ``file`` is its name in messages.

    Data are dicts with text as keys, lists, text, numbers, truth values and ``None``. The place of
    a value in a mapping is that of its key. Raises :class:`InputError` with line and column for
    what is no YAML, is written twice, no text as a key, nested or larger than a person writes it,
    and for aliases, merge keys and tags.
    """
    source = SourceText(text, file)
    control = _CONTROL.search(text)
    if control is not None:
        sign = f"U+{ord(control[0]):04X}"
        message = f"is not valid YAML: holds the control character {sign}"
        raise InputError.at(source.where(control.start()), message, "take it out")
    composer = _Composer(source)
    try:
        return composer.read(yaml.parse(text, Loader=yaml_loader()))
    except yaml.YAMLError as error:
        raise InputError(_explain(source, error)) from None
    except (ValueError, OverflowError) as error:
        # Its scanner has no words of its own for the escape of a sign there is none of.
        message = f"is not valid YAML: {error}"
        raise InputError.at(composer.last_place, message) from None


def yaml_loader() -> Any:
    """Return PyYAML's loader on libyaml, its own where the wheel came without."""
    return getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Composer:
    """Reads the events of one document; what can be said of several places is said at once."""

    def __init__(self, source: SourceText) -> None:
        self.last_place = source.where(0)
        self.places: Places = {(): self.last_place}
        self._source = source
        self._events: Iterator[Any] = iter(())
        self._findings: list[Finding] = []
        self._nodes = 0

    def read(self, events: Iterator[Any]) -> tuple[Any, Places]:
        """Return data and places; raises :class:`InputError` and what reading events raises."""
        self._events = events
        data, documents = None, 0
        for event in events:
            name = type(event).__name__
            if name == "DocumentStartEvent":
                documents += 1
                if documents > 1:
                    message = "is not valid YAML: a second document begins here (---)"
                    raise InputError.at(self._place(event), message, "write a file for each")
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
        """Refuse what nobody writes to be read: aliases, merges, tags, endless nesting."""
        where = self.last_place = self._place(event)
        self._nodes += 1
        name = type(event).__name__
        if name == "AliasEvent":
            raise InputError.at(
                where,
                "YAML aliases (*name) are not used here",
                'write it out again; a scenario shares what another says with "like: <scenario>"',
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
            self._note(where, "is a number too large to be meant")
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
        """Return a key; one that is no text is noted, and the text it is written as returned."""
        value = self._value(event, (*path, ""))
        if isinstance(value, str):
            return value
        written = source_at(self._source.text, where, _KEY) or str(value)
        message = f"key {written} is {kind_of(value)}, not text"
        hint = "" if isinstance(value, list | dict) else f'write it as "{written}"'
        self._note(where, message, hint)
        return written

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
    """Return what a scalar without quotes means in YAML 1.2; dates are text."""
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
    """Return what YAML took something for that a person may have meant as text."""
    if isinstance(value, bool):
        return "true or false"
    if isinstance(value, int | float):
        return "a number"
    return "empty" if value is None else "keys with values" if isinstance(value, dict) else "a list"


_KEY: Final = re.compile(r"[^\s:]+")


def source_at(text: str, where: Where, pattern: re.Pattern[str]) -> str:
    """Return what the file says at a place, empty when it is not what the pattern expects."""
    found = pattern.match(source_line(text, where), max(0, where.column - 1))
    return "" if found is None else found[found.lastindex or 0]


def source_line(text: str, where: Where) -> str:
    """Return the line of a text that holds a place."""
    lines = text.split("\n")
    return lines[where.line - 1] if 0 < where.line <= len(lines) else ""


def mark_place(source: SourceText, mark: Any) -> Where:
    """Return the place of a mark of PyYAML."""
    # Its offset alone: YAML 1.1 ends lines at U+0085, U+2028 and U+2029 too, where editors do not.
    return source.where(min(mark.index, len(source.text)))


# PyYAML tells its errors apart by nothing but their text.
_REMEDIES: Final = (
    ("found character", "", "put quotes around a value that starts with @ ` % & or *"),
    ("line break", "a value starts with > or |", "put the value in quotes"),
    ("chomping", "a value starts with > or |", "put the value in quotes"),
    (
        "mapping values",
        "has a second colon or is indented too far",
        "put text with a colon in quotes",
    ),
)
"""What YAML's own messages mean to a person: part of the message, our words, what to do."""


def _explain(source: SourceText, error: Any) -> Finding:
    """Return what is wrong in the words of people."""
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    if mark is None:
        first_line = str(error).splitlines()[0] if str(error) else type(error).__name__
        position = getattr(error, "position", None)
        return Finding(source.where(position or 0), f"is not valid YAML: {first_line}")
    where = mark_place(source, mark)
    problem = str(error.problem or error.context or "is not valid YAML").splitlines()[0]
    # libyaml and PyYAML's own parser say these two in words that have nothing in common.
    if source.text.startswith("\t", mark.index):
        return Finding(where, "is not valid YAML: indents with a tab", "indent with spaces")
    if mark.index >= len(source.text) and "expected" in problem.split():
        message = "is not valid YAML: ends in the middle of a list or mapping"
        return Finding(where, message, "a bracket or value is missing")
    for part, ours, hint in _REMEDIES:
        if part in problem:
            return Finding(where, f"is not valid YAML: {ours or problem}", hint)
    return Finding(where, f"is not valid YAML: {problem}")
