"""Amounts people type and read: ages such as ``30d``, sizes such as ``20GiB``."""

from __future__ import annotations

import re
from typing import Final

import typer

_AGES: Final = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0, "w": 604800.0}
_SIZES: Final = {
    "B": 1, "KiB": 2**10, "MiB": 2**20, "GiB": 2**30, "TiB": 2**40,
    "kB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12,
}  # fmt: skip
_AMOUNT: Final = re.compile(r"\s*([0-9]+(?:\.[0-9]+)?)\s*([A-Za-z]+)\s*\Z")


def age(text: str) -> float:
    """Return ``30d`` in seconds; raises :class:`typer.BadParameter`."""
    return _amount(text, _AGES, "an age", "30d")


def duration(text: str) -> float:
    """Return ``10min`` in seconds; raises :class:`typer.BadParameter`."""
    return _amount(text, _AGES, "a time", "10min")


def size(text: str) -> int:
    """Return ``20GiB`` in bytes; raises :class:`typer.BadParameter`."""
    return int(_amount(text, _SIZES, "a size", "20GiB"))


def _amount(text: str, units: dict[str, float] | dict[str, int], what: str, example: str) -> float:
    found = _AMOUNT.match(text)
    if found is None or found[2] not in units:
        raise typer.BadParameter(
            f"{text!r} is not {what}: write a number and one of {', '.join(units)}, as in {example}"
        )
    return float(found[1]) * units[found[2]]


def size_text(count: float) -> str:
    """Return a number of bytes as people read it: ``512 B``, ``1.5 GiB``."""
    for unit in ("B", "KiB", "MiB", "GiB"):
        if count < 1024:
            return f"{count:.0f} {unit}" if unit == "B" else f"{count:.1f} {unit}"
        count /= 1024
    return f"{count:.1f} TiB"
