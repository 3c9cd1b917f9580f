"""Random key frames of joints that change between two positions."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from grammars.model.behaviour import KeyFrame
from grammars.scenery.composition._rings import rounded

MOST_DRAWS: Final = 100_000
"""Draws for one joint at most; more are a mistake in the units."""
SHORTEST: Final = 0.01
"""Shortest time between two changes [s]: one tick of the simulation."""


@dataclass(frozen=True, slots=True)
class RandomWaits:
    """Random waiting times [s] between changes from ``since`` to ``until``.

    ``uniform`` from ``first`` to ``second``; ``exponential`` with mean ``first``; ``normal`` with
    mean ``first`` and deviation ``second``, where non-positive draws are repeated.
    """

    kind: Literal["uniform", "exponential", "normal"]
    first: float
    second: float
    since: float
    until: float

    @property
    def count(self) -> float:
        """Approximate number of changes."""
        mean = (self.first + self.second) / 2 if self.kind == "uniform" else self.first
        return max(0.0, self.until - self.since) / mean

    def one(self, generator: np.random.Generator) -> float:
        """Draw one waiting time."""
        if self.kind == "uniform":
            return float(generator.uniform(self.first, self.second))
        if self.kind == "exponential":
            return float(generator.exponential(self.first))
        wait = 0.0
        while wait <= 0.0:
            wait = float(generator.normal(self.first, self.second))
        return wait

    def draw(
        self, seed: np.random.SeedSequence, first: float, second: float
    ) -> tuple[KeyFrame, ...]:
        """Return key frames that start with ``first`` at 0 s and change after every wait."""
        # One by one, since the number of repeated draws is unknown.
        generator = np.random.default_rng(seed)
        frames = [KeyFrame(0.0, first)]
        time = self.since
        while True:
            # A shorter wait would put two key frames into one tick.
            time += max(SHORTEST, self.one(generator))
            if time > self.until:
                return tuple(frames)
            position = second if frames[-1].position == first else first
            frames.append(KeyFrame(rounded(time), position))


@dataclass(frozen=True, slots=True)
class RandomToggles:
    """Random changes at ``since``, ``since + period``, … up to ``until`` [s].

    Each draw changes the joint with ``probability``, late by a uniform share of ``delay`` [s],
    rounded down to multiples of ``step`` [s] unless that is 0.
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
        """Number of draws."""
        if self.until < self.since:
            return 0
        return int(min((self.until - self.since) / self.period + 1e-9, 1e12)) + 1

    def draw(
        self, seed: np.random.SeedSequence, first: float, second: float
    ) -> tuple[KeyFrame, ...]:
        """Return key frames that start with ``first`` at 0 s and end by ``limit`` [s].

        Every draw takes two random numbers, even without a change, so that another probability or
        delay does not shift the rest.
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
    """Return the child of ``seed`` for ``name``, with a stable hash of the name as spawn key."""
    # SeedSequence.spawn counts, so that an additional door would change all others.
    digest = hashlib.sha256(name.encode()).digest()
    words = tuple(int.from_bytes(digest[i : i + 4], "little") for i in range(0, 16, 4))
    return np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, *words))
