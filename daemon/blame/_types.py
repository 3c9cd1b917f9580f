"""What can be to blame, and what blame found, as values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from daemon.verdict import Verdict

Kind: TypeAlias = Literal[
    "objects", "behaviours", "override", "parameter", "object", "waypoint", "behaviour"
]
Word: TypeAlias = Literal["pass", "fail", "unresolved"]


@dataclass(frozen=True, slots=True)
class Element:
    """Something a failing run has that it could do without.

    ``objects`` and ``behaviours``: a scenery layer; ``override``: what the campaign says about a
    parameter of one; ``parameter``: a value in which the system under test differs from the one
    it is like. ``object``, ``waypoint`` and ``behaviour``: single ones of the composed run.
    ``index`` tells equal names apart.
    """

    kind: Kind
    name: str
    index: int = 0

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True, slots=True)
class Without:
    """How the run ends without one of the elements that it needs to fail."""

    element: Element
    word: Word
    note: str = ""


@dataclass(frozen=True, slots=True)
class Blame:
    """The story of a failure.

    ``verdict`` is the oracle's verdict on the run, ``flips`` the layer or parameter whose adding,
    in the order of the campaign, turns it to a failure; ``layers`` are those needed, with how the
    run ends without each. ``objects``, ``waypoints``, ``behaviours`` and ``parameters`` are what
    is left of the whole run, of ``before`` of each kind, and ``last`` its verdict. ``minimal``
    says whether it is proven that nothing else can be taken away; if not, ``stopped`` says why.
    """

    run: str
    verdict: Verdict
    flips: Element | None
    layers: tuple[Without, ...]
    objects: tuple[str, ...]
    behaviours: tuple[str, ...]
    waypoints: tuple[str, ...]
    parameters: tuple[str, ...]
    before: tuple[tuple[Kind, int], ...]
    last: Verdict
    minimal: bool
    stopped: str


class NoFailureError(ValueError):
    """There is nothing to explain: the run passes, or does not fail again; the message says so."""
