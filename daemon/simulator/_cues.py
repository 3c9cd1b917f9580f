"""Events of a run that reactions and walks wait for: each happens once."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Mapping, Sequence

from grammars.behaviour import Event, JointActs, LegBegins, WaypointReached

Act = Callable[[], None]
STIRRED = 0.01
"""A joint this far from where it started has started to move [rad or m]."""


class Cues:
    """Who waits for what, and what is due after its delay.

    Attributes:
        due: tick at which the next act is due, if any.
    """

    def __init__(
        self, waypoints: Sequence[str], positions: Mapping[str, Callable[[], float]]
    ) -> None:
        self._waypoints = list(waypoints)
        self._positions = positions
        self._waiting: list[tuple[Event, int, Act]] = []
        self._agenda: list[tuple[int, int, Act]] = []
        self._watched: dict[str, float] = {}
        self._count = 0

    def wait(self, event: Event, delay: int, act: Act) -> None:
        """Let ``act`` be called ``delay`` ticks after ``event``.

        Raises:
            ValueError: the mission has no such waypoint.
        """
        if isinstance(event, WaypointReached) and event.waypoint not in self._waypoints:
            raise ValueError(f"the mission has no waypoint {event.waypoint!r}")
        self._waiting.append((event, delay, act))
        self._watch()

    def _watch(self) -> None:
        """Look at the joints that somebody waits to see moving, from where they are now."""
        wanted = {
            name
            for event, _, _ in self._waiting
            if isinstance(event, JointActs) and event.act == "moves"
            for name in event.joints
            if name in self._positions
        }
        self._watched = {
            name: self._watched.get(name, self._positions[name]()) for name in sorted(wanted)
        }

    @property
    def due(self) -> float:
        """The tick of the next act on the agenda; infinite without one."""
        return self._agenda[0][0] if self._agenda else float("inf")

    @property
    def watching(self) -> bool:
        """Whether :meth:`look` must be called every tick."""
        return bool(self._watched)

    def progress(self, current: int, reached: int, tick: int) -> None:
        """Take note of the mission: index of the waypoint approached, number of those reached."""

        def happened(event: Event) -> bool:
            if isinstance(event, LegBegins):
                return current >= event.leg - 1
            if isinstance(event, WaypointReached):
                return reached > self._waypoints.index(event.waypoint)
            return False

        self._happen(happened, tick)

    def fired(self, joint: str, tick: int) -> None:
        """Take note that the behaviour of a joint went off."""
        self._happen(lambda e: isinstance(e, JointActs) and e.act == "fires" and joint in e.joints,
                     tick)  # fmt: skip

    def look(self, tick: int) -> None:
        """Take note of joints that started to move."""
        stirred = {
            name
            for name, start in self._watched.items()
            if abs(self._positions[name]() - start) >= STIRRED
        }
        if stirred:
            self._happen(
                lambda e: (
                    isinstance(e, JointActs)
                    and e.act == "moves"
                    and not stirred.isdisjoint(e.joints)
                ),
                tick,
            )
            self._watch()

    def _happen(self, happened: Callable[[Event], bool], tick: int) -> None:
        waiting, self._waiting = self._waiting, []
        for event, delay, act in waiting:
            if happened(event):
                self._count += 1
                heapq.heappush(self._agenda, (tick + delay, self._count, act))
            else:
                self._waiting.append((event, delay, act))

    def play(self, tick: int) -> None:
        """Do what is due, also what becomes due by doing it."""
        while self._agenda and self._agenda[0][0] <= tick:
            heapq.heappop(self._agenda)[2]()
