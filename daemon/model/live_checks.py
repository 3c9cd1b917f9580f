"""Checks of what is told of runs that go on: whoever reads it draws it, so it can be drawn.

Workers, and anybody in a cluster, may publish whatever they like under the names of runs. What is
in the wrong place of a map is drawn there; what no run can say is refused as a whole.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from daemon.model.messages import MOST_SIMULATED
from daemon.model.status import LiveSnapshot
from grammars.text import codec

_LARGEST_SNAPSHOT: Final = 8192
"""Bytes of JSON; twice what a run's process can tell at once."""
_MOST_WAYPOINTS: Final = 10**6
FARTHEST_POINT: Final = 10**9
"""Centimetres from the origin of a map in either direction."""
LARGEST_VALUE: Final = 1e100
"""Of a signal or a covariance: what is calculated with larger ones is infinite."""


def read_snapshot(data: bytes | str) -> LiveSnapshot:
    """Read a snapshot of a run; raises ``ValueError`` for what no run tells."""
    if len(data) > _LARGEST_SNAPSHOT:
        raise ValueError(f"a snapshot of more than {_LARGEST_SNAPSHOT} bytes")
    live = codec.from_json(LiveSnapshot, data)
    told = live.snapshot
    check_times((told.time, told.limit))
    if not all(0 <= count <= _MOST_WAYPOINTS for count in (told.reached, told.waypoints)):
        raise ValueError(f"{told.reached} of {told.waypoints} waypoints")
    if any(abs(value) > LARGEST_VALUE for value in told.spread or ()):
        raise ValueError("a covariance that is none")
    for points in (told.returns, told.plan, told.contacts):
        if any(abs(number) > FARTHEST_POINT for number in points):
            raise ValueError("points that are nowhere near a map")
    return live


def check_times(times: Iterable[float]) -> None:
    """Raise ``ValueError`` for a moment [s] that no simulation reaches."""
    for time in times:
        if not abs(time) <= MOST_SIMULATED:
            raise ValueError(f"a moment at {time:g} s")
