"""Proposals: the runs of a search.

A *proposal* is a point to run. Proposal ``n`` of search ``S`` is the scenario ``S.n``, so every run
of a search is an ordinary run. :mod:`daemon.model.trials` evaluates it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal, TypeAlias

from pydantic import Field

from daemon.model.ranges import NonNegativeInt, ShortText
from daemon.model.search import Point
from daemon.model.submission import Submission

Phase: TypeAlias = Literal["explore", "confirm", "nearest", "shrink"]
"""Purpose of a run: to find failures, to repeat one with other noise, to bring one nearer to the
scenario as written, to remove its unnecessary parts."""


@dataclass(frozen=True, slots=True)
class Proposal:
    """Subject of a run of a search: a point and a purpose.

    ``number`` counts proposals, ``repeat`` the repeats of one; ``position`` counts runs. Proposals
    that are not ``guided`` were chosen without looking at results: only their runs show how
    frequent failures are. ``note`` describes an attempt that its point does not
    (``without bedroom_door``).
    """

    position: NonNegativeInt
    number: NonNegativeInt
    repeat: NonNegativeInt
    phase: Phase
    method: str
    guided: bool
    values: Point
    note: str = ""


@dataclass(frozen=True, slots=True)
class ExtendRequest:
    """More runs of a search, ``runs`` in the order of ``proposals``.

    Positions that have a run already keep it, so repeating the request is harmless.
    """

    client: ShortText
    proposals: Annotated[tuple[Proposal, ...], Field(min_length=1, max_length=1000)]
    runs: Submission
