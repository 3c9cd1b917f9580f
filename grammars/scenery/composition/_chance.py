"""Chance, drawn once: joints that change between two positions at random times."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from grammars.model.behaviour import KeyFrame
from grammars.scenery.composition._rings import rounded

MOST_DRAWS: Final = 100_000
"""More draws than this for one joint are a mistake in the units."""


SHORTEST: Final = 0.01
"""Least time between two changes [s]: one tick of the simulation."""


@dataclass(frozen=True, slots=True)
class RandomWaits:
    """Waiting times [s] between changes, from ``since`` to ``until``, of one distribution.

    ``uniform`` from ``first`` to ``second``; ``exponential`` with mean ``first``; ``normal`` with
    mean ``first`` and deviation ``second``, where a draw that is not positive is drawn again.
    """

    kind: Literal["uniform", "exponential", "normal"]
    first: float
    second: float
    since: float
    until: float

    @property
    def count(self) -> float:
        """About how many changes that makes."""
        mean = (self.first + self.second) / 2 if self.kind == "uniform" else self.first
        return max(0.0, self.until - self.since) / mean

    def one(self, generator: np.random.Generator) -> float:
        """Draw one waiting time."""
        if self.kind == "uniform":
            return float(generator.uniform(self.first, self.second))
        if self.kind == "exponential":
            return float(generator.exponential(self.first))
        drawn = 0.0
        while drawn <= 0.0:
            drawn = float(generator.normal(self.first, self.second))
        return drawn

    def draw(
        self, seed: np.random.SeedSequence, first: float, second: float
    ) -> tuple[KeyFrame, ...]:
        """Return key frames from ``first`` at 0 s on, changing after every waiting time."""
        # One by one, as normal waits may be drawn again: nobody knows how many numbers it takes.
        generator = np.random.default_rng(seed)
        frames = [KeyFrame(0.0, first)]
        time = self.since
        while True:
            # A wait of less than a tick would put two key frames into one.
            time += max(SHORTEST, self.one(generator))
            if time > self.until:
                return tuple(frames)
            position = second if frames[-1].position == first else first
            frames.append(KeyFrame(rounded(time), position))


@dataclass(frozen=True, slots=True)
class RandomToggles:
    """A draw at ``since``, ``since + period``, … up to ``until`` [s].

    Each changes the joint with ``probability``, late by a uniform share of ``delay`` [s], rounded
    down to multiples of ``step`` [s] unless that is 0.
    """

    period: float
    since: float
    until: float
    limit: float
    probability: float
    delay: float
    step: float

    @property
    def count(self) -> int:
        """How many draws that makes."""
        if self.until < self.since:
            return 0
        return int(min((self.until - self.since) / self.period + 1e-9, 1e12)) + 1

    def draw(
        self, seed: np.random.SeedSequence, first: float, second: float
    ) -> tuple[KeyFrame, ...]:
        """Return key frames from ``first`` at 0 s on; none later than ``limit`` [s].

        Two numbers are used for every draw whether it changes anything or not, so another
        probability or lateness does not shift the rest.
        """
        draws = np.random.default_rng(seed).random((self.count, 2))
        frames = [KeyFrame(0.0, first)]
        position = first
        for index, (luck, lateness) in enumerate(draws.tolist()):
            if luck >= self.probability:
                continue
            late = self.delay * lateness
            if self.step > 0.0:
                late = self.step * int(late / self.step)
            at = rounded(self.since + index * self.period + late)
            if at > self.limit:
                break
            position = second if position == first else first
            if at > frames[-1].time:
                frames.append(KeyFrame(at, position))
            else:
                frames[-1] = KeyFrame(frames[-1].time, position)
        return tuple(frames)


def child_seed(seed: np.random.SeedSequence, name: str) -> np.random.SeedSequence:
    """Return the child of ``seed`` for ``name``: a stable hash of it is the spawn key."""
    # Not SeedSequence.spawn, which counts: a door more would shift the chance of all others.
    digest = hashlib.sha256(name.encode()).digest()
    words = tuple(int.from_bytes(digest[i : i + 4], "little") for i in range(0, 16, 4))
    return np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, *words))
