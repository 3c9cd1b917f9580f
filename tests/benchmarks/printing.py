"""Measurements as text: their lines, the table goal / measured / met, how long each part took.

As wide as the terminal, and 120 columns in a file; what does not fit goes on below.
"""

import shutil
import textwrap

IN_A_FILE = 120
"""Columns."""
LEAST, MOST = 60, 160
"""Columns that lines are made for, whatever the terminal has."""
WIDE = 100
"""Columns from which on there is room for names of references in a table."""
_BELOW = " " * 6
_GAP = "  "
_NARROWEST = 12


def width():
    """Columns there are."""
    return max(LEAST, min(shutil.get_terminal_size((IN_A_FILE, 24)).columns, MOST))


def number(value):
    """Three digits that count, no exponent where people would not write one; counts are whole."""
    if isinstance(value, int):
        return str(value)
    if value != value or value in (float("inf"), float("-inf")):
        return "-"
    if abs(value) >= 100.0:
        return f"{value:.0f}"
    return f"{value:#.3g}".rstrip(".") if abs(value) >= 1e-3 or not value else f"{value:.1e}"


def bound(goal, unit):
    """A goal in words: ``>= 1000 x real time``, ``<= 1.35 x reference``."""
    sign = ">=" if goal.at_least else "<="
    return f"{sign} {goal.bound:g} {'x reference' if goal.of_ratio else unit}".rstrip()


def line(one, columns=IN_A_FILE):
    """A measurement as it is printed when it has been made: value and ratio, what else below."""
    called = 46 if columns >= WIDE else 38
    ratio, beside = "", ""
    if one.reference is not None:
        ratio = f"{'-' if one.ratio is None else number(one.ratio):>7} x"
        beside = f"{one.reference.name} ({number(one.reference.value)})"
    values = f"{number(one.value):>8} {one.unit:11} {ratio}"
    said = [f"{one.name:{called}} {values}"]
    if len(said[0]) > columns:
        said = [one.name, f"{'':{called}} {values}"]
    below = []
    for more, gap in ((beside, " "), (one.note, _GAP)):
        if more and not below and len(said[-1]) + len(gap) + len(more) <= columns:
            said[-1] += gap + more
        elif more:
            below.append(more)
    said += textwrap.wrap(
        "; ".join(below), columns, initial_indent=_BELOW, subsequent_indent=_BELOW
    )
    return "\n".join(each.rstrip() for each in said)


def goal_table(made, columns=IN_A_FILE):
    """Lines of the table goal / measured / met: a row for each goal of what was measured.

    Where it is narrow the references have no names: the lines above have them.
    """
    rows = [
        (
            f"{benchmark}: {one.name.strip()}",
            bound(goal, one.unit),
            f"{number(one.value)} {one.unit}",
            _ratio(one, named=columns >= WIDE),
            "yes" if one.met(goal) else "NO",
        )
        for benchmark, one in made
        for goal in one.goals
    ]
    if rows:
        heads = ("what", "goal", "measured", "ratio", "met")
        yield from aligned([heads, *rows], columns)


def _ratio(one, *, named):
    if one.reference is None or one.ratio is None:
        return "-"
    return f"{number(one.ratio)} x {one.reference.name if named else ''}".rstrip()


def part_table(parts, columns=IN_A_FILE):
    """How long each part took [s], the longest first, and all of them."""
    longest_first = sorted(parts, key=lambda part: -part[1])
    together = sum(seconds for _, seconds in longest_first)
    each = ", ".join(f"{name} {seconds:.0f}" for name, seconds in longest_first)
    yield from textwrap.wrap(
        f"{together:.0f} s in all: {each}", columns, subsequent_indent=_BELOW,
        break_on_hyphens=False,
    )  # fmt: skip


def aligned(rows, columns):
    """Rows of cells as lines, each column as wide as its widest cell; broken where that is more
    than ``columns``, the widest columns first.
    """
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    room = columns - len(_GAP) * (len(widths) - 1)
    while sum(widths) > room and max(widths) > _NARROWEST:
        widths[widths.index(max(widths))] -= 1
    for row in rows:
        broken = [
            textwrap.wrap(cell, cell_width, break_on_hyphens=False) or [""]
            for cell, cell_width in zip(row, widths, strict=True)
        ]
        for k in range(max(map(len, broken))):
            cells = (
                (cell[k] if k < len(cell) else "").ljust(cell_width)
                for cell, cell_width in zip(broken, widths, strict=True)
            )
            yield _GAP.join(cells).rstrip()
