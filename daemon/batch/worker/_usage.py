"""The share of its machine that a worker takes: processor time and memory of its processes."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

import psutil

_PERIOD: Final = 1.0
"""Seconds between two looks at the processes: one costs about a millisecond for each of them."""


@dataclass(frozen=True, slots=True)
class Usage:
    """What a worker and its children use, as in :class:`daemon.model.status.WorkerRow`."""

    cpu: float
    memory: int
    memory_total: int


class UsageMeter:
    """Measures this process and all that descends from it, at most once a second."""

    def __init__(self) -> None:
        self._process = psutil.Process()
        self._cores = psutil.cpu_count() or 1
        self._total = psutil.virtual_memory().total
        self._measured_at = time.monotonic()
        self._seconds, memory = self._look()
        self._usage = Usage(0.0, memory, self._total)

    def measure(self) -> Usage:
        """Return the usage since the look before, or the one of then if that was just now."""
        passed = time.monotonic() - self._measured_at
        if passed >= _PERIOD:
            seconds, memory = self._look()
            cpu = (seconds - self._seconds) / (passed * self._cores)
            self._usage = Usage(min(1.0, max(0.0, cpu)), memory, self._total)
            self._measured_at += passed
            self._seconds = seconds
        return self._usage

    def _look(self) -> tuple[float, int]:
        """Return the processor time so far [s] and the memory [B]."""
        seconds, memory = 0.0, 0
        for process in (self._process, *self._process.children(recursive=True)):
            with suppress(psutil.Error):  # it ends in this moment
                # Children that have ended count with the parent that has waited for them.
                seconds += sum(process.cpu_times()[:4])
                # Runs are forked from one process: their resident sizes would count most pages many
                # times.
                memory += process.memory_full_info().pss
        return seconds, memory
