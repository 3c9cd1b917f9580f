"""First difference between two recordings of one specification."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Final

from daemon.trace._mcap_reader import McapContents, read_mcap
from daemon.trace.layouts import HEADER, ByteArray

_FIRST: Final = (
    "/odom",
    "/scan",
    "/ground_truth",
    "/joint_states",
    "/contacts",
    "/pose",
    "/plan",
    "/cmd_vel",
    "/mission/status",
    "/events",
)
"""Topics from cause to effect, to order differences at one instant: the input of a stack, its
answer, the consequences."""


@dataclass(frozen=True, slots=True)
class TraceDifference:
    """First difference: its ``topic`` and simulated ``time`` [s].

    If all messages are equal, ``topic`` is empty and ``what`` describes the difference.
    """

    topic: str = ""
    time: float = 0.0
    what: str = ""

    def __str__(self) -> str:
        return f"on {self.topic} at {self.time:.2f} s" if self.topic else self.what


def first_difference(one: Path, other: Path) -> TraceDifference | None:
    """Return the first difference of two traces, ``None`` for the same bytes.

    Raises :class:`~daemon.trace.TraceError` for a file that is not a trace.
    """
    if one.read_bytes() == other.read_bytes():
        return None
    first, second = (read_mcap(path, lambda _: True) for path in (one, other))
    topics = sorted(first.runs.keys() | second.runs.keys())
    differences = [
        (time, _FIRST.index(topic) if topic in _FIRST else len(_FIRST), topic)
        for topic in topics
        if (time := _parting(first.runs.get(topic, []), second.runs.get(topic, []))) is not None
    ]
    if differences:
        time, _, topic = min(differences)
        return TraceDifference(topic, time / 1e9)
    return TraceDifference(what=_besides_messages(first, second))


def _parting(one: list[ByteArray], other: list[ByteArray]) -> int | None:
    """Return the earlier time [ns] of the first two different messages."""
    for mine, theirs in zip_longest(_messages(one), _messages(other)):
        if mine != theirs:
            return min(_time(message) for message in (mine, theirs) if message is not None)
    return None


def _messages(runs: list[ByteArray]) -> Iterator[bytes]:
    return (row.tobytes() for rows in runs for row in rows)


def _time(message: bytes) -> int:
    time: int = HEADER.unpack_from(message)[4]
    return time


def _besides_messages(one: McapContents, other: McapContents) -> str:
    """Describe the difference of files with equal messages."""
    names = [
        f"{kind} {name}"
        for kind, mine, theirs in (
            ("metadata", one.metadata, other.metadata),
            ("attachment", one.attachments, other.attachments),
        )
        for name in sorted(mine.keys() | theirs.keys())
        if mine.get(name) != theirs.get(name)
    ]
    return f"in {', '.join(names)}" if names else "in the bytes around the messages"
