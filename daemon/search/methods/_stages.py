"""A method as a row of stages: which of them makes a proposal depends on its number alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

from daemon.model.search import Point
from daemon.search.methods._history import SearchHistory


@dataclass(frozen=True, slots=True)
class MethodProposal:
    """A point to run.

    ``method`` is what chose it: ``written`` for the scenario as it stands, else the name of a
    method. What is not ``guided`` was chosen without looking at results.
    """

    values: Point
    method: str
    guided: bool


class Stage(Protocol):
    """A way to choose points."""

    @property
    def name(self) -> str:
        """What is told of the points it chooses."""

    def choose(self, number: int, history: SearchHistory) -> Choice | None:
        """Return a new point, ``None`` when there is no other."""


Choice = tuple[Point, bool]
"""A point, and whether results had a part in choosing it."""


class SearchMethod:
    """The scenario as written first, then every stage from its first number on.

    Everything is a function of the task, the numbers and what was learnt. Proposals are asked for
    in order of their numbers, from 0. Proposal ``n`` is made of the results up to number
    ``n - window`` and of no others, however many have been learnt by then, so that proposals do not
    depend on which run ends first; those that are out are known to be.
    """

    def __init__(self, history: SearchHistory, stages: Sequence[tuple[int, Stage]]) -> None:
        self._history: Final = history
        self._stages: Final = tuple(stages)
        self._proposals: Final[list[MethodProposal | None]] = []

    def propose(self, number: int) -> MethodProposal | None:
        """Return proposal ``number``; ``None`` when no other point is left.

        Asked again it is the same one. Raises ``ValueError`` when one before it was not asked for.
        """
        if number > len(self._proposals):
            raise ValueError(f"proposal {len(self._proposals)} comes before {number}")
        if number == len(self._proposals):
            proposal = self._make(number)
            self._proposals.append(proposal)
            if proposal is not None:
                self._history.take(number, proposal.values)
        return self._proposals[number]

    def learn(self, number: int, point: Point, value: float | None) -> None:
        """Take in what a proposal gave; lower values are nearer to failing, ``None`` says nothing.

        What is learnt of a number once is not changed.
        """
        self._history.learn(number, point, value)

    def best(self) -> int | None:
        """Return the number with the lowest value learnt, the first of equals."""
        return self._history.best()

    def _make(self, number: int) -> MethodProposal | None:
        written = self._history.space.written
        if number == 0 and written is not None:
            return MethodProposal(written, "written", False)
        stage = [stage for first, stage in self._stages if first <= number][-1]
        choice = stage.choose(number, self._history)
        return None if choice is None else MethodProposal(choice[0], stage.name, choice[1])


class HaltonStage:
    """Points of a scrambled Halton sequence, which fill the space evenly."""

    name: Final = "halton"

    def choose(self, number: int, history: SearchHistory) -> Choice | None:
        """Return the next point of the sequence."""
        point = history.next_even()
        return None if point is None else (point, False)


class RandomStage:
    """Points drawn at random, each from the generator of its number."""

    name: Final = "random"
    _TRIES: Final = 1000

    def choose(self, number: int, history: SearchHistory) -> Choice | None:
        """Return the next point drawn; where none is new, the next even one."""
        rng, dimensions = history.generator(number), history.space.dimensions
        point = history.first_new(rng.random(dimensions) for _ in range(self._TRIES))
        point = history.next_even() if point is None else point
        return None if point is None else (point, False)
