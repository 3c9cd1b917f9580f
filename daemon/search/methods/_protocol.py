"""What a method of searching is: it proposes points, learns what they gave, and knows the best."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from daemon.model.search import Point


@dataclass(frozen=True, slots=True)
class MethodProposal:
    """A point to run.

    ``method`` is what chose it: ``written`` for the scenario as it stands, else the name of a
    method. What is not ``guided`` was chosen without looking at results.
    """

    values: Point
    method: str
    guided: bool


class SearchMethod(Protocol):
    """Proposes points; everything is a function of the task, the numbers and what was learnt.

    Proposals are asked for in order of their numbers, from 0. Proposal ``n`` is made of the results
    up to number ``n - window`` and of no others, however many have been learnt by then, so that
    proposals do not depend on which run ends first; those that are out are known to be.
    """

    def propose(self, number: int) -> MethodProposal | None:
        """Return proposal ``number``; ``None`` when no other point is left.

        Asked again it is the same one.
        """

    def learn(self, number: int, point: Point, value: float | None) -> None:
        """Take in what a proposal gave; lower values are nearer to failing, ``None`` says nothing.

        What is learnt of a number once is not changed.
        """

    def best(self) -> int | None:
        """Return the number with the lowest value learnt, the first of equals."""
