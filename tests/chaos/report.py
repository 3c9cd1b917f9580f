"""What a scenario did and saw, and what of it must not be."""

from __future__ import annotations

import os
import time

_SHOWN = 12


class Report:
    """Facts in order of their appearance, and violations."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.violations: list[str] = []
        self._facts: dict[str, str] = {}
        self._start = time.monotonic()

    def fact(self, what: str, value: object) -> None:
        """Something done or seen."""
        self._facts[what] = str(value)

    def expect(self, holds: bool, otherwise: str) -> bool:
        """Something that must be true; returns whether it is."""
        if not holds:
            self.violations.append(otherwise)
        return holds

    def text(self) -> str:
        """The table."""
        load = os.getloadavg()[0]
        took = f"{time.monotonic() - self._start:.1f} s, load {load:.1f}"
        lines = [f"\n== {self.name}"]
        facts = {**self._facts, "took": took}
        lines += [f"{what:40} {value}" for what, value in facts.items()]
        lines += [f"VIOLATION: {found}" for found in self.violations[:_SHOWN]]
        if len(self.violations) > _SHOWN:
            lines.append(f"and {len(self.violations) - _SHOWN} more violations")
        return "\n".join([*lines, "violated" if self.violations else "held"])
