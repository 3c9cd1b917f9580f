"""What the languages' parsers report, prepared for messages to people."""

from __future__ import annotations

import threading
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any, Final

_TEXTX_LOCK: Final = threading.Lock()


def load_metamodel(grammar: Path, *, autokwd: bool = False) -> Any:
    """Return textX's metamodel of a language; safe from any thread.

    Grammars are read by a parser textX has only one of: two threads at once would disturb it.
    """
    from textx import metamodel_from_file

    with _TEXTX_LOCK:
        return metamodel_from_file(str(grammar), autokwd=autokwd)


def offset_of(text: str, line: int, column: int) -> int:
    """Return the index in ``text`` of a line and column that count from 1."""
    start = 0
    for _ in range(line - 1):
        start = text.index("\n", start) + 1
    return start + column - 1


def expected_keys(rules: Iterable[Any], words: Collection[str]) -> set[str]:
    """Return what a parser expected: keywords as written, the rules in ``words`` by their names.

    ``rules`` are the rules of an Arpeggio ``NoMatch``; comments, which may stand anywhere, are
    left out.
    """
    keys = {
        rule.rule_name if rule.rule_name in words else getattr(rule, "to_match", rule.rule_name)
        for rule in rules
    }
    return {key for key in keys if not key.startswith(r"\/\/")} - {"Comment"}
