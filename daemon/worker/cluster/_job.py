"""What gateway and cluster say to each other: a job, and what became of it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from daemon.executor import Limits
from daemon.messages import Grant

LARGEST_TRACE: Final = 256 * 2**20
"""Bytes of a trace that travel as the result of a Dask task, through the memory of three
processes."""
LARGEST_GIFT: Final = 256 * 2**20
"""Bytes of scene and files that travel with one task."""


@dataclass(frozen=True, slots=True)
class Job:
    """One attempt; what it tells meanwhile is published under ``topic``."""

    executor: str
    grant: Grant
    limits: Limits
    topic: str


class Fate(StrEnum):
    """What became of a job.

    ``done``: result and trace are here. ``failed``: it left none. ``missing``: ask again
    and give it what the report names. ``unfit``: this Dask worker executes no runs.
    ``stopped``: nobody wanted it.
    """

    DONE = "done"
    FAILED = "failed"
    MISSING = "missing"
    UNFIT = "unfit"
    STOPPED = "stopped"


@dataclass(frozen=True, slots=True)
class Report:
    """The end of a job on Dask worker ``worker``; ``blame`` is the run's for having failed.

    It ``lacks`` the system under test, or things ``missing``, by digest.
    """

    fate: Fate
    worker: str
    words: str = ""
    blame: bool = False
    lacks: bool = False
    missing: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class News:
    """What a job under way tells: a :class:`daemon.protocol.Live` in JSON."""

    key: str
    live: str
