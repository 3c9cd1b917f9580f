"""Loops in the text of a language: ``for i in 1..6 { … room_{i} … {2.5 * i} m … }``.

The text inside the outer braces is read once for every number. Inner braces hold arithmetic with
the counters. A language reads the repeated text; places in it are those of the written one.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from grammars.text.diagnostics import (
    Findings,
    InputError,
    RepeatedPlace,
    SourceText,
    Where,
    did_you_mean,
)
from grammars.text.expression_check import DimensionCheck, MaybeKind, Unknown
from grammars.text.expressions import (
    Expression,
    ExpressionLanguage,
    Name,
    evaluate,
    read_expression,
)
from grammars.text.parsing import without_comments
from grammars.text.units import RATIO

_MARK: Final = re.compile(
    r"(?<![\w.])for\s+(?P<name>[^\d\W]\w*)\s+in\b(?P<range>[^{}\n]*(?:\n\s*(?={))?)|[{}]"
)
_RANGE: Final = re.compile(r"\s*([+-]?\w+)\s*\.\.\s*([+-]?\w+)\s*")
_FORM: Final = "write for i in 1..6 { … }"
_LARGEST: Final = 500_000
"""Characters of a repeated text at most."""
_DEEPEST: Final = 5
_LANGUAGE: Final = ExpressionLanguage(Path(__file__).with_name("loops.tx"), autokwd=True)

_Counters = Mapping[str, int]


class RepeatedText(SourceText):
    """A text with all loops written out; its places are those of the original text."""

    def __init__(self, source: SourceText, pieces: list[tuple[str, int, str]]) -> None:
        super().__init__("".join(text for text, _, _ in pieces), source.file)
        self._source = source
        self._pieces = pieces
        self._begins = [0]
        for text, _, _ in pieces:
            self._begins.append(self._begins[-1] + len(text))

    def where(self, offset: int) -> Where:
        """Return the original place of a character; it names the counters."""
        number = min(bisect_right(self._begins, offset), len(self._pieces)) - 1
        text, original, turn = self._pieces[number]
        inside = min(offset - self._begins[number], len(text))
        place = self._source.where(original + inside)
        return _turned(place, turn) if turn else place


def repeated(source: SourceText) -> SourceText:
    """Return the text with all loops written out; raises :class:`InputError`."""
    bare = without_comments(source.text)
    if _MARK.search(bare) is None:
        return source
    writer = _Writer(source, bare)
    writer.write(0, len(bare), {})
    return RepeatedText(source, writer.pieces)


class _Writer:
    """Writes the loops of a text out; ``bare`` is the text without comments."""

    def __init__(self, source: SourceText, bare: str) -> None:
        self.pieces: list[tuple[str, int, str]] = []
        """Parts of the text, their offsets in the original, and the counters there."""
        self._source, self._bare = source, bare
        self._size = 0
        self._sums: dict[int, tuple[Expression, str]] = {}
        """Contents of braces by their offset, each with the unit of its value."""

    def _refusal(self, offset: int, message: str, hint: str = "") -> InputError:
        return InputError.at(self._source.where(offset), message, hint)

    def write(self, start: int, end: int, counters: _Counters, indent: str = "") -> None:
        """Write a part of the text for the given values of the counters."""
        at = start
        while mark := _MARK.search(self._bare, at, end):
            self._copy(at, mark.start(), counters, indent)
            if mark["name"]:
                at = self._repeat(mark, end, counters)
            elif mark[0] == "}":
                raise self._refusal(mark.start(), '"}" closes nothing', "remove it")
            elif not counters:
                message = '"{" needs a loop around it'
                raise self._refusal(mark.start(), message, _FORM)
            else:
                at = self._closing(mark.start(), end) + 1
                self._add(self._number(mark.start(), at - 1, counters), mark.start(), counters)
        self._copy(at, end, counters, indent)

    def _repeat(self, mark: re.Match[str], end: int, counters: _Counters) -> int:
        """Write a loop and return the offset behind it."""
        name, opening = mark["name"], mark.end()
        bounds = _RANGE.fullmatch(mark["range"])
        if bounds is None or self._bare[opening : opening + 1] != "{":
            words = " ".join(mark[0].split())
            raise self._refusal(mark.start(), f'"{words}" is not a loop', _FORM)
        if name in counters or len(counters) == _DEEPEST:
            problem = "counts already" if name in counters else "is nested too deeply"
            raise self._refusal(mark.start("name"), f"{name} {problem}", "choose another form")
        low, high = (self._bound(mark, word, counters) for word in bounds.groups())
        if low > high:
            hint = f"write {name} in {high}..{low}"
            raise self._refusal(mark.start(), f"{low}..{high} repeats nothing", hint)
        closing = self._closing(opening, end)
        body = re.compile(r"[ \t]*(?:\n\s*?(?=[ \t]*\S)([ \t]*))?").match(self._bare, opening + 1)
        assert body is not None
        for value in range(low, high + 1):
            inner = {**counters, name: value}
            self.write(min(body.end(), closing), closing, inner, body[1] or "")
            # A comment ends here, and statements begin on a line of their own.
            self._add("\n", closing, inner)
        return closing + 1

    def _bound(self, mark: re.Match[str], word: str, counters: _Counters) -> int:
        if word in counters:
            return counters[word]
        if re.fullmatch(r"[+-]?[0-9]{1,6}", word) is None:
            message = f"a loop counts whole numbers, not {word}"
            raise self._refusal(mark.start("range"), message, _FORM)
        return int(word)

    def _closing(self, opening: int, end: int) -> int:
        """Return the offset of the brace that closes the one at ``opening``."""
        depth = 0
        for brace in re.compile(r"[{}]").finditer(self._bare, opening, end):
            depth += 1 if brace[0] == "{" else -1
            if depth == 0:
                return brace.start()
        raise self._refusal(opening, '"{" is never closed', 'add "}" at its end')

    def _number(self, opening: int, closing: int, counters: _Counters) -> str:
        """Return the value of the braces from ``opening`` to ``closing`` as text."""
        written = self._bare[opening + 1 : closing]
        if opening not in self._sums:
            self._sums[opening] = _read_sum(written, self._source.where(opening + 1), counters)
        expression, unit = self._sums[opening]
        number = evaluate(expression, lambda name: float(counters[name.name]))
        within_name = re.match(r"\w", self._bare[opening - 1]) is not None
        if not math.isfinite(number) or (within_name and (number < 0 or number % 1 or unit)):
            shown = "no number" if math.isnan(number) else f"{number:g}{unit}"
            value = f"{{{written.strip()}}} is {shown}"
            message = f"a name needs a whole number, {value}" if within_name else value
            raise InputError.at(_turned(self._source.where(opening), _turn(counters)), message)
        return f"{number + 0.0:.15g}{unit}"

    def _copy(self, start: int, end: int, counters: _Counters, indent: str) -> None:
        """Copy a part of the text, without the indentation of a repeated one."""
        if not counters:
            self._add(self._source.text[start:end], start, counters)
            return
        for line in re.compile(r"[^\n]*\n|[^\n]+").finditer(self._source.text, start, end):
            begin = line.start()
            is_indented = self._source.text[begin - 1] == "\n" and line[0].startswith(indent)
            begin += len(indent) if is_indented else 0
            self._add(self._source.text[begin : line.end()], begin, counters)

    def _add(self, text: str, offset: int, counters: _Counters) -> None:
        self._size += len(text)
        if self._size > _LARGEST:
            raise self._refusal(offset, "the loops make a text that is too long")
        self.pieces.append((text, offset, _turn(counters)))


def _turn(counters: _Counters) -> str:
    return ", ".join(f"{name} = {value}" for name, value in counters.items())


def _turned(place: Where, turn: str) -> Where:
    return RepeatedPlace(place.file, place.line, place.column, turn)


def _read_sum(written: str, where: Where, counters: _Counters) -> tuple[Expression, str]:
    """Return the content of braces and the unit of its value; raises :class:`InputError`."""
    text = SourceText(written, where.file, within=where)
    findings = Findings(text)

    def kind_of_name(name: Name) -> MaybeKind:
        if name.name in counters and not name.arguments:
            return RATIO
        message = f'braces know only numbers and counters, not "{name.name}"'
        findings.error(text.where(name.column), message, did_you_mean(name.name, counters))
        return Unknown.UNKNOWN

    expression = read_expression(_LANGUAGE.parse(text).sum, text)
    dimension = DimensionCheck(text, findings, kind_of_name).quantity(expression)
    findings.raise_errors()
    return expression, "" if dimension in (RATIO, None) else f" {dimension.unit}"
