"""What the world reports besides its state: contacts of the robot and events of behaviours."""

from __future__ import annotations

from dataclasses import dataclass

from grammars.values import Point2


@dataclass(frozen=True, slots=True)
class Contact:
    """The robot touches something, or still does.

    ``time`` is when this touch began, ``until`` the last instant of it seen so far [s]; a touch
    that resumes within 0.1 s is the same touch. ``first`` is ``robot``, ``second`` the owner of
    what it touches (a floor plan element, or ``<object>.<link>``). ``point`` (world), ``normal``
    (unit, from first to second) and ``depth`` of penetration [m] belong to the deepest of the
    instants looked at since the previous report: whenever a touch begins, and at the report.
    """

    time: float
    first: str
    second: str
    point: Point2
    normal: Point2
    depth: float
    until: float


@dataclass(frozen=True, slots=True)
class WorldEvent:
    """Something a behaviour did at ``time`` [s]; ``source`` is the scene-wide joint name."""

    time: float
    source: str
    text: str
