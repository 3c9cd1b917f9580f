"""The goals of speed, which are ratios to the commit before the work on it began.

As ``python -m tests.benchmarks against`` measures; takes some minutes more the first time, when
the older commit compiles its machine code.
"""

import sys
from dataclasses import replace

from tests.benchmarks.against import compare
from tests.benchmarks.measurement import at_least

BASELINE = "a65fad96"
TIMES = {"rest": 5, "moving": 5, "s1": 2}
GOALS = {"rest": 1.35, "moving": 1.6, "s1": 1.35}
"""Of simulated seconds per CPU second."""


def measure():
    """Yield the cases that have a goal; none in a folder without the history of the project."""
    try:
        for one in compare(BASELINE, TIMES):
            yield replace(one, goals=(at_least(GOALS[one.name], of_ratio=True),))
    except LookupError as error:
        print(f"not measured: {error}", file=sys.stderr)
