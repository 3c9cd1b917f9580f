"""What takes long, done in steps: whoever drives them commits between any two of them."""

from __future__ import annotations

from collections.abc import Generator
from typing import Final, TypeAlias, TypeVar

T = TypeVar("T")

Steps: TypeAlias = Generator[None, None, T]
"""Work that may be committed wherever it yields, and goes on after whatever others do meanwhile.

Steps take some milliseconds each. What was committed of work that is given up in the middle must
do no harm: see where it begins.
"""

STEP_ROWS: Final = 250
"""Rows in one step: with all indexes of a run some milliseconds."""


def finish(steps: Steps[T]) -> T:
    """Do all that is left at once."""
    while True:
        try:
            next(steps)
        except StopIteration as done:
            value: T = done.value
            return value
