"""Ranges of values in messages: they come from the network, and are drawn where they arrive.

Separate from the messages of the bus, which readers of campaign files do not need, and without
pydantic, which the first screen of the dashboard need not load.
"""

from __future__ import annotations

from typing import Annotated, Final

from annotated_types import Interval, MaxLen

MOST_SIMULATED: Final = 1e9
"""Longest time that a run may report [s]."""
FARTHEST_POINT: Final = 10**9
"""Largest coordinate in a map [cm]."""
LARGEST_VALUE: Final = 1e100
"""Largest value of a signal or a covariance: calculations with larger ones overflow."""

IdText = Annotated[str, MaxLen(128)]
ShortText = Annotated[str, MaxLen(400)]
Moment = Annotated[float, Interval(ge=-MOST_SIMULATED, le=MOST_SIMULATED)]
"""Simulated time [s]."""
Seconds = Annotated[float, Interval(ge=0.0, le=MOST_SIMULATED)]
"""Duration or time of a run [s]."""
SignalValue = Annotated[float, Interval(ge=-LARGEST_VALUE, le=LARGEST_VALUE)]
Centimetres = Annotated[int, Interval(ge=-FARTHEST_POINT, le=FARTHEST_POINT)]
WaypointCount = Annotated[int, Interval(ge=0, le=10**6)]
# Every JSON parser, and SQLite, represents integers up to 2**53 exactly.
NonNegativeInt = Annotated[int, Interval(ge=0, le=2**53)]
