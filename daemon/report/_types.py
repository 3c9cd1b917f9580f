"""What a report is made from: runs, and what their traces say, thinned for paper and screen."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from daemon.assessment import Declared, RunRecord
from grammars.behaviour import Trigger
from grammars.values import Point2, Ring

Thin = npt.NDArray[np.float32]
"""Samples kept for drawing; numbers that count are taken from all samples before."""


@dataclass(frozen=True, slots=True)
class Watch:
    """A trigger of some scenario: runs without it are looked at when they come as near."""

    trigger: Trigger

    @property
    def name(self) -> str:
        """The joint that is triggered, ``door-17.hinge``."""
        return self.trigger.joint


@dataclass(frozen=True, slots=True)
class Chosen:
    """A campaign chosen for a report.

    ``id`` is empty for a folder of traces, ``where`` says which folder or state directory.
    ``oracles`` are the texts of all oracles, ``watches`` the triggers of all scenarios, each once.
    ``unread`` are files that are no usable traces, with the reason.
    """

    id: str
    name: str
    about: str
    where: str
    declared: Declared
    records: tuple[RunRecord, ...]
    oracles: tuple[str, ...] = ()
    watches: tuple[Watch, ...] = ()
    unread: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Buffer:
    """The safety buffer the report looks at: a box in the base frame, half extents [m].

    Without ``half`` it is the box around the footprint and ``margin`` [m] more on every side.
    ``source`` says in words where it is from.
    """

    half: Point2 | None
    margin: float
    source: str


@dataclass(frozen=True, slots=True, eq=False)
class Passing:
    """The robot near what triggers, from ``before`` to ``after`` the moment it came so near.

    ``fired``: the trigger is part of the scenario; otherwise it only would have been. ``time`` [s]
    of the run; ``since`` (n,) [s] around it, with ``speed`` [m/s] and ``turning`` [rad/s].
    """

    joint: str
    time: float
    fired: bool
    speed_then: float
    since: Thin
    speed: Thin
    turning: Thin


@dataclass(frozen=True, slots=True, eq=False)
class Driven:
    """What the trace of one run says. Tracks have the shape (n,), all on ``time`` [s].

    ``x``, ``y`` [m]: true position. ``clearance`` [m]: distance from the box around the footprint
    to the nearest obstacle, negative inside. ``error``, ``sigma_x``, ``sigma_y`` [m]: localisation;
    NaN where unknown. ``inside`` (k, 2) [m]: points of obstacles that were inside the buffer, base
    frame. ``contacts`` (time, object, x, y). ``measures`` by name, in the units of
    :data:`daemon.report.MEASURES`. ``problem`` says why there is nothing, if so.
    """

    run: str
    problem: str = ""
    footprint: Ring = ()
    body: Point2 = (0.0, 0.0)
    buffer: Point2 = (0.0, 0.0)
    limit: float = 0.0
    time: Thin = field(default_factory=lambda: np.empty(0, np.float32))
    x: Thin = field(default_factory=lambda: np.empty(0, np.float32))
    y: Thin = field(default_factory=lambda: np.empty(0, np.float32))
    clearance: Thin = field(default_factory=lambda: np.empty(0, np.float32))
    error: Thin = field(default_factory=lambda: np.empty(0, np.float32))
    sigma_x: Thin = field(default_factory=lambda: np.empty(0, np.float32))
    sigma_y: Thin = field(default_factory=lambda: np.empty(0, np.float32))
    inside: Thin = field(default_factory=lambda: np.empty((0, 2), np.float32))
    contacts: tuple[tuple[float, str, float, float], ...] = ()
    passings: tuple[Passing, ...] = ()
    measures: dict[str, float] = field(default_factory=dict)
    scene: str = ""
