"""Messages for people (place, problem, remedy) and the source texts they point into."""

from __future__ import annotations

import difflib
import re
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, Final, TypeAlias, TypeVar

from grammars.text.look_alikes import look_alike, plain_text
from grammars.text.terminal_text import spell_out

T = TypeVar("T")


class Severity(StrEnum):
    """Severity of a finding: errors stop the work, warnings do not."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True, slots=True)
class Where:
    """A place in a source text; lines and columns count from 1 and are 0 if unknown."""

    file: str
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        parts = [self.file]
        if self.line:
            parts.append(str(self.line))
            if self.column:
                parts.append(str(self.column))
        return ":".join(parts)


@dataclass(frozen=True, slots=True)
class RepeatedPlace(Where):
    """A place in a repeated text; ``turn`` names the turn of a loop, such as ``i = 3``."""

    turn: str = field(default="", compare=False)


def turn_of(place: Where) -> str:
    """Return the turn of a loop that a place is in, empty outside of loops."""
    return place.turn if isinstance(place, RepeatedPlace) else ""


_LONGEST_SHOWN: Final = 4_000


def _shortened(text: str) -> str:
    half = _LONGEST_SHOWN // 2
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:half]} … {text[-half:]}"


@dataclass(frozen=True, slots=True)
class Finding:
    """A problem in a file: ``where: message``, with an optional hint on how to solve it.

    Message and hint are safe for a terminal and bounded in length, even if they quote other text.
    The message names the turn of a repeated text.
    """

    where: Where
    message: str
    hint: str = ""
    severity: Severity = Severity.ERROR

    def __post_init__(self) -> None:
        name = turn_of(self.where)
        turn = f" ({name})" if name else ""
        message = self.message.removesuffix(turn) + turn
        object.__setattr__(self, "message", _shortened(spell_out(message)))
        object.__setattr__(self, "hint", _shortened(spell_out(self.hint)))

    def __str__(self) -> str:
        label = "warning: " if self.severity is Severity.WARNING else ""
        hint = f"\n    {self.hint}" if self.hint else ""
        return f"{spell_out(str(self.where))}: {label}{self.message}{hint}"


class ScenarioError(Exception):
    """Base class of all errors of this project (:mod:`scenario_tui.errors`)."""


class InputError(ScenarioError):
    """Unusable input of a person; ``findings`` has all reasons."""

    def __init__(self, findings: Finding | Iterable[Finding]) -> None:
        self.findings = (findings,) if isinstance(findings, Finding) else tuple(findings)
        super().__init__("\n".join(map(str, self.findings)))

    @classmethod
    @contextmanager
    def keeping(cls, warnings: Iterable[Finding]) -> Iterator[None]:
        """Add ``warnings`` that were found so far to an error that ends the block."""
        try:
            yield
        except cls as error:
            error.findings = tuple(dict.fromkeys((*error.findings, *warnings)))
            error.args = ("\n".join(map(str, error.findings)),)
            raise

    def __reduce__(self) -> tuple[Any, ...]:
        # Errors travel between processes, and subclasses take other arguments.
        return _restore_error, (type(self), self.findings)

    @classmethod
    def at(cls, where: Where, message: str, hint: str = "") -> InputError:
        """Return an error with a single finding."""
        return cls(Finding(where, message, hint))


def _restore_error(kind: type[InputError], findings: tuple[Finding, ...]) -> InputError:
    error = kind.__new__(kind)
    InputError.__init__(error, findings)
    return error


def raise_all(problems: Iterable[Finding]) -> None:
    """Raise :class:`InputError` with the problems, each once, if there are any."""
    findings = each_once(problems)
    if findings:
        raise InputError(findings)


def each_once(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return each finding once; of a repeated text, that of the first turn with the number more."""
    alike: dict[object, list[Finding]] = {}
    for one in dict.fromkeys(findings):
        numbers = _NUMBER.sub("#", one.message) if turn_of(one.where) else one.message
        alike.setdefault((one.where, one.severity, numbers), []).append(one)
    return tuple(_with_turns(first, len(others)) for first, *others in alike.values())


def _with_turns(first: Finding, others: int) -> Finding:
    if not others or not turn_of(first.where):
        return first
    turns = f"the same in {others} more turn{'s' * (others > 1)}"
    return replace(first, hint=f"{first.hint}; {turns}" if first.hint else turns)


_NUMBER: Final = re.compile(r"\d+(?:\.\d+)?")


def gather(makes: Iterable[Callable[[], T]]) -> list[T]:
    """Return the results of all calls; raises :class:`InputError` with the errors of all."""
    results: list[T] = []
    findings = Findings()
    for make in makes:
        with findings.collecting():
            results.append(make())
    findings.raise_errors()
    return results


_LONGEST_WORD: Final = 80
"""Longest word to compare: the time grows with the square of the length."""
_MOST_WORDS: Final = 2_000


def with_article(noun: str) -> str:
    """Return ``a space``, ``an entryway``."""
    return f"{'an' if noun[0] in 'aeiouAEIO' else 'a'} {noun}"


def closest(word: str, words: Iterable[str]) -> str:
    """Return the entry of ``words`` closest to ``word``, or an empty text if none is close."""
    if len(word) > _LONGEST_WORD:
        return ""
    close = difflib.get_close_matches(word, sorted(set(words))[:_MOST_WORDS], n=1, cutoff=0.6)
    return close[0] if close else ""


def did_you_mean(word: str, words: Iterable[str]) -> str:
    """Return ``did you mean "x"?`` for the closest of the known ``words``, otherwise a list."""
    candidates = sorted(set(words))
    close = closest(plain_text(word), candidates) or closest(word, candidates)
    if close:
        alike = plain_text(close) == plain_text(word)
        note = f" {look_alike(word) or look_alike(close)}" if alike else ""
        return f'did you mean "{close}"?{note.rstrip()}'
    if not candidates:
        return ""
    return f"known here: {', '.join(candidates[:12])}{', …' if len(candidates) > 12 else ''}"


SyntaxNode: TypeAlias = Any
"""A node of the textX model; its attributes are those of its rule in the grammar."""


def rule_of(node: SyntaxNode) -> str:
    """Return the name of the rule of a node."""
    return type(node).__name__


class SourceText:
    """A named text that converts offsets to lines and columns.

    ``within`` is the start of a text that is a part of a file. Offsets into such a text are exact
    only if it has one line, since the file lays out further lines.
    """

    def __init__(self, text: str, file: str, *, within: Where | None = None) -> None:
        self.text = text
        self.file = file
        self._within = within
        # textX counts only "\n" as a line end; str.splitlines has more.
        self._starts = [0, *(match.end() for match in re.finditer("\n", text))]

    @property
    def whole(self) -> Where:
        """The place of the text as a whole."""
        return self._within or Where(self.file)

    def where(self, offset: int) -> Where:
        """Return the line and column (from 1) of a character offset (from 0)."""
        start = self._within
        if start is not None:
            column = (start.column or 1) + offset
            unknown = len(self._starts) > 1 or (start.line and not start.column)
            return start if unknown else Where(start.file, start.line, column)
        line = bisect_right(self._starts, offset)
        return Where(self.file, line, offset - self._starts[line - 1] + 1)

    def at(self, node: SyntaxNode) -> Where:
        """Return the start of a node of the syntax tree."""
        return self.where(node._tx_position)


class Findings:
    """Errors and warnings about input of people, in the order of their discovery.

    A place is a :class:`Where`, or a node of the syntax tree of ``source``.
    """

    def __init__(self, source: SourceText | None = None) -> None:
        self._source = source
        self._all: list[Finding] = []

    @property
    def all(self) -> tuple[Finding, ...]:
        """All findings, each once, in the order of their discovery."""
        return each_once(self._all)

    @property
    def errors(self) -> tuple[Finding, ...]:
        """The errors, in source order."""
        return in_source_order(d for d in self.all if d.severity is Severity.ERROR)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """The warnings, in source order."""
        return in_source_order(d for d in self.all if d.severity is Severity.WARNING)

    def where(self, place: SyntaxNode | Where) -> Where:
        """Return the place of a node."""
        if isinstance(place, Where):
            return place
        assert self._source is not None
        return self._source.at(place)

    def error(self, place: SyntaxNode | Where, message: str, hint: str = "") -> None:
        """Add an error, which :meth:`raise_errors` will raise."""
        self._all.append(Finding(self.where(place), message, hint))

    def warning(self, place: SyntaxNode | Where, message: str, hint: str = "") -> None:
        """Add a warning about valid input whose meaning is probably not the intended one."""
        self._all.append(Finding(self.where(place), message, hint, Severity.WARNING))

    def add(self, findings: Iterable[Finding]) -> None:
        """Add the findings of another reader or checker."""
        self._all.extend(findings)

    @contextmanager
    def collecting(self) -> Iterator[None]:
        """Add the findings of an :class:`InputError` that ends the block, and continue after it."""
        try:
            yield
        except InputError as error:
            self.add(error.findings)

    def raise_errors(self) -> None:
        """Raise :class:`InputError` with all errors and warnings, each once, if any is an error."""
        if self.errors:
            raise_all(in_source_order(self.errors + self.warnings))


def in_source_order(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the findings sorted by place; files come in the order of their first finding.

    Findings of one place keep their order.
    """
    everything = tuple(findings)
    files = list(dict.fromkeys(finding.where.file for finding in everything))
    return tuple(
        sorted(everything, key=lambda f: (files.index(f.where.file), f.where.line, f.where.column))
    )
