"""The front end of our languages: from text to the syntax tree of textX, or to syntax errors.

A :class:`Language` is a grammar together with the words for its syntax errors.
"""

from __future__ import annotations

import functools
import re
import threading
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar, Final

from grammars.text.diagnostics import (
    Finding,
    Findings,
    InputError,
    SourceText,
    SyntaxNode,
    Where,
)
from grammars.text.look_alikes import look_alike
from grammars.text.units import FACTOR, UNIT
from grammars.text.words import enumerate_words

_MOST_ERRORS: Final = 20
_LONGEST: Final = 40
"""Characters that a message quotes of a wrong word."""
_COMMENT: Final = re.compile(r"(\"[^\"\n]*\"|'[^'\n]*')|//[^\n]*")

_BRACKET: Final = re.compile(r"[()\[\]{}]")
_CLOSING: Final = {"(": ")", "[": "]", "{": "}"}
_SIGN: Final = re.compile(r"\S|[^\S \t\r\n]")
_EXPRESSIONS: Final = Path(__file__).with_name("expressions.tx")

# textX reads all grammars with one parser, cached for the whole process: two threads that load
# languages at once disturb each other's parse tree.
_TEXTX_LOCK: Final = threading.Lock()


def load_metamodel(grammar: Path, *, autokwd: bool = False) -> Any:
    """Return the textX metamodel of a language; safe from any thread."""
    from textx import metamodel_from_str

    text = grammar_text(grammar)
    with _TEXTX_LOCK:
        return metamodel_from_str(text, autokwd=autokwd)


def grammar_text(grammar: Path) -> str:
    """Return a grammar with the shared parts of all languages filled in.

    ``{expressions}`` stands for the rules of ``expressions.tx`` that the grammar does not define.
    In patterns, ``{unit}`` stands for a product of units (:mod:`grammars.text.units`), ``{factor}``
    for one factor of it, ``{keyword}`` for any quoted word of the grammar.
    """
    text = grammar.read_text(encoding="utf-8")
    if "{expressions}" in text:
        own = re.findall(r"(?m)^(\w+):", text)
        _, *rules = re.split(r"(?m)^(?=\w+:)", _EXPRESSIONS.read_text(encoding="utf-8"))
        shared = [rule for rule in rules if rule.partition(":")[0] not in own]
        text = text.replace("{expressions}", "".join(shared))
    keyword = "|".join(keywords_of(text))
    for name, pattern in (("{unit}", UNIT), ("{factor}", FACTOR), ("{keyword}", keyword)):
        text = text.replace(name, f"(?:{pattern})".replace("/", r"\/"))
    return text


def keywords_of(grammar: str) -> list[str]:
    """Return the quoted words of a grammar."""
    return sorted(set(re.findall(r"'([a-z]+)'", grammar)))


def without_comments(text: str) -> str:
    """Return ``text`` with every comment replaced by as many blanks; quoted text stays."""
    return _COMMENT.sub(lambda match: match[1] or " " * len(match[0]), text)


@dataclass(frozen=True, slots=True)
class SyntaxFault:
    """The place where a parser stopped, and its expectations there.

    ``word`` stands at ``offset`` of ``text`` (empty at its end); ``done`` is the text read so far
    without trailing blanks and comments. ``expected`` has keywords and patterns of the grammar, and
    the names of rules that have an entry in ``Language.words``.
    """

    text: str
    offset: int
    word: str
    done: str
    expected: tuple[str, ...]

    @property
    def rest(self) -> str:
        """The unread text."""
        return self.text[self.offset :] if self.word else ""

    @property
    def on_new_line(self) -> bool:
        """``True`` if a line ends between the read and the unread text."""
        return "\n" in without_comments(self.text[: self.offset])[len(self.done) :]


class Language:
    """A language with a textX grammar.

    Subclasses define how statements begin and how errors read. This class defines words, the places
    of errors, and how many errors one pass reports.
    """

    words: ClassVar[Mapping[str, str]] = {}
    """Names of rules and patterns of the grammar in messages."""
    openers: ClassVar[frozenset[str]] = frozenset()
    """Expected keys with which a statement begins; empty if an error ends the reading."""
    token: ClassVar = re.compile(r"[+-]?[\d.]*\d[\w.]*|\w+|\S")
    """Pattern of the word that a message quotes from unreadable text."""

    def __init__(self, grammar: Path, *, autokwd: bool = False) -> None:
        self._grammar = grammar
        self._autokwd = autokwd

    @functools.cached_property
    def _metamodel(self) -> Any:
        return load_metamodel(self._grammar, autokwd=self._autokwd)

    def parse(self, source: SourceText) -> SyntaxNode:
        """Return the syntax tree of ``source``; raises :class:`InputError` with every error."""
        findings = Findings(source)
        tree = self.parse_sound(source, findings)
        findings.raise_errors()
        return tree

    def parse_sound(self, source: SourceText, findings: Findings) -> SyntaxNode | None:
        """Return the tree of all valid statements; ``None`` if reading ends early.

        Each invalid statement adds one error, is blanked out, and the rest is read again. Raises
        :class:`InputError` for a text that is nested too deeply.
        """
        from textx import TextXSyntaxError

        text = source.text
        starts = [*self.statement_starts(text), len(text)]
        statements = list(pairwise(starts))
        for _ in range(_MOST_ERRORS):
            try:
                return self._tree(text)
            except RecursionError as error:
                hint = self.hint(SyntaxFault(text, len(text), "", "", ()))
                raise InputError.at(_deepest(source), "is nested too deeply", hint) from error
            except TextXSyntaxError as error:
                fault = self._fault(text, error)
                findings.add([self.explain(source, fault)])
                # If a statement may begin here, this one is wrong; otherwise the previous one is.
                last = fault.offset - self.openers.isdisjoint(fault.expected)
                broken = next((s for s in reversed(statements) if s[0] <= last), None)
                if broken is None:
                    return None
                start, end = broken
                text = text[:start] + re.sub(r"[^\n]", " ", text[start:end]) + text[end:]
                statements.remove(broken)
        return None

    def _tree(self, text: str) -> SyntaxNode:
        return self._metamodel.model_from_str(text)

    def _fault(self, text: str, error: Any) -> SyntaxFault:
        offset = min(len(text), offset_of(text, error.line, error.col))
        # Foreign blanks are no token.
        word = self.token.match(text, offset) or _SIGN.match(text, offset)
        done = without_comments(text[:offset]).rstrip()
        keys = tuple(self._keys(error.expected_rules))
        return SyntaxFault(text, offset, word[0] if word else "", done, keys)

    def _keys(self, rules: Iterable[Any]) -> Iterable[str]:
        """Return the expectations of a parser, each once, without comments."""
        keys = dict.fromkeys(
            rule.rule_name
            if rule.rule_name in self.words
            else str(getattr(rule, "to_match", rule.rule_name))
            for rule in rules
        )
        # Look-ahead rules have an empty key.
        return (key for key in keys if key not in ("", "Comment") and not key.startswith(r"\/\/"))

    def explain(self, source: SourceText, fault: SyntaxFault) -> Finding:
        """Return the finding for ``fault``, at the wrong word or where a word is missing."""
        opening, is_lost = _open_bracket(fault)
        bracket = fault.text[opening : opening + 1]
        if is_lost:
            hint = f'add "{_CLOSING[bracket]}" at its end'
            return Finding(source.where(opening), f'"{bracket}" is never closed', hint)
        if self.ends_early(fault):
            last = re.split(r"\s", fault.done)[-1][-_LONGEST:]
            message = f'expected {enumerate_words(self.phrases(fault), "or")} after "{last}"'
            hint = self.hint(replace(fault, word=""))
            return Finding(source.where(len(fault.done)), message, hint)
        hint = look_alike(fault.word) or self.hint(fault)
        if bracket and not hint:
            hint = f'the "{bracket}" at {source.where(opening)} is still open'
        return Finding(source.where(fault.offset), self.message(fault), hint)

    def statement_starts(self, text: str) -> Sequence[int]:
        """Return the offsets of statements; if empty, reading ends at the first error."""
        return ()

    def ends_early(self, fault: SyntaxFault) -> bool:
        """Return whether the statement is incomplete at the end of a line."""
        starts_anew = not self.openers or not self.openers.isdisjoint(fault.expected)
        return bool(fault.done) and fault.on_new_line and not starts_anew

    def phrases(self, fault: SyntaxFault) -> Sequence[str]:
        """Return the expectations in words."""
        return sorted(self.words.get(key, f'"{key}"') for key in fault.expected)

    def message(self, fault: SyntaxFault) -> str:
        """Return the message about an unexpected word."""
        word = f'"{fault.word[:_LONGEST]}"' if fault.word else "the end of the file"
        return f"unexpected {word}; expected {enumerate_words(self.phrases(fault), 'or')}"

    def hint(self, fault: SyntaxFault) -> str:
        """Return advice on ``fault``, if any."""
        return ""


def _open_bracket(fault: SyntaxFault) -> tuple[int, bool]:
    """Return the offset of the bracket that a fault should close, and whether it is never closed.

    The offset is that of the end of the text if there is none.
    """
    opened: list[int] = []
    for match in _BRACKET.finditer(fault.done):
        if match[0] in _CLOSING:
            opened.append(match.start())
        elif opened:
            opened.pop()
    if not opened:
        return len(fault.text), False
    bracket = fault.text[opened[-1]]
    closing = _CLOSING[bracket]
    other = fault.word == bracket == "{" or fault.word in {*_CLOSING.values()} - {closing}
    if closing not in fault.expected and not other:
        return len(fault.text), False
    return opened[-1], other or fault.on_new_line or not fault.word


def _deepest(source: SourceText) -> Where:
    """Return the opening of the innermost brackets of a text, otherwise its start."""
    depth, deepest, place = 0, 0, 0
    for match in _BRACKET.finditer(without_comments(source.text)):
        depth += 1 if match[0] in "([{" else -1
        if depth > deepest:
            deepest, place = depth, match.start()
    return source.where(place)


def offset_of(text: str, line: int, column: int) -> int:
    """Return the index in ``text`` of a line and column that count from 1."""
    start = 0
    for _ in range(line - 1):
        start = text.index("\n", start) + 1
    return start + column - 1
