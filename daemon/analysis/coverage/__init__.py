"""Coverage of the space of scenarios: what a campaign exercises, and what it leaves out.

:data:`MODEL` declares the features of scenarios (Ortega et al. 2024, figure 1).
:func:`planned_coverage` holds run specifications against it, :func:`trace_coverage` recorded runs,
for which it also tells doors and floor. Who has read traces already sums up
:func:`run_coverage` of each by :func:`sum_coverage`.
"""

from daemon.analysis.coverage._building import (
    covered_cells,
    floor_area,
    floor_grid,
    paint_footprints,
    paint_rays,
    room_cells,
)
from daemon.analysis.coverage._coverage import (
    RunCoverage,
    planned_coverage,
    run_coverage,
    sum_coverage,
    trace_coverage,
)
from daemon.analysis.coverage._features import MODEL
from daemon.analysis.coverage._results import Coverage, FeatureCount, FloorArea, RoomArea
from daemon.analysis.coverage._rules import contains_point

__all__ = [
    "MODEL",
    "Coverage",
    "FeatureCount",
    "FloorArea",
    "RoomArea",
    "RunCoverage",
    "contains_point",
    "covered_cells",
    "floor_area",
    "floor_grid",
    "paint_footprints",
    "paint_rays",
    "planned_coverage",
    "room_cells",
    "run_coverage",
    "sum_coverage",
    "trace_coverage",
]
