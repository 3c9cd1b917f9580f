"""Numbers with their intervals, and tables in pages of the documentation."""

import re

from daemon.judging.statistics import mean_interval, proportion_interval

NOTHING = "–"
_BLOCK = re.compile(
    r"(<!-- table (?P<name>[a-z-]+)[^>]*-->\n).*?(<!-- end of table -->)", re.DOTALL
)


def number(value, digits):
    """Return a number with this many decimals and a true minus."""
    return f"{round(value, digits) + 0.0:.{digits}f}".replace("-", "−")


def mean_text(values, digits):
    """Return a mean with its 95 % t interval: ``691.2 (688.0 to 694.4)``."""
    if not values:
        return NOTHING
    interval = mean_interval(values)
    text = number(interval.mean, digits)
    if interval.low is None or interval.high is None:
        return text
    return f"{text} ({number(interval.low, digits)} to {number(interval.high, digits)})"


def count_text(passed, n):
    """Return a count with the exact 95 % interval of its rate: ``3 of 5 (15 to 95 %)``."""
    low, high = proportion_interval(passed, n)
    return f"{passed} of {n} ({100 * low:.0f} to {100 * high:.0f} %)"


def write_tables(page, tables):
    """Write tables into a page between the markers with their names."""
    text = page.read_text("utf-8")
    text = _BLOCK.sub(lambda block: block[1] + tables[block["name"]] + block[3], text)
    page.write_text(text, "utf-8")
