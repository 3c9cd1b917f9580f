"""Diagnostics for people: place, message, the source line with a caret, a hint."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

from rich.text import Text

from grammars.text.diagnostics import Finding, Severity, Where
from grammars.text.terminal_text import printable, spell_out
from grammars.text.words import count_noun


def render_diagnostic(diagnostic: Finding) -> Text:
    """Return a diagnostic with its source line, if the source is readable."""
    is_warning = diagnostic.severity is Severity.WARNING
    text = Text()
    text.append(spell_out(f"{diagnostic.where}: "), style="bold")
    word, style = ("warning", "yellow") if is_warning else ("error", "bold red")
    text.append(f"{word}: ", style=style)
    text.append(diagnostic.message)
    excerpt = _source_excerpt(diagnostic.where)
    if excerpt is not None:
        line, caret = excerpt
        text.append(f"\n    {line}", style="dim")
        if caret >= 0:
            text.append("\n    " + " " * caret)
            text.append("^", style="bold red")
    if diagnostic.hint:
        text.append(f"\n    {diagnostic.hint}", style="cyan")
    return text


def diagnostic_counts(diagnostics: Iterable[Finding]) -> str:
    """Return ``2 errors, 1 warning``."""
    severities = [one.severity for one in diagnostics]
    errors = severities.count(Severity.ERROR)
    parts = [count_noun(errors, "error")] if errors else []
    if len(severities) > errors:
        parts.append(count_noun(len(severities) - errors, "warning"))
    return ", ".join(parts) or "no problems"


@lru_cache(maxsize=64)
def _read_source(file: str, changed: int) -> tuple[str, ...]:
    """Return the lines of a file; its last change ``changed`` [ns] keeps the cache up to date."""
    return tuple(Path(file).read_text(encoding="utf-8-sig").split("\n"))


def _source_excerpt(where: Where) -> tuple[str, int] | None:
    """Return the source line without its indentation and the caret's offset in it (-1: none)."""
    if not where.line:
        return None
    try:
        lines = _read_source(where.file, Path(where.file).stat().st_mtime_ns)
    except (OSError, ValueError):
        return None
    if not 0 < where.line <= len(lines):
        return None
    # Columns count characters: a tab stays one, or the caret would be off.
    line = printable(lines[where.line - 1].expandtabs(1).rstrip())
    indent = len(line) - len(line.lstrip())
    caret = where.column - 1 - indent
    return line.strip()[:160], caret if 0 <= caret <= len(line.strip()) and caret < 160 else -1
