"""What a scenario did and saw, and what of it must not be."""

import os
import time

_SHOWN = 12
_HEADS = ("scenario", "runs", "executions", "started over", "lost", "violations", "seconds")


def table(rows):
    """Rows below each other, numbers to the right."""
    lines = [_HEADS, *rows]
    widths = [max(len(line[i]) for line in lines) for i in range(len(_HEADS))]
    return "\n".join(
        "  ".join([line[0].ljust(widths[0]), *map(str.rjust, line[1:], widths[1:])])
        for line in lines
    )


class Report:
    """Facts in order of their appearance, rows of parts, and violations.

    ``runs``, ``executions``, ``started_over`` and ``lost`` are ``None`` where nobody counted.
    """

    def __init__(self, name, start=None):
        self.name = name
        self.violations = []
        self.runs = self.executions = self.started_over = self.lost = None
        self._facts, self._parts = {}, []
        self._start = time.monotonic() if start is None else start
        self._seconds = None

    def end(self):
        """Its time is over."""
        self._seconds = self.seconds

    @property
    def seconds(self):
        """How long it took, or takes so far."""
        passed = time.monotonic() - self._start
        return passed if self._seconds is None else self._seconds

    def fact(self, what, value):
        """Something done or seen."""
        self._facts[what] = str(value)

    def expect(self, holds, otherwise):
        """Something that must be true; returns whether it is."""
        if not holds:
            self.violations.append(otherwise)
        return holds

    def count(self, executions):
        """Take in how often runs were begun."""
        self.executions, self.started_over = executions.begun.total(), executions.started_over

    def expect_none_started_over(self, executions):
        """No run was begun twice."""
        self.count(executions)
        self.expect(not self.started_over, f"{self.started_over} runs were started over")

    def include(self, part):
        """Take in what a part came to; its violations are ours."""
        self._parts += part.rows
        self.violations += [f"{part.name}: {found}" for found in part.violations]

    @property
    def rows(self):
        """The parts, or all of it in one line, as text."""
        counts = (self.runs, self.executions, self.started_over, self.lost)
        shown = ("-" if count is None else str(count) for count in counts)
        name = self.name.partition(":")[0]
        return self._parts or [(name, *shown, f"{len(self.violations)}", f"{self.seconds:.0f}")]

    def text(self):
        """The facts, the parts and what must not be."""
        took = f"{self.seconds:.1f} s, load {os.getloadavg()[0]:.1f}"
        lines = [f"\n== {self.name}"]
        lines += [f"{what:40} {value}" for what, value in {**self._facts, "took": took}.items()]
        lines += [table(self._parts)] if self._parts else []
        lines += [f"VIOLATION: {found}" for found in self.violations[:_SHOWN]]
        if len(self.violations) > _SHOWN:
            lines.append(f"and {len(self.violations) - _SHOWN} more violations")
        return "\n".join([*lines, "violated" if self.violations else "held"])
