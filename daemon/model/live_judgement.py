"""What a run that goes on would be judged by now: signals so far, verdicts so far, its log.

Made only while somebody looks, by the code that judges finished runs, from what is recorded; it
never enters a trace or a result. Every message tells the whole, so that one that is lost, or a
watcher who comes late, costs nothing. Times are simulated seconds.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Final

from daemon.model.live_checks import LARGEST_VALUE, check_times
from daemon.model.verdicts import Verdict, shorten_evidence
from grammars.model.mission import MOST_WAYPOINTS
from grammars.text import codec

LARGEST_JUDGEMENT: Final = 2**20
"""Bytes of JSON."""
_FASTEST: Final = 1
_MOST_ENTRIES: Final = 4096
"""Doors' motions, lines of a log, limits or parts of a signal: each is drawn on its own."""


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
    """Return a judgement as it travels: JSON, compressed to about a fifth.

    What makes it too long to be read is left out: long evidence first, then verdicts, then the
    rest. The last line of its log says so.
    """
    text = b""
    for told in _shorter_and_shorter(judgement):
        text = codec.to_json(told)
        if len(text) <= LARGEST_JUDGEMENT:
            break
    return zlib.compress(text, _FASTEST)


def _shorter_and_shorter(judgement: LiveJudgement) -> Iterator[LiveJudgement]:
    yield judgement
    verdicts = tuple(
        replace(one, verdict=shorten_evidence(one.verdict)) for one in judgement.verdicts
    )
    yield replace(judgement, verdicts=verdicts)
    words = f"{len(verdicts)} verdicts are too long to be told so far: they come at the end"
    missing = LogLine(judgement.time, "oracles", words, "warn")
    yield replace(judgement, verdicts=(), log=(*judgement.log, missing))
    yield LiveJudgement(judgement.run, judgement.time, (), (), (), (), (missing,))


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
    _check_judgement(judgement)
    return judgement


def _check_judgement(judgement: LiveJudgement) -> None:
    """Raise ``ValueError`` for what no run is told by: it is drawn, whoever has sent it."""
    evidence = (one.verdict.evidence.time for one in judgement.verdicts)
    check_times((judgement.time, *judgement.reached))
    check_times(motion.time for motion in judgement.doors)
    check_times(line.time for line in judgement.log)
    check_times(time for time in evidence if time is not None)
    for told, most in (
        (judgement.reached, MOST_WAYPOINTS),
        (judgement.doors, _MOST_ENTRIES),
        (judgement.log, _MOST_ENTRIES),
    ):
        if len(told) > most:
            raise ValueError(f"{len(told)} entries, at most {most} are told")
    if not 0 <= judgement.log_before <= 2**53:
        raise ValueError(f"{judgement.log_before} lines before the log")
    for signal in judgement.signals:
        _check_signal(signal)


def _check_signal(signal: LiveSignal) -> None:
    parts = len(signal.low)
    if parts != len(signal.high) or signal.end < signal.start:
        raise ValueError(f"{signal.name[:80]}: least and greatest values do not go together")
    check_times((signal.start, signal.end))
    check_times(moment for span in signal.against for moment in span)
    # No two stretches are less than a part apart.
    if len(signal.against) > parts + 1 or max(parts, len(signal.limits)) > _MOST_ENTRIES:
        raise ValueError("a signal of more parts than are told")
    known = (value for value in (*signal.low, *signal.high, *signal.limits) if value is not None)
    if any(abs(value) > LARGEST_VALUE for value in known):
        raise ValueError(f"a signal beyond {LARGEST_VALUE:g}")
