"""Traces that figures are drawn from once more, each read once for those that follow each other."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Final

from daemon.judging.oracles import SignalSampler
from daemon.trace import read_trace

_KEPT: Final = 2
"""Traces that are kept: with what moves in its building a run of the reference stack has 13 MB."""


def sampled_trace(path: Path) -> SignalSampler:
    """Return the signals of a trace, read without its scans.

    Raises :class:`daemon.trace.TraceError` as reading it does.
    """
    try:
        file = path.stat()
    except OSError:
        # Gone by now: reading it says so.
        return SignalSampler(read_trace(path))
    return _sampled(path, file.st_mtime_ns, file.st_size)


def forget_traces() -> None:
    """Let go of what is kept."""
    _sampled.cache_clear()


@functools.lru_cache(maxsize=_KEPT)
def _sampled(path: Path, changed: int, size: int) -> SignalSampler:
    return SignalSampler(read_trace(path))
