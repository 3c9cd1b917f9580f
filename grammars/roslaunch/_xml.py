"""Parser of the XML in launch files: elements, attributes and text with their places.

Launch files come from outside and must neither open files nor grow without end. The parser
therefore refuses document types, and with them user-defined entities.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final
from xml.parsers import expat

from grammars.text.diagnostics import InputError, Where

_DEEPEST: Final = 50
_ATTRIBUTE: Final = re.compile(rb"\s+([^\s=<>/\"']+)\s*=\s*(\"[^\"]*\"|'[^']*')")


@dataclass(frozen=True, slots=True)
class XmlElement:
    """Element; ``text`` is its own text without that of children and comments.

    ``places`` are the places of the attributes' values, ``lines`` those of the lines of the text.
    """

    tag: str
    where: Where
    attributes: Mapping[str, str] = field(default_factory=dict)
    places: Mapping[str, Where] = field(default_factory=dict)
    children: tuple[XmlElement, ...] = ()
    text: str = ""
    lines: tuple[Where, ...] = ()

    def place(self, attribute: str) -> Where:
        """Return the place of an attribute's value, or of the element without the attribute."""
        return self.places.get(attribute, self.where)


def parse_xml(text: str, file: str) -> XmlElement:
    """Return the root of a document; messages name it ``file``.

    Raises :class:`InputError` for invalid XML, document types and too deep nesting.
    """
    builder = _Builder(file, text.encode())
    # Expat reads the text as UTF-8 regardless of its XML declaration.
    parser = expat.ParserCreate()
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.characters
    parser.StartDoctypeDeclHandler = builder.refuse_document_type
    parser.ordered_attributes = True
    builder.parser = parser
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        where = Where(file, error.lineno, error.offset + 1)
        reason = expat.ErrorString(error.code)
        raise InputError.at(where, f"is not valid XML: {reason}") from error
    return builder.root()


@dataclass(slots=True)
class _Open:
    """Element before its end."""

    tag: str
    where: Where
    attributes: dict[str, str]
    places: dict[str, Where]
    children: list[XmlElement] = field(default_factory=list)
    text: list[str] = field(default_factory=list)
    lines: list[Where] = field(default_factory=list)


class _Builder:
    """Builder of elements from the events of expat."""

    def __init__(self, file: str, data: bytes) -> None:
        self.file = file
        self.data = data
        self.parser: Any = None
        self._starts = [0, *(m.end() for m in re.finditer(b"\n", data))]
        self._open: list[_Open] = [_Open("", Where(file), {}, {})]

    def root(self) -> XmlElement:
        """Return the outermost element."""
        return self._open[0].children[0]

    def start(self, tag: str, attributes: list[str]) -> None:
        """Begin an element; ``attributes`` are alternating names and values."""
        where = self._here()
        if len(self._open) > _DEEPEST:
            raise InputError.at(where, f"is nested deeper than {_DEEPEST} levels")
        values = dict(zip(attributes[::2], attributes[1::2], strict=True))
        self._open.append(_Open(tag, where, values, self._attribute_places(tag)))

    def end(self, _: str) -> None:
        """End the innermost element."""
        element = self._open.pop()
        self._open[-1].children.append(
            XmlElement(
                element.tag, element.where, element.attributes, element.places,
                tuple(element.children), "".join(element.text), tuple(element.lines),
            )
        )  # fmt: skip

    def characters(self, data: str) -> None:
        """Add text; expat reports it in pieces of at most a line."""
        element = self._open[-1]
        if not element.text or element.text[-1].endswith("\n"):
            element.lines.append(self._here())
        element.text.append(data)

    def refuse_document_type(self, *_: object) -> None:
        """Refuse a document type."""
        message = "has a document type (DOCTYPE), which launch files do not need"
        raise InputError.at(self._here(), message, "remove it")

    def _here(self) -> Where:
        return Where(self.file, self.parser.CurrentLineNumber, self.parser.CurrentColumnNumber + 1)

    def _attribute_places(self, tag: str) -> dict[str, Where]:
        """Return the places of the attributes' values of the current element."""
        position = self.parser.CurrentByteIndex + 1 + len(tag.encode())
        places = {}
        while match := _ATTRIBUTE.match(self.data, position):
            position = match.end()
            places[match[1].decode()] = self._at(match.start(2) + 1)
        return places

    def _at(self, offset: int) -> Where:
        line = bisect_right(self._starts, offset)
        begin = self._starts[line - 1]
        return Where(self.file, line, len(self.data[begin:offset].decode(errors="replace")) + 1)
