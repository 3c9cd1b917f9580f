"""Judgement of a running run as if it ended now: signals, verdicts and log so far.

Made only while somebody looks, from the recording, by the code that judges finished runs; it never
enters a trace or a result. Every message is complete, so that a lost one or a late watcher does no
harm. Times are simulated seconds.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Final, Literal, TypeAlias

from pydantic import Field

from daemon.model.ids import Moment, SignalValue
from daemon.model.verdicts import Verdict
from grammars.model.mission import MOST_WAYPOINTS
from grammars.text import codec

LARGEST_JUDGEMENT: Final = 2**20
"""Bytes of JSON."""
_FASTEST: Final = 1
_MOST_ENTRIES: Final = 4096
"""Limit of door motions, log lines, limits and parts of a signal: each is drawn separately."""

LimitSide: TypeAlias = Literal["above", "below", ""]
_SignalParts = Annotated[tuple[SignalValue | None, ...], Field(max_length=_MOST_ENTRIES)]


@dataclass(frozen=True, slots=True)
class SignalLimit:
    """A value [SI] that oracles compare a signal with.

    ``side`` is where the signal speaks against them; empty if no single sample does, or if two
    oracles contradict each other.
    """

    value: SignalValue
    side: LimitSide = ""


@dataclass(frozen=True, slots=True)
class LiveSignal:
    """A signal so far, thinned: least and greatest value in equal parts of ``start`` to ``end``.

    ``low`` and ``high`` have the same length; ``None`` marks missing values (JSON has no NaN).
    ``unit`` is ``bool`` for truth values. ``against`` are intervals [s] in which the signal spoke
    against an oracle that reads it, and ``readers`` name these oracles.
    """

    name: str
    unit: str
    start: Moment
    end: Moment
    low: _SignalParts
    high: _SignalParts
    limits: Annotated[tuple[SignalLimit, ...], Field(max_length=_MOST_ENTRIES)] = ()
    against: tuple[tuple[Moment, Moment], ...] = ()
    readers: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class LogLine:
    """A line of the log of a run, at a moment of simulated time [s]; ``level`` as in ROS."""

    time: Moment
    source: str
    text: str
    level: str = "info"


@dataclass(frozen=True, slots=True)
class DoorMotion:
    """A joint that leaves (``opens``) or returns to (not ``opens``) its shut position."""

    time: Moment
    joint: str
    opens: bool


@dataclass(frozen=True, slots=True)
class LiveJudgement:
    """A running run, judged up to ``time`` [s].

    ``verdicts`` are those of the run if it ended now; a failure that the rest of the run may mend
    is ``inconclusive`` instead. ``reached`` are the times of completed waypoints, ``doors`` the
    last thousand motions. ``log`` is the end of the log in order of time; ``log_before`` counts
    the omitted lines before it.
    """

    run: str
    time: Moment
    signals: tuple[LiveSignal, ...]
    verdicts: tuple[Verdict, ...]
    doors: Annotated[tuple[DoorMotion, ...], Field(max_length=_MOST_ENTRIES)]
    reached: Annotated[tuple[Moment, ...], Field(max_length=MOST_WAYPOINTS)]
    log: Annotated[tuple[LogLine, ...], Field(max_length=_MOST_ENTRIES)]
    log_before: Annotated[int, Field(ge=0, le=2**53)] = 0


def pack_judgement(judgement: LiveJudgement) -> bytes:
    """Return a judgement for the bus: JSON, compressed to about a fifth.

    A judgement that is too long is replaced by one log line that says so.
    """
    text = codec.to_json(judgement)
    if len(text) > LARGEST_JUDGEMENT:
        count, time = len(judgement.verdicts), judgement.time
        words = f"{count} verdicts and their signals are too long to be shown before the end"
        line = LogLine(time, "oracles", words, "warn")
        text = codec.to_json(LiveJudgement(judgement.run, time, (), (), (), (), (line,)))
    return zlib.compress(text, _FASTEST)


def unpack_judgement(data: bytes, clean: Callable[[bytes], bytes] = bytes) -> LiveJudgement:
    """Read the data of :func:`pack_judgement`; raises ``ValueError`` for anything else.

    ``clean`` is applied to the JSON first. Implausible signals are refused, since they are drawn
    whoever has sent them.
    """
    inflater = zlib.decompressobj()
    try:
        text = inflater.decompress(data, LARGEST_JUDGEMENT)
    except zlib.error as error:
        raise ValueError(f"not compressed as judgements are: {error}") from error
    if not inflater.eof:
        raise ValueError(f"cut, or of more than {LARGEST_JUDGEMENT} bytes")
    judgement = codec.from_json(LiveJudgement, clean(text))
    for signal in judgement.signals:
        # Two intervals are at least one part apart.
        parts = len(signal.low)
        many = len(signal.against) > parts + 1
        if not parts or parts != len(signal.high) or signal.end < signal.start or many:
            raise ValueError(f"{signal.name[:80]}: the parts of the signal contradict each other")
    return judgement
