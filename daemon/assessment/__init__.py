"""From run records and what their campaign declares to cells, comparisons and surprises."""

from daemon.assessment._assess import assess, told, undecided
from daemon.assessment._between import Between, Judged, Shift, VerdictChange, compare
from daemon.assessment._comparisons import completed
from daemon.assessment._expected import base_name, matches
from daemon.assessment._measures import DURATION, measured
from daemon.assessment._types import (
    DELAY,
    Assessment,
    Cell,
    Comparison,
    ComparisonCell,
    Declared,
    Expectation,
    Gate,
    MeasureCell,
    Operator,
    OracleCell,
    Policy,
    Rule,
    RunRecord,
    Surprise,
    Wanted,
    Worst,
)

__all__ = [
    "DELAY",
    "DURATION",
    "Assessment",
    "Between",
    "Cell",
    "Comparison",
    "ComparisonCell",
    "Declared",
    "Expectation",
    "Gate",
    "Judged",
    "MeasureCell",
    "Operator",
    "OracleCell",
    "Policy",
    "Rule",
    "RunRecord",
    "Shift",
    "Surprise",
    "VerdictChange",
    "Wanted",
    "Worst",
    "assess",
    "base_name",
    "compare",
    "completed",
    "matches",
    "measured",
    "told",
    "undecided",
]
