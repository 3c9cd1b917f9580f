"""Amounts as people write and read them: bytes (``20GiB``) and times (``30d``)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

QUOTA_VARIABLE: Final = "SCENARIO_QUOTA"
"""Environment variable with the quota of traces, for daemons that other programs start."""

_SIZES: Final = {
    "B": 1, "KiB": 2**10, "MiB": 2**20, "GiB": 2**30, "TiB": 2**40,
    "kB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12,
}  # fmt: skip
_TIMES: Final = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0, "w": 604800.0}
# Bounded: every match is a finite number.
_AMOUNT: Final = re.compile(r"\s*([0-9]{1,15}(?:\.[0-9]{1,9})?)\s*([A-Za-z]+)\s*\Z")


def parse_size(text: str) -> int:
    """Return ``20GiB`` in bytes; raises ``ValueError`` for anything but a size."""
    return int(_parse(text, _SIZES, "a size", "20GiB"))


def parse_time(text: str, what: str, example: str) -> float:
    """Return ``30d`` in seconds; raises ``ValueError``, whose message calls it ``what``."""
    return _parse(text, _TIMES, what, example)


def _parse(text: str, units: Mapping[str, float], what: str, example: str) -> float:
    match = _AMOUNT.match(text)
    if match is None or match[2] not in units:
        raise ValueError(
            f"{text!r} is not {what}: write a number and one of {', '.join(units)}, as in {example}"
        )
    return float(match[1]) * units[match[2]]


def size_text(count: float) -> str:
    """Return a number of bytes for people: ``512 B``, ``1.5 GiB``."""
    for unit in ("B", "KiB", "MiB", "GiB"):
        if count < 1024:
            return f"{count:.0f} {unit}" if unit == "B" else f"{count:.1f} {unit}"
        count /= 1024
    return f"{count:.1f} TiB"
