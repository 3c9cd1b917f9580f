"""Ranges of values that travel: they come from the network, and are drawn where they arrive.

Apart from the messages of the bus, for who reads campaign files needs no message, and without
pydantic, which the first screen of the dashboard does not wait for.
"""

from __future__ import annotations

from typing import Annotated, Final

from annotated_types import Interval, MaxLen

MOST_SIMULATED: Final = 1e9
"""Seconds that a run may be said to have taken or simulated."""
FARTHEST_POINT: Final = 10**9
"""Centimetres from the origin of a map in either direction."""
LARGEST_VALUE: Final = 1e100
"""Of a signal or a covariance: what is calculated with larger ones is infinite."""

IdText = Annotated[str, MaxLen(128)]
ShortText = Annotated[str, MaxLen(400)]
Moment = Annotated[float, Interval(ge=-MOST_SIMULATED, le=MOST_SIMULATED)]
"""Simulated seconds."""
Seconds = Annotated[float, Interval(ge=0.0, le=MOST_SIMULATED)]
"""A time that a run takes or reaches."""
SignalValue = Annotated[float, Interval(ge=-LARGEST_VALUE, le=LARGEST_VALUE)]
Centimetres = Annotated[int, Interval(ge=-FARTHEST_POINT, le=FARTHEST_POINT)]
WaypointCount = Annotated[int, Interval(ge=0, le=10**6)]
# Up to 2**53 every number is one in any JSON parser, and in SQLite's 64 bits.
NonNegativeInt = Annotated[int, Interval(ge=0, le=2**53)]
