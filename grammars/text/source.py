"""Source texts of our languages: places in them, and the diagnostics collected while reading."""

from __future__ import annotations

import re
from bisect import bisect_right
from typing import Any, TypeAlias

from grammars.text.diagnostics import Diagnostic, InputError, Severity, Where

SyntaxNode: TypeAlias = Any
"""A node of the textX model; its attributes are those of its rule in the grammar."""


class TypedNode:
    """A node of the textX model with a class of its own; textX fills in what its rule assigns."""

    _tx_position: int
    _tx_position_end: int

    def __init__(self, parent: object = None, **written: Any) -> None:
        vars(self).update(written)


class SourceText:
    """A text with a name, able to tell line and column of any offset.

    ``within`` is where the text begins when it is a part of its file. Only a text of one line can
    then say more than that: the layout of further lines is up to the file around it.
    """

    def __init__(self, text: str, file: str, *, within: Where | None = None) -> None:
        self.text = text
        self.file = file
        self._within = within
        # textX counts lines by "\n" alone; str.splitlines would find more of them.
        self._starts = [0, *(match.end() for match in re.finditer("\n", text))]

    @property
    def whole(self) -> Where:
        """The place of the text as a whole."""
        return self._within or Where(self.file)

    def where(self, offset: int) -> Where:
        """Return line and column (from 1) of a character offset (from 0)."""
        start = self._within
        if start is not None:
            column = (start.column or 1) + offset
            return start if len(self._starts) > 1 else Where(start.file, start.line, column)
        line = bisect_right(self._starts, offset)
        return Where(self.file, line, offset - self._starts[line - 1] + 1)

    def at(self, node: SyntaxNode) -> Where:
        """Return the place where a node of the syntax tree starts."""
        return self.where(node._tx_position)


class DiagnosticCollector:
    """Errors and warnings found in one source, in the order they were found."""

    def __init__(self, source: SourceText) -> None:
        self.source = source
        self.errors: list[Diagnostic] = []
        self.warnings: list[Diagnostic] = []

    def error(self, place: SyntaxNode | Where, message: str, hint: str = "") -> None:
        """Note something without a meaning; the plan will be refused."""
        self.errors.append(Diagnostic(self._where(place), message, hint))

    def warn(self, place: SyntaxNode | Where, message: str, hint: str = "") -> None:
        """Note something that has a meaning, though probably not the intended one."""
        self.warnings.append(Diagnostic(self._where(place), message, hint, Severity.WARNING))

    def refuse_if_errors(self) -> None:
        """Raise :class:`InputError` with everything found, in source order, if any is an error."""
        if self.errors:
            raise InputError(in_source_order(self.errors + self.warnings))

    def _where(self, place: SyntaxNode | Where) -> Where:
        return place if isinstance(place, Where) else self.source.at(place)


def in_source_order(diagnostics: list[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Return the diagnostics sorted by place; those of one place stay in the order given."""
    return tuple(sorted(diagnostics, key=lambda d: (d.where.line, d.where.column)))
