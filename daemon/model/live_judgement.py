"""What a run that goes on would be judged by now: signals so far, verdicts so far, its log.

Made only while somebody looks, by the code that judges finished runs, from what is recorded; it
never enters a trace or a result. Every message tells the whole, so that one that is lost, or a
watcher who comes late, costs nothing. Times are simulated seconds.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from daemon.model.verdicts import Verdict
from grammars.text import codec

LARGEST_JUDGEMENT: Final = 2**20
"""Bytes of JSON."""
_FASTEST: Final = 1


@dataclass(frozen=True, slots=True)
class LiveSignal:
    """A signal so far, thinned: least and greatest value in equal parts of ``start`` to ``end``.

    ``low`` and ``high`` have the same length; ``None`` where nothing is known (JSON has no NaN).
    ``unit`` is ``bool`` for what is true or false. ``limits`` [SI] are what oracles compare it
    with, ``against`` stretches [s] in which the run spoke against an oracle that reads it, and
    ``readers`` name these oracles.
    """

    name: str
    unit: str
    start: float
    end: float
    low: tuple[float | None, ...]
    high: tuple[float | None, ...]
    limits: tuple[float, ...] = ()
    against: tuple[tuple[float, float], ...] = ()
    readers: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ProvisionalVerdict:
    """What an oracle says of a run so far.

    ``verdict`` is that of the run if it ended now. ``final`` says that nothing that can still
    happen changes its outcome (a contact is not undone, a waypoint stays reached); what is neither
    final nor against the run yet is ``open``: the oracle waits for something, and to call it a
    failure would be wrong.
    """

    verdict: Verdict
    final: bool = False
    open: bool = False


@dataclass(frozen=True, slots=True)
class LogLine:
    """A line of the log of a run, at a moment of simulated time [s]; ``level`` as in ROS."""

    time: float
    source: str
    text: str
    level: str = "info"


@dataclass(frozen=True, slots=True)
class DoorMotion:
    """A joint that leaves (``opens``) or comes back to (not ``opens``) how it is drawn, shut."""

    time: float
    joint: str
    opens: bool


@dataclass(frozen=True, slots=True)
class LiveJudgement:
    """A running run, judged up to ``time`` [s].

    ``reached`` are the moments waypoints were done; of ``doors`` the last thousand motions are
    told. ``log`` is the end of the log, in the order of time; ``log_before`` counts the lines
    before it that are left out.
    """

    run: str
    time: float
    signals: tuple[LiveSignal, ...]
    verdicts: tuple[ProvisionalVerdict, ...]
    doors: tuple[DoorMotion, ...]
    reached: tuple[float, ...]
    log: tuple[LogLine, ...]
    log_before: int = 0


def pack_judgement(judgement: LiveJudgement) -> bytes:
    """Return a judgement as it travels: JSON, compressed to about a fifth."""
    return zlib.compress(codec.to_json(judgement), _FASTEST)


def unpack_judgement(data: bytes, clean: Callable[[bytes], bytes] = bytes) -> LiveJudgement:
    """Read what :func:`pack_judgement` made; raises ``ValueError`` for anything else.

    The JSON is read as ``clean`` returns it.
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
        if len(signal.low) != len(signal.high) or signal.end < signal.start:
            raise ValueError(f"{signal.name}: least and greatest values do not go together")
    return judgement
