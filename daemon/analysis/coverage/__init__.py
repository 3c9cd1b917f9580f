"""Coverage of the space of scenarios: what a campaign exercises, and what it leaves out.

:data:`MODEL` declares the features of scenarios (Ortega et al. 2024, figure 1).
:func:`planned_coverage` holds run specifications against it, :func:`trace_coverage` recorded runs,
for which it also tells doors, floor and margins. Who has read traces already sums up
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
    MAX_BINS,
    RunCoverage,
    bin_edges,
    count_bars,
    histogram_bars,
    margin_histograms,
    planned_coverage,
    run_coverage,
    sum_coverage,
    trace_coverage,
)
from daemon.analysis.coverage._features import (
    MODEL,
    RecognisedFeatures,
    feature_leaves,
    pair_counts,
)
from daemon.analysis.coverage._results import Coverage, FeatureCount, FloorArea, RoomArea
from daemon.analysis.coverage._rules import contains_point

__all__ = [
    "MAX_BINS",
    "MODEL",
    "Coverage",
    "FeatureCount",
    "FloorArea",
    "RecognisedFeatures",
    "RoomArea",
    "RunCoverage",
    "bin_edges",
    "contains_point",
    "count_bars",
    "covered_cells",
    "feature_leaves",
    "floor_area",
    "floor_grid",
    "histogram_bars",
    "margin_histograms",
    "paint_footprints",
    "paint_rays",
    "pair_counts",
    "planned_coverage",
    "room_cells",
    "run_coverage",
    "sum_coverage",
    "trace_coverage",
]
