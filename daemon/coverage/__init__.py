"""Coverage of the space of scenarios: what a campaign exercises, and what it leaves out.

:data:`MODEL` declares the features of scenarios (Ortega et al. 2024, figure 1).
:func:`planned_coverage` holds run specifications against it, :func:`coverage_of` recorded runs,
for which it also tells doors, floor and margins. Who has read traces already sums up
:func:`contribution` of each by :func:`summed`.
"""

from daemon.coverage._gather import (
    NEAR,
    Contribution,
    contribution,
    coverage_of,
    planned_coverage,
    summed,
)
from daemon.coverage._margins import bars
from daemon.coverage._model import MODEL, Exclusion, Feature, FeatureModel
from daemon.coverage._types import (
    Coverage,
    DoorCount,
    FeatureCount,
    FeatureGroup,
    FloorArea,
    MarginHistogram,
    PairCount,
    Pairs,
    RoomArea,
    Unreadable,
)

__all__ = [
    "MODEL",
    "NEAR",
    "Contribution",
    "Coverage",
    "DoorCount",
    "Exclusion",
    "Feature",
    "FeatureCount",
    "FeatureGroup",
    "FeatureModel",
    "FloorArea",
    "MarginHistogram",
    "PairCount",
    "Pairs",
    "RoomArea",
    "Unreadable",
    "bars",
    "contribution",
    "coverage_of",
    "planned_coverage",
    "summed",
]
