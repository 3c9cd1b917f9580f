"""Messages for people: where, what is wrong, what to do.

Every room reports bad input as :class:`Diagnostic` values; :class:`InputError` carries all of
them to the border, where the command line prints them and exits with code 2.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum


class Severity(StrEnum):
    """How bad a diagnostic is: an error stops, a warning does not."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True, slots=True)
class Where:
    """A place in a source text; lines and columns count from 1, 0 means unknown."""

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
class Diagnostic:
    """One finding: ``where: message``, with an optional hint on what to do about it."""

    where: Where
    message: str
    hint: str = ""
    severity: Severity = Severity.ERROR

    def __str__(self) -> str:
        label = "warning: " if self.severity is Severity.WARNING else ""
        hint = f"\n    {self.hint}" if self.hint else ""
        return f"{self.where}: {label}{self.message}{hint}"


class InputError(Exception):
    """Something a person wrote cannot be used; ``diagnostics`` says why, all of it."""

    def __init__(self, diagnostics: Diagnostic | Iterable[Diagnostic]) -> None:
        found = (diagnostics,) if isinstance(diagnostics, Diagnostic) else tuple(diagnostics)
        self.diagnostics: tuple[Diagnostic, ...] = found
        super().__init__("\n".join(str(d) for d in found))

    @classmethod
    def at(cls, where: Where, message: str, hint: str = "") -> InputError:
        """Return the error of one finding."""
        return cls(Diagnostic(where, message, hint))


def with_article(noun: str) -> str:
    """Return ``a space``, ``an entryway``."""
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"


def closest(word: str, known: Iterable[str]) -> str:
    """Return the known word that ``word`` was probably meant to be, or nothing."""
    close = difflib.get_close_matches(word, sorted(set(known)), n=1, cutoff=0.6)
    return close[0] if close else ""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return ``did you mean "x"?`` for the closest known word, else the list of known words."""
    candidates = sorted(set(known))
    close = closest(word, candidates)
    if close:
        return f'did you mean "{close}"?'
    if not candidates:
        return ""
    shown = ", ".join(candidates[:12]) + (", …" if len(candidates) > 12 else "")
    return f"known here: {shown}"
