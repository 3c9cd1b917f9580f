"""From text to syntax tree, with syntax errors told in the words of the language."""

from __future__ import annotations

import functools
import re
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from grammars.text.diagnostics import Diagnostic, InputError, did_you_mean
from grammars.text.parsing import expected_keys, load_metamodel, offset_of
from grammars.text.source import SourceText, SyntaxNode, in_source_order

_GRAMMAR: Final = Path(__file__).with_name("variation.tx")
_MOST_ERRORS: Final = 20
_LONGEST: Final = 40
_DEEPEST: Final = 30
_LARGEST: Final = 200_000

_COMMENT: Final = re.compile(r"(\"[^\"\n]*\"|'[^'\n]*')|//[^\n]*")
_START: Final = re.compile(
    r"import\s*[\"']|let\s+[^\d\W]\w*(?!\w|\s*[:.])|require(?!\w)(?!\s*:)|[^\d\W]\w*(?:\s*\.\s*[^\d\W]\w*)*\s*:"
)
_BRACE: Final = re.compile(r"[{}]")
_TOKEN: Final = re.compile(r"[+-]?[\d.]*\d[\w.]*|\w+|\S")
_DISTRIBUTIONS: Final = ("uniform", "discrete", "normal")
_WORDS: Final = {
    "ID": "a name",
    "REAL": "a number",
    "UNSIGNED": "a number",
    "UNIT": "a unit (m, rad or deg)",
    "QUOTED": "a file name in quotes",
    "COMPARISON": "a comparison (<=, <, >=, > or ==)",
    "LET": '"let"',
    "REQUIRE": '"require"',
    "EOF": "the end of the file",
}
_CONTINUES: Final = {"UNIT", ".", "[+-]", "[*\\/]", "EOF"}
_HINTS: Final = {
    "#": "comments start with //",
    "/": "comments start with // and end with the line",
    ";": "statements end without a mark",
    "range": "a range is written uniform(0.8 .. 1.2)",
    "std": 'mean and standard deviation belong together: "normal(mean=1.0, std=0.2)"',
}


@functools.cache
def _metamodel() -> Any:
    return load_metamodel(_GRAMMAR)


def parse(source: SourceText) -> SyntaxNode:
    """Return the syntax tree of ``source``.

    Raises :class:`InputError` with one diagnostic per statement that cannot be read: after a
    syntax error the statement it lies in is blanked out and the rest is read again.
    """
    from textx import TextXSyntaxError

    _refuse_oversized(source)
    text = source.text
    errors: list[Diagnostic] = []
    blocks = _statements(text)
    while len(errors) < _MOST_ERRORS:
        try:
            tree = _metamodel().model_from_str(text)
        except TextXSyntaxError as error:
            offset = offset_of(text, error.line, error.col)
            keys = expected_keys(error.expected_rules, _WORDS)
            errors.append(_explain(source, text, offset, keys))
            # What stands where a statement may begin is wrong itself; else the one before it is.
            last = offset if "LET" in keys else offset - 1
            block = next((b for b in reversed(blocks) if b[0] <= last), None)
            if block is None:
                break
            text = text[: block[0]] + _blank(text[slice(*block)]) + text[block[1] :]
            blocks.remove(block)
        else:
            if not errors:
                return tree
            break
    raise InputError(in_source_order(errors))


def without_comments(text: str) -> str:
    """Return ``text`` with every comment replaced by as many blanks."""
    return _COMMENT.sub(lambda found: found[1] or " " * len(found[0]), text)


def _refuse_oversized(source: SourceText) -> None:
    """Refuse what nobody could read: the parser recurses on parentheses."""
    if len(source.text) > _LARGEST:
        raise InputError(Diagnostic(source.where(0), f"is longer than {_LARGEST} characters"))
    depth = 0
    for match in re.finditer(r"[()]|-(?=\s*-)", without_comments(source.text)):
        depth += {"(": 1, ")": -1}.get(match[0], 0)
        if depth > _DEEPEST:
            place = source.where(match.start())
            message = f"parentheses are nested deeper than {_DEEPEST}"
            raise InputError(Diagnostic(place, message, "name parts of it with let"))
    signs = re.search(rf"(?:-\s*){{{_DEEPEST},}}", without_comments(source.text))
    if signs:
        raise InputError(Diagnostic(source.where(signs.start()), "too many signs in a row"))


def _statements(text: str) -> list[tuple[int, int]]:
    """Return start and end of every statement outside of braces."""
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
    return list(pairwise([*starts, len(text)]))


def _blank(text: str) -> str:
    return re.sub(r"[^\n]", " ", text)


def _explain(source: SourceText, text: str, offset: int, keys: set[str]) -> Diagnostic:
    found = _TOKEN.match(text, offset)
    word = found.group() if found else ""
    before = without_comments(text[:offset])
    done = before.rstrip()
    if done and "LET" not in keys and (not word or "\n" in before[len(done) :]):
        last = re.split(r"\s", done)[-1][-_LONGEST:]
        message = f'expected {_expected(keys)} after "{last}"'
        return Diagnostic(source.where(len(done)), message, _hint("", done, keys))
    shown = f'"{word[:_LONGEST]}"' if word else "the end of the file"
    message = f"unexpected {shown}; expected {_expected(keys)}"
    return Diagnostic(source.where(offset), message, _hint(word, done, keys))


def _expected(keys: set[str]) -> str:
    left = {key for key in keys if not key.startswith("(abs")}
    phrases: list[str] = []
    if {"LET", "REQUIRE"} <= left:
        phrases.append("the next statement")
        left -= {"LET", "REQUIRE", "import", "ID", *_CONTINUES}
    elif left >= set(_DISTRIBUTIONS):
        phrases.append("a distribution (uniform, discrete or normal)")
        left -= {*_DISTRIBUTIONS, "(", "-", "UNSIGNED"}
    elif len(left) > 1 and not left <= _CONTINUES:
        left -= _CONTINUES
    phrases = sorted({_WORDS.get(key, f'"{key}"') for key in left}) + phrases
    if not phrases:
        return "something else"
    return phrases[0] if len(phrases) == 1 else f"{', '.join(phrases[:-1])} or {phrases[-1]}"


def _hint(word: str, done: str, keys: set[str]) -> str:
    """Return advice on ``word``, which follows ``done`` where ``keys`` were expected."""
    if not done:
        return 'a variation starts with the plan it varies: import "plan.fpm"'
    if word in _HINTS:
        return _HINTS[word]
    last = re.search(r"\w*$", done)
    if word == "(" and last and last[0] not in _DISTRIBUTIONS:
        return did_you_mean(last[0], _DISTRIBUTIONS)
    if done.endswith(",") and word in ("]", ")"):
        return "no comma behind the last one"
    if word == "," and "," not in keys and done.endswith(")"):
        return "statements and attributes are not separated by commas"
    if re.search(r"[\d.]$", done) and re.match(r"[^\W\d]", word) and "UNIT" in keys:
        return "lengths are in metres (m), angles in deg or rad"
    if re.match(r"[+-]?[\d.]+[^\W\d]", word):
        return "write a blank between a number and its unit: 4.0 m"
    if re.search(r"uniform\s*\(\s*[^\[\s][^\n]*$", done):
        return "a list is written uniform([1.0, 2.0]), a range uniform(1.0 .. 2.0)"
    known = sorted(key for key in keys - set(_WORDS) if key.isalpha())
    close = did_you_mean(word, known) if word else ""
    return close if close.startswith("did") else ""
