"""Valid names and numbers in messages: ids, digests, names of traces, ranges.

They come from files and from the network. Only valid names become part of a path, and numbers are
drawn where they arrive. Without pydantic, which the first screen of the dashboard need not load.
"""

from __future__ import annotations

import functools
import re
from typing import Annotated, Final
from urllib.parse import quote

from annotated_types import Interval, MaxLen

# Not ``$`` at the end, which also matches before a newline.
_ID: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,99}\Z")
_RUN_ID: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,99}\.[0-9]{1,9}\Z")
_DIGEST: Final = re.compile(r"[0-9a-f]{64}\Z")
_LONGEST_NAME: Final = 200

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


def is_id(text: str) -> bool:
    """Return whether ``text`` may name a campaign or a worker."""
    return _ID.match(text) is not None


def is_run_id(text: str) -> bool:
    """Return whether ``text`` may name a run: ``<campaign>.<index>``."""
    return _RUN_ID.match(text) is not None


def is_digest(text: str) -> bool:
    """Return whether ``text`` looks like a SHA-256: 64 lower-case hexadecimal digits."""
    return _DIGEST.match(text) is not None


def trace_name(campaign: str, scenario: str, sut: str, repeat: int) -> str:
    """Return the path of a run's trace below the traces directory, ``/`` separated.

    Different runs get different names and no name leaves the directory: everything outside
    ``[A-Za-z0-9_~-]``, the dot included, is percent-encoded. Raises ``ValueError`` for an invalid
    campaign id and for names that file systems refuse.
    """
    if not is_id(campaign):
        raise ValueError(f"{campaign!r} is not a campaign id")
    parts = (_quoted(scenario), _quoted(sut), str(int(repeat)))
    name = ".".join(parts) + ".mcap"
    if not all(parts) or repeat < 0 or len(name) > _LONGEST_NAME:
        raise ValueError(f"{scenario!r} with {sut!r}, repeat {repeat}, makes no usable file name")
    return f"{campaign}/{name}"


@functools.lru_cache(4096)
def _quoted(name: str) -> str:
    return quote(name, safe="").replace(".", "%2E")
