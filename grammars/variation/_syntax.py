"""Parser of the variation language, with messages for its syntax errors."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from grammars.text.diagnostics import (
    InputError,
    SourceText,
    SyntaxNode,
    closest,
    did_you_mean,
)
from grammars.text.parsing import Language, SyntaxFault, without_comments

DISTRIBUTIONS: Final = ("Uniform", "Discrete", "Normal")
"""Rules of distributions; other values are sums."""
_LARGEST: Final = 200_000

_START: Final = re.compile(
    r"import\s*[\"']|let\s+[^\d\W]\w*(?!\w|\s*[:.])|require(?!\w)(?!\s*:)|[^\d\W]\w*(?:\s*\.\s*[^\d\W]\w*){0,9}\s*:"
)
"""Start of a statement. The bounded number of name parts keeps the search fast."""
_BRACE: Final = re.compile(r"[{}]")
_DISTRIBUTIONS: Final = tuple(map(str.lower, DISTRIBUTIONS))
FUNCTIONS: Final = ("abs", "min", "max", "distance")
_WORDS: Final = {
    "ID": "a name",
    "Name": "a name",
    "REAL": "a number",
    "UNSIGNED": "a number",
    "UNIT": "a unit (such as m, cm or deg)",
    "QUOTED": "a file name in quotes",
    "EOF": "the end of the file",
}
_CONTINUES: Final = {"UNIT", ".", "[+-]", "[*\\/]", "EOF"}
_HINTS: Final = {
    "#": "comments start with //",
    "/": "comments start with // and end with the line",
    ";": "statements end without a mark",
    "range": "write a range as uniform(0.8 .. 1.2)",
    "std": 'mean and standard deviation belong together: "normal(mean=1.0, std=0.2)"',
}


class _VariationLanguage(Language):
    words = _WORDS
    openers = frozenset({"let"})

    def statement_starts(self, text: str) -> Sequence[int]:
        """Return the offsets of statements outside braces."""
        bare = without_comments(text)
        starts, depth, at = [], 0, 0
        while at < len(bare):
            brace = _BRACE.match(bare, at)
            inside = depth > 0 or (at > 0 and re.match(r"[\w.]", bare[at - 1]) is not None)
            start = None if inside else _START.match(bare, at)
            if brace:
                depth = max(0, depth + (1 if brace[0] == "{" else -1))
            if start:
                starts.append(at)
            at = start.end() if start else at + 1
        return starts

    def ends_early(self, fault: SyntaxFault) -> bool:
        at_end = bool(fault.done) and not fault.word and "let" not in fault.expected
        return at_end or super().ends_early(fault)

    def phrases(self, fault: SyntaxFault) -> Sequence[str]:
        keys = {key for key in fault.expected if not key.startswith("(abs")}
        phrases: list[str] = []
        if {"let", "require"} <= keys:
            phrases.append("the next statement")
            keys -= {"let", "require", "import", "ID", *_CONTINUES}
        elif keys >= set(_DISTRIBUTIONS):
            phrases.append("a distribution (uniform, discrete or normal)")
            keys -= {*_DISTRIBUTIONS, "(", "-", "UNSIGNED"}
        elif len(keys) > 1 and not keys <= _CONTINUES:
            keys -= _CONTINUES
        phrases = sorted({_WORDS.get(key, f'"{key}"') for key in keys}) + phrases
        return phrases or ["something else"]

    def hint(self, fault: SyntaxFault) -> str:
        word, done, keys = fault.word, fault.done, fault.expected
        if not done:
            return 'a variation starts with the plan it varies: import "plan.fpm"'
        if re.search(r"\bfor$", done):
            return "a variation names each element of a loop: room_1: { … }"
        if word in _HINTS:
            return _HINTS[word]
        function = re.search(r"(\w+)\s*\([^()]*$", done)
        if function and function[1] not in (*_DISTRIBUTIONS, *FUNCTIONS):
            return did_you_mean(function[1], _DISTRIBUTIONS)
        if done.endswith(",") and word in ("]", ")"):
            return "remove the comma after the last value"
        if word == "," and "," not in keys and done.endswith(")"):
            return "do not separate statements and attributes by commas"
        if re.search(r"[\d.]$", done) and re.match(r"[^\W\d]", word) and "UNIT" in keys:
            return "lengths are in m, cm or mm, angles in deg or rad"
        if re.match(r"[+-]?[\d.]+[^\W\d]", word):
            return "write a blank between a number and its unit: 4.0 m"
        if re.search(r"uniform\s*\(\s*[^\[\s][^\n]*$", done):
            return "write a list as uniform([1.0, 2.0]), a range as uniform(1.0 .. 2.0)"
        close = closest(word, (key for key in set(keys) - set(_WORDS) if key.isalpha()))
        return f'did you mean "{close}"?' if close else ""


_LANGUAGE: Final = _VariationLanguage(Path(__file__).with_name("variation.tx"), autokwd=True)


def parse(source: SourceText) -> SyntaxNode:
    """Return the syntax tree of ``source``.

    Raises :class:`InputError` with one finding per invalid statement.
    """
    if len(source.text) > _LARGEST:
        raise InputError.at(source.where(0), f"is longer than {_LARGEST} characters")
    return _LANGUAGE.parse(source)
