"""Judgement of a running run as if it ended now: signals, verdicts and log so far.

Made only while somebody looks, by the code that judges finished runs, from what is recorded; it
never enters a trace or a result. Every message tells the whole, so that one that is lost, or a
watcher who comes late, costs nothing. Times are simulated seconds.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Final, Literal, TypeAlias

from pydantic import Field

from daemon.model.ranges import Moment, SignalValue
from daemon.model.verdicts import Verdict
from grammars.model.mission import MOST_WAYPOINTS
from grammars.text import codec

LARGEST_JUDGEMENT: Final = 2**20
"""Bytes of JSON."""
_FASTEST: Final = 1
_MOST_ENTRIES: Final = 4096
"""Doors' motions, lines of a log, limits or parts of a signal: each is drawn on its own."""

LimitSide: TypeAlias = Literal["above", "below", ""]
_SignalParts = Annotated[tuple[SignalValue | None, ...], Field(max_length=_MOST_ENTRIES)]


@dataclass(frozen=True, slots=True)
class SignalLimit:
    """A value [SI] that oracles compare a signal with.

    ``side`` is where the signal speaks against them, empty where no single sample does, or where
    two of them want opposite things.
    """

    value: SignalValue
    side: LimitSide = ""


@dataclass(frozen=True, slots=True)
class LiveSignal:
    """A signal so far, thinned: least and greatest value in equal parts of ``start`` to ``end``.

    ``low`` and ``high`` have the same length; ``None`` where nothing is known (JSON has no NaN).
    ``unit`` is ``bool`` for what is true or false. ``against`` are stretches [s] in which the run
    spoke against an oracle that reads it, and ``readers`` name these oracles.
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
    """A joint that leaves (``opens``) or comes back to (not ``opens``) how it is drawn, shut."""

    time: Moment
    joint: str
    opens: bool


@dataclass(frozen=True, slots=True)
class LiveJudgement:
    """A running run, judged up to ``time`` [s].

    ``verdicts`` are those of the run if it ended now; a failure that what is still to come may mend
    is ``inconclusive`` instead: to call it a failure would be wrong.
    ``reached`` are the moments waypoints were done; of ``doors`` the last thousand motions are
    told. ``log`` is the end of the log, in the order of time; ``log_before`` counts the lines
    before it that are left out.
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
    """Return a judgement as it travels: JSON, compressed to about a fifth.

    Of one that is too long to be read only a line of its log is left, which says so.
    """
    text = codec.to_json(judgement)
    if len(text) > LARGEST_JUDGEMENT:
        count, time = len(judgement.verdicts), judgement.time
        words = f"{count} verdicts and their signals are too long to be told before the end"
        line = LogLine(time, "oracles", words, "warn")
        text = codec.to_json(LiveJudgement(judgement.run, time, (), (), (), (), (line,)))
    return zlib.compress(text, _FASTEST)


def unpack_judgement(data: bytes, clean: Callable[[bytes], bytes] = bytes) -> LiveJudgement:
    """Read what :func:`pack_judgement` made; raises ``ValueError`` for anything else.

    The JSON is read as ``clean`` returns it. What no run is told by is refused as a whole: it is
    drawn, whoever has sent it.
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
        # No two stretches are less than a part apart.
        parts = len(signal.low)
        many = len(signal.against) > parts + 1
        if not parts or parts != len(signal.high) or signal.end < signal.start or many:
            raise ValueError(f"{signal.name[:80]}: the parts of the signal do not go together")
    return judgement
