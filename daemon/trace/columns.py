"""Columns of numbers collected during a run, turned into message records at once."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from daemon.trace.container import Block
from daemon.trace.layout import HEADER, MESSAGE_OPCODE, Ints, Layout


class Columns:
    """Samples of one signal: a time [ns] and a fixed number of floats each.

    Appending costs a fraction of a microsecond; nothing is encoded before :meth:`take`.
    """

    __slots__ = ("_times", "_values", "names")

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self._times = array("q")
        self._values = array("d")

    def __len__(self) -> int:
        return len(self._times)

    def add(self, time: int, values: Iterable[float]) -> None:
        """Append a sample; ``values`` in the order of ``names``."""
        self._times.append(time)
        self._values.extend(values)

    def take(self) -> tuple[Ints, dict[str, npt.NDArray[Any]]]:
        """Return the samples as times (n,) and one column (n,) per name, and start anew."""
        times = np.frombuffer(self._times, np.int64)
        values = np.frombuffer(self._values, np.float64).reshape(len(times), len(self.names))
        self._times, self._values = array("q"), array("d")
        return times, {name: values[:, i] for i, name in enumerate(self.names)}


class Records:
    """Ready-made messages of one channel, for what is rare or of varying size."""

    __slots__ = ("_channel", "_parts", "_times", "size")

    def __init__(self, channel: int) -> None:
        self._channel = channel
        self._times: list[int] = []
        self._parts: list[bytes] = []
        self.size = 0

    def add(self, time: int, payload: bytes) -> None:
        """Append a serialized message."""
        length = HEADER.size - 9 + len(payload)
        head = HEADER.pack(MESSAGE_OPCODE, length, self._channel, 0, time, time)
        self._times.append(time)
        self._parts.append(head + payload)
        self.size += len(head) + len(payload)

    def take(self) -> Block:
        """Return the messages as a block and start anew."""
        lengths = np.array([0, *map(len, self._parts)], np.int64)
        block = Block(
            self._channel,
            np.array(self._times, np.int64),
            np.cumsum(lengths)[:-1],
            b"".join(self._parts),
        )
        self._times, self._parts, self.size = [], [], 0
        return block


def block(layout: Layout, channel: int, times: Ints, columns: dict[str, npt.NDArray[Any]]) -> Block:
    """Encode columns as a block of messages with the given layout."""
    rows = layout.encode(channel, times, columns)
    offsets = np.arange(len(times), dtype=np.int64) * rows.shape[1]
    return Block(channel, times, offsets, rows.tobytes())
