"""Amounts people type and read: ages such as ``30d``, sizes such as ``20GiB``."""

from __future__ import annotations

import re
from typing import Final

import typer

from daemon.amounts import parse_size, size_text

__all__ = ["age", "duration", "size", "size_text"]

_AGES: Final = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0, "w": 604800.0}
_AMOUNT: Final = re.compile(r"\s*([0-9]+(?:\.[0-9]+)?)\s*([A-Za-z]+)\s*\Z")


def age(text: str) -> float:
    """Return ``30d`` in seconds; raises :class:`typer.BadParameter`."""
    return _seconds(text, "an age", "30d")


def duration(text: str) -> float:
    """Return ``10min`` in seconds; raises :class:`typer.BadParameter`."""
    return _seconds(text, "a time", "10min")


def _seconds(text: str, what: str, example: str) -> float:
    found = _AMOUNT.match(text)
    if found is None or found[2] not in _AGES:
        raise typer.BadParameter(
            f"{text!r} is not {what}: write a number and one of {', '.join(_AGES)}, as in {example}"
        )
    return float(found[1]) * _AGES[found[2]]


def size(text: str) -> int:
    """Return ``20GiB`` in bytes; raises :class:`typer.BadParameter`."""
    try:
        return parse_size(text)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error
