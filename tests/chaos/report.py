"""What a scenario did and saw, and what of it must not be."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass

_SHOWN = 12
_HEADS = ("scenario", "runs", "executions", "started over", "lost", "violations", "seconds")


@dataclass(frozen=True, slots=True)
class Row:
    """What one part of a scenario came to; ``None`` where nobody counted."""

    name: str
    seconds: float
    runs: int | None = None
    executions: int | None = None
    started_over: int | None = None
    lost: int | None = None
    violations: int = 0

    @property
    def cells(self):
        """The row as text."""
        counts = (self.runs, self.executions, self.started_over, self.lost)
        shown = ("-" if count is None else str(count) for count in counts)
        return (self.name, *shown, str(self.violations), f"{self.seconds:.0f}")


def table(rows):
    """Rows below each other, numbers to the right."""
    lines = [_HEADS, *(row.cells for row in rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(_HEADS))]
    return "\n".join(
        "  ".join([line[0].ljust(widths[0]), *map(str.rjust, line[1:], widths[1:])])
        for line in lines
    )


class Report:
    """Facts in order of their appearance, rows of parts, and violations."""

    def __init__(self, name, start=None):
        self.name = name
        self.violations = []
        self.parts = []
        self.runs = None
        self.executions = None
        self.started_over = None
        self.lost = None
        self._facts = {}
        self._start = time.monotonic() if start is None else start
        self._end = 0.0

    def end(self):
        """Its time is over."""
        self._end = time.monotonic()

    @property
    def seconds(self):
        """How long it took, or takes so far."""
        return (self._end or time.monotonic()) - self._start

    def fact(self, what, value):
        """Something done or seen."""
        self._facts[what] = str(value)

    def expect(self, holds, otherwise):
        """Something that must be true; returns whether it is."""
        if not holds:
            self.violations.append(otherwise)
        return holds

    @property
    def row(self):
        """All of it in one line."""
        return Row(
            self.name.partition(":")[0],
            self.seconds,
            self.runs,
            self.executions,
            self.started_over,
            self.lost,
            len(self.violations),
        )

    def include(self, part):
        """Take in what a part came to; its violations are ours."""
        self.parts.append(part.row)
        self.violations += [f"{part.name}: {found}" for found in part.violations]

    @property
    def rows(self):
        """The parts, or all of it where there are none."""
        return self.parts or [self.row]

    def text(self):
        """The facts, the parts and what must not be."""
        load = os.getloadavg()[0]
        took = f"{self.seconds:.1f} s, load {load:.1f}"
        lines = [f"\n== {self.name}"]
        facts = {**self._facts, "took": took}
        lines += [f"{what:40} {value}" for what, value in facts.items()]
        if self.parts:
            lines.append(table(self.parts))
        lines += [f"VIOLATION: {found}" for found in self.violations[:_SHOWN]]
        if len(self.violations) > _SHOWN:
            lines.append(f"and {len(self.violations) - _SHOWN} more violations")
        return "\n".join([*lines, "violated" if self.violations else "held"])
