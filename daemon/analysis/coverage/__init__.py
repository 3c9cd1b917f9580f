"""Coverage of the space of scenarios: features that a campaign exercises, and those it misses.

Runs are compared with a model of the features of scenarios (Ortega et al. 2024, figure 1):
:func:`planned_coverage` compares specifications, :func:`trace_coverage` recorded runs, including
doors and floor. For open traces, :func:`sum_coverage` sums up :func:`run_coverage`.
"""

from daemon.analysis.coverage._coverage import (
    RunCoverage,
    planned_coverage,
    run_coverage,
    sum_coverage,
    trace_coverage,
)
from daemon.analysis.coverage._results import Coverage, FeatureCount, FloorArea, RoomArea
