"""The runs of a search, as they are proposed.

A *proposal* is a point that is to be run; proposal ``n`` of search ``S`` is the scenario ``S.n``,
so that every run of a search is an ordinary run. :mod:`daemon.model.trials` says what it is worth.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal, TypeAlias

from pydantic import Field

from daemon.model.ranges import NonNegativeInt, ShortText
from daemon.model.search import Point
from daemon.model.submission import Submission

Phase: TypeAlias = Literal["explore", "confirm", "nearest", "shrink"]
"""What a run is for: to find failures, to repeat one with other noise, to bring one nearer to the
scenario as written, to take away from it what it does not need."""


@dataclass(frozen=True, slots=True)
class Proposal:
    """What a run of a search is about: a point and a purpose.

    ``number`` counts proposals, ``repeat`` the repeats of one; ``position`` counts runs. What is
    not ``guided`` was chosen without looking at results: only such runs tell how frequent failures
    are. ``note`` says in a few words what was tried (``without bedroom_door``), where a point does
    not.
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

    What is there already at its position is left as it is, so that asking twice is harmless.
    """

    client: ShortText
    proposals: Annotated[tuple[Proposal, ...], Field(min_length=1, max_length=1000)]
    runs: Submission
