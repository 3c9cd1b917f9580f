"""Numbers, counted things and lists in sentences."""

from __future__ import annotations

import math
import shlex
import sys
from collections.abc import Iterable, Sequence
from typing import Final

NOTHING: Final = "–"
"""The text of a value that does not exist."""
_ZERO: Final = 5e-7
"""Smaller values are 0 in every unit: arithmetic leaves a millionth of a metre or second over."""


def count_noun(number: int, noun: str, plural: str = "") -> str:
    """Return ``1 run`` or ``2 runs``."""
    return f"{number:,} {noun if number == 1 else plural or noun + 's'}"


def enumerate_words(words: Sequence[str], conjunction: str = "and") -> str:
    """Return ``a, b and c``; an empty text for no words."""
    return f" {conjunction} ".join(filter(None, (", ".join(words[:-1]), *words[-1:])))


def first_words(words: Iterable[object], most: int = 3) -> str:
    """Return the first ``most`` words and the number of the others: ``a, b, c and 4 more``."""
    every = list(map(str, words))
    more = f" and {len(every) - most} more" if len(every) > most else ""
    return ", ".join(every[:most]) + more


def command_line(*words: object) -> str:
    """Return a command line for people, quoted for a shell: ``scenario report 'my results'``."""
    return shlex.join(("scenario", *map(str, words)))


def format_quantity(
    value: float | None, unit: str = "", *, signed: bool = False, digits: int = 3
) -> str:
    """Return a value with its unit and ``digits`` significant digits: ``+0.0312 m``; ``–`` if none.

    Values with a unit below a millionth of it read as 0 but keep their sign, since they may still
    break a limit.
    """
    if value is None or math.isnan(value):
        return NOTHING
    sign = "+" if signed else ""
    if math.isinf(value):
        return f"{sign}∞" if value > 0 else "−∞"
    bare = unit in ("", "1")
    # An exactly met strict limit has a margin just below 0: the smallest negative numbers.
    zero = abs(value) < (sys.float_info.min * 2 if bare else _ZERO)
    rounded = math.copysign(0.0, value) if zero else value
    number = f"{rounded:{sign}.{digits}g}"
    # "g" switches to powers of ten early; below a million, plain digits read faster.
    if "e" in number and 1e-4 <= abs(value) < 1e6:
        number = f"{value:{sign}.0f}"
    elif "e-" in number and not bare:
        number = f"{rounded:{sign}.6f}"
    number = number.replace("-", "−")
    return number if bare else f"{number} {unit}"


def duration_text(seconds: float | None) -> str:
    """Return a duration as ``8 s``, ``3 min 20 s``, ``2 h 05 min`` or ``2 d 7 h``."""
    if seconds is None or not math.isfinite(seconds):
        return NOTHING
    whole = max(0, round(seconds))
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    if whole < 48 * 3600:
        return f"{whole // 3600} h {whole % 3600 // 60:02d} min"
    return f"{whole // 86400} d {whole % 86400 // 3600} h"
