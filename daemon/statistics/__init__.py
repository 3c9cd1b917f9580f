"""Small samples told honestly: exact and t intervals, effect sizes, many tests at once.

Only the quantiles come from scipy (``scipy.special``, which loads fast enough for a command line);
the rest is a line of a definition each, held by tests to ``scipy.stats``.
"""

from daemon.statistics._means import Difference, Interval, mean_interval, paired, welch
from daemon.statistics._proportion import (
    at_least,
    at_most,
    proportion_interval,
    runs_needed,
)
from daemon.statistics._tests import cliffs_delta, holm, magnitude

__all__ = [
    "Difference",
    "Interval",
    "at_least",
    "at_most",
    "cliffs_delta",
    "holm",
    "magnitude",
    "mean_interval",
    "paired",
    "proportion_interval",
    "runs_needed",
    "welch",
]
