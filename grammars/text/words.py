"""Counted things and lists in sentences."""

from __future__ import annotations

from collections.abc import Sequence


def count_noun(number: int, noun: str, plural: str = "") -> str:
    """Return ``1 run`` or ``2 runs``."""
    return f"{number:,} {noun if number == 1 else plural or noun + 's'}"


def enumerate_words(words: Sequence[str], conjunction: str = "and") -> str:
    """Return ``a, b and c``; nothing for no words."""
    return f" {conjunction} ".join(filter(None, (", ".join(words[:-1]), *words[-1:])))
