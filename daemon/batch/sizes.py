"""Sizes in bytes as people write and read them: ``20GiB``."""

from __future__ import annotations

import re
from typing import Final

QUOTA_VARIABLE: Final = "SCENARIO_QUOTA"
"""The variable that says what traces may take, for daemons that are started by others."""

_SIZES: Final = {
    "B": 1, "KiB": 2**10, "MiB": 2**20, "GiB": 2**30, "TiB": 2**40,
    "kB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12,
}  # fmt: skip
_SIZE: Final = re.compile(r"\s*([0-9]{1,15}(?:\.[0-9]{1,9})?)\s*([A-Za-z]+)\s*\Z")


def parse_size(text: str) -> int:
    """Return ``20GiB`` in bytes; raises ``ValueError`` for what is no size."""
    found = _SIZE.match(text)
    if found is None or found[2] not in _SIZES:
        raise ValueError(
            f"{text!r} is not a size: write a number and one of {', '.join(_SIZES)}, as in 20GiB"
        )
    return int(float(found[1]) * _SIZES[found[2]])


def size_text(count: float) -> str:
    """Return a number of bytes as people read it: ``512 B``, ``1.5 GiB``."""
    for unit in ("B", "KiB", "MiB", "GiB"):
        if count < 1024:
            return f"{count:.0f} {unit}" if unit == "B" else f"{count:.1f} {unit}"
        count /= 1024
    return f"{count:.1f} TiB"
