"""Measurements as text: their lines, the table goal / measured / met, the seconds of each part.

As wide as the terminal, and 120 columns in a file; what does not fit goes on below.
"""

import shutil

from rich.console import Console
from rich.table import Table
from rich.text import Text

WIDE = 100
"""Columns from which on there is room for names of references in a table."""


def make_console():
    """Return a console on standard output, from 60 to 160 columns wide."""
    columns = shutil.get_terminal_size((120, 24)).columns
    return Console(width=max(60, min(columns, 160)), highlight=False, markup=False)


def number(value):
    """Three digits that count, no exponent where people would not write one; counts are whole."""
    if isinstance(value, int):
        return str(value)
    if value != value or value in (float("inf"), float("-inf")):
        return "-"
    if abs(value) >= 100.0:
        return f"{value:.0f}"
    return f"{value:#.3g}".rstrip(".") if abs(value) >= 1e-3 or not value else f"{value:.1e}"


def print_line(console, one):
    """Print a measurement when it has been made: value and ratio, what else beside it."""
    ratio, beside = "", ()
    if one.reference is not None:
        ratio = f"{'-' if one.ratio is None else number(one.ratio)} x"
        beside = (f"{one.reference.name} ({number(one.reference.value)})",)
    table = Table.grid(padding=(0, 1), expand=True)
    table.add_column(width=46 if console.width >= WIDE else 22)
    table.add_column(width=8, justify="right")
    table.add_column(width=11)
    table.add_column(width=8, justify="right")
    table.add_column(ratio=1)
    more = "; ".join((*beside, *filter(None, [one.note])))
    table.add_row(one.name, number(one.value), one.unit, ratio, more)
    console.print(table)


def print_goals(console, made):
    """Print the table goal / measured / met: a row for each goal of what was measured.

    Where it is narrow the references have no names: the lines above have them.
    """
    table = Table("what", "goal", "measured", "ratio", "met", box=None, padding=(0, 2, 0, 0))
    for benchmark, one in made:
        for goal in one.goals:
            unit = "x reference" if goal.of_ratio else one.unit
            name = one.reference.name if one.reference and console.width >= WIDE else ""
            table.add_row(
                f"{benchmark}: {one.name.strip()}",
                f"{'>=' if goal.at_least else '<='} {goal.bound:g} {unit}".rstrip(),
                f"{number(one.value)} {one.unit}",
                "-" if one.ratio is None else f"{number(one.ratio)} x {name}".rstrip(),
                "yes" if one.met(goal) else "NO",
            )
    if table.row_count:
        console.print()
        console.print(table)


def print_parts(console, parts):
    """Print how long each part took [s], the longest first, and all of them."""
    longest_first = sorted(parts, key=lambda part: -part[1])
    together = sum(seconds for _, seconds in longest_first)
    each = ", ".join(f"{name} {seconds:.0f}" for name, seconds in longest_first)
    console.print(Text(f"\n{together:.0f} s in all: {each}"))
