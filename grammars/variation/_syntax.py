"""The textX side of the variation language: its typed nodes, and syntax errors in its words."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final, Literal, TypeAlias

from grammars.text.diagnostics import (
    InputError,
    SourceText,
    SyntaxNode,
    TypedNode,
    closest,
    did_you_mean,
)
from grammars.text.parsing import Language, SyntaxFault, without_comments


class ImportNode(TypedNode):
    """``import "kitchen.fpm"``."""

    file: str


class LetNode(TypedNode):
    """``let wide = uniform(0.8 .. 1.4)``."""

    name: str
    value: ValueNode


class RequireNode(TypedNode):
    """``require hall.area >= 12 m^2``."""

    left: SumNode
    comparison: Literal["<=", "<", ">=", ">", "==", "!="]
    right: SumNode


class BlockNode(TypedNode):
    """``hall: { shape.width: wide }``; attributes have a ``path`` and a ``value``."""

    target: SyntaxNode
    attributes: list[SyntaxNode]


class SingleNode(TypedNode):
    """``ceiling: uniform([2.4, 2.7])``."""

    target: SyntaxNode
    value: ValueNode


class UniformNode(TypedNode):
    """``uniform(1.0 .. 2.0)``, or ``uniform([1.0, 2.0])`` without ``low`` and ``high``."""

    low: SyntaxNode
    high: SyntaxNode
    values: list[SyntaxNode]


class DiscreteNode(TypedNode):
    """``discrete([(0.8, 5.0), (0.2, 2.0)])``; pairs have a ``weight`` and a ``value``."""

    pairs: list[SyntaxNode]


class NormalNode(TypedNode):
    """``normal(mean=1.0, std=0.3)``; options have a ``key`` and a ``value``."""

    options: list[SyntaxNode]


class SumNode(TypedNode):
    """Products that are added; every one of ``rest`` has an ``operator`` and an ``operand``."""

    first: SyntaxNode
    rest: list[SyntaxNode]


class MinusNode(TypedNode):
    """``-x``."""

    operand: FactorNode


class GroupNode(TypedNode):
    """``(x + y)``."""

    expression: SumNode


class CallNode(TypedNode):
    """``min(x, y)``."""

    function: str
    arguments: list[SumNode]


class LiteralNode(TypedNode):
    """``0.8 m``."""

    number: str
    unit: str | None


class ReferenceNode(TypedNode):
    """``hall.pillar.height``."""

    path: SyntaxNode


DistributionNode: TypeAlias = UniformNode | DiscreteNode | NormalNode
ValueNode: TypeAlias = DistributionNode | SumNode
FactorNode: TypeAlias = MinusNode | GroupNode | CallNode | LiteralNode | ReferenceNode
NODES: Final = (
    *(ImportNode, LetNode, RequireNode, BlockNode, SingleNode),
    *(UniformNode, DiscreteNode, NormalNode),
    *(SumNode, MinusNode, GroupNode, CallNode, LiteralNode, ReferenceNode),
)


_DEEPEST: Final = 30
_LARGEST: Final = 200_000

_START: Final = re.compile(
    r"import\s*[\"']|let\s+[^\d\W]\w*(?!\w|\s*[:.])|require(?!\w)(?!\s*:)|[^\d\W]\w*(?:\s*\.\s*[^\d\W]\w*)*\s*:"
)
_BRACE: Final = re.compile(r"[{}]")
_DISTRIBUTIONS: Final = ("uniform", "discrete", "normal")
_WORDS: Final = {
    "ID": "a name",
    "REAL": "a number",
    "UNSIGNED": "a number",
    "UNIT": "a unit (such as m, cm or deg)",
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


class _VariationLanguage(Language):
    classes = NODES
    words = _WORDS
    openers = frozenset({"LET"})

    def statement_starts(self, text: str) -> Sequence[int]:
        """Return where every statement outside of braces begins."""
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
        at_end = bool(fault.done) and not fault.word and "LET" not in fault.expected
        return at_end or super().ends_early(fault)

    def phrases(self, fault: SyntaxFault) -> Sequence[str]:
        left = {key for key in fault.expected if not key.startswith("(abs")}
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
        return phrases or ["something else"]

    def hint(self, fault: SyntaxFault) -> str:
        word, done, keys = fault.word, fault.done, fault.expected
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
            return "lengths are in m, cm or mm, angles in deg or rad"
        if re.match(r"[+-]?[\d.]+[^\W\d]", word):
            return "write a blank between a number and its unit: 4.0 m"
        if re.search(r"uniform\s*\(\s*[^\[\s][^\n]*$", done):
            return "a list is written uniform([1.0, 2.0]), a range uniform(1.0 .. 2.0)"
        close = closest(word, (key for key in set(keys) - set(_WORDS) if key.isalpha()))
        return f'did you mean "{close}"?' if close else ""


_LANGUAGE: Final = _VariationLanguage(Path(__file__).with_name("variation.tx"))


def parse(source: SourceText) -> SyntaxNode:
    """Return the syntax tree of ``source``.

    Raises :class:`InputError` with one diagnostic per statement that cannot be read.
    """
    _refuse_oversized(source)
    return _LANGUAGE.parse(source)


def _refuse_oversized(source: SourceText) -> None:
    """Refuse what nobody could read: the parser recurses on parentheses."""
    if len(source.text) > _LARGEST:
        raise InputError.at(source.where(0), f"is longer than {_LARGEST} characters")
    bare = without_comments(source.text)
    depth = 0
    for match in re.finditer(r"[()]|-(?=\s*-)", bare):
        depth += {"(": 1, ")": -1}.get(match[0], 0)
        if depth > _DEEPEST:
            place = source.where(match.start())
            message = f"parentheses are nested deeper than {_DEEPEST}"
            raise InputError.at(place, message, "name parts of it with let")
    signs = re.search(rf"(?:-\s*){{{_DEEPEST},}}", bare)
    if signs:
        raise InputError.at(source.where(signs.start()), "too many signs in a row")
