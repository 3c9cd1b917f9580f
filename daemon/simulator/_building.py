"""Building in the simulator: walls, segments for lasers, and contacts of the robot."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
import pymunk

from daemon.model.sut import TICK_RATE
from daemon.simulator._assembly import WORLD, BodyAssembly
from daemon.simulator._mobile_base import MobileBase
from daemon.simulator._physics import BUILDING_FILTER, FRICTION, ROBOT_COLLISION_TYPE, ring_edges
from daemon.simulator._sensors import LaserPlane
from grammars.model.geometry import Floats, Point2, Ring
from grammars.model.scene import Scene, Solid
from grammars.scenery.composition import static_segments

Edge = tuple[float, float, float, float]


def cut_at(scene: Scene, assembly: BodyAssembly, z: float) -> LaserPlane:
    """Return the surfaces within reach of a laser at height ``z``."""
    walls, _, _ = wall_outline(scene.solids, z)
    static: list[Edge] = []
    moving: list[Edge] = []
    slots: list[int] = []
    # In the order of bodies, as the laser requires.
    for placement in sorted(assembly.placements, key=lambda p: p.slot):
        if not placement.link.z_min <= z < placement.link.z_max:
            continue
        edges = [edge for ring in placement.rings for edge in ring_edges(_counter_clockwise(ring))]
        if placement.slot == WORLD:
            static += edges
        else:
            moving += edges
            slots += [placement.slot] * len(edges)
    return LaserPlane(
        np.vstack([walls, _rows(static)]), _rows(moving), np.array(slots, dtype=np.int32)
    )


@lru_cache(maxsize=8)
def wall_outline(
    solids: tuple[Solid, ...], z: float
) -> tuple[Floats, npt.NDArray[np.int32], tuple[str, ...]]:
    """Return the union outline of solids at a height, see ``static_segments``.

    The result is cached, because runs share their scene.
    """
    return static_segments(Scene("", (), (), solids), z)


def _counter_clockwise(ring: Ring) -> Ring:
    """Return the ring counter-clockwise."""
    return ring if pymunk.area_for_poly(list(ring)) > 0.0 else ring[::-1]


def _rows(edges: Sequence[Edge]) -> Floats:
    return np.array(edges, dtype=np.float64).reshape(-1, 4)


def build_walls(space: pymunk.Space, scene: Scene, height: float) -> dict[pymunk.Shape, str]:
    """Add all solids between the floor and ``height`` to ``space``; return owners by shape."""
    # Treat all solids within reach of the body as equally high: the outline of their union has no
    # inner edges on which a robot could catch.
    solids = tuple(
        replace(solid, z_min=0.0, z_max=1.0)
        for solid in scene.solids
        if solid.z_min < height and solid.z_max > 0.0
    )
    rows, owner, names = wall_outline(solids, 0.5)
    segments = [((x1, y1), (x2, y2)) for x1, y1, x2, y2 in rows.tolist()]
    before = _unique({end: start for start, end in segments}, [end for _, end in segments])
    after = _unique(dict(segments), [start for start, _ in segments])
    owners: dict[pymunk.Shape, str] = {}
    for (start, end), number in zip(segments, owner.tolist(), strict=True):
        shape = pymunk.Segment(space.static_body, start, end, 0.0)
        if start in before and end in after:
            shape.set_neighbors(before[start], after[end])
        shape.filter = BUILDING_FILTER
        shape.friction = FRICTION
        owners[shape] = names[number]
        space.add(shape)
    return owners


def _unique(neighbours: dict[Point2, Point2], corners: list[Point2]) -> dict[Point2, Point2]:
    """Remove corners with more than one outline, because they have several neighbours."""
    counts = Counter(corners)
    return {corner: other for corner, other in neighbours.items() if counts[corner] == 1}


_MERGE_TICKS = TICK_RATE // 10
"""A touch that resumes within this many ticks is one touch, because a robot that scrapes along a
wall may lose and regain contact every few ticks."""


@dataclass(frozen=True, slots=True)
class RobotContact:
    """A new or continued touch of the robot.

    ``time`` is its begin, ``until`` its last known instant [s]; a touch that resumes within 0.1 s
    is the same touch. ``first`` is ``robot``, ``second`` the owner of the other shape (a floor plan
    element, or ``<object>.<link>``). ``point`` (world), ``normal`` (unit, from first to second) and
    ``depth`` of penetration [m] belong to the deepest instant among the begins of touches since
    the previous report and the present report.
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
    """Event of a behaviour at ``time`` [s]; ``source`` is the scene-wide joint name."""

    time: float
    source: str
    text: str


@dataclass(slots=True)
class _OngoingContact:
    """Touch of one owner: the number of pairs of shapes in contact, and the deepest instant."""

    began: int
    last: int
    pairs: int = 0
    reported: bool = False
    depth: float = -1.0
    point: Point2 = (0.0, 0.0)
    normal: Point2 = (0.0, 0.0)


class ContactLog:
    """Log of the robot's touches by owner.

    The physics calls it only when a touch begins or ends, because a call back into Python costs
    1 to 2 us in every step. Lasting touches are examined when they are reported. The world sets
    ``tick`` to the present tick.
    """

    def __init__(
        self,
        space: pymunk.Space,
        base: MobileBase,
        owners: Mapping[pymunk.Shape, str],
    ) -> None:
        self.tick = 0
        self._base, self._body, self._robot = base, base.body, base.shape
        self._owners = owners
        self._touches: dict[str, _OngoingContact] = {}
        self._finished: list[RobotContact] = []
        space.on_collision(ROBOT_COLLISION_TYPE, None, begin=self._begin, separate=self._separate)

    def _begin(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: Any) -> None:
        # Inside the step of ``tick``, whose end is the next one.
        owner, now = self._owner(arbiter), self.tick + 1
        touch = self._touches.get(owner)
        if touch is None or (touch.pairs == 0 and now - touch.last > _MERGE_TICKS):
            if touch is not None and not touch.reported:
                self._finished.append(_contact(owner, touch))
            touch = self._touches[owner] = _OngoingContact(now, now)
        touch.pairs += 1
        self._base.touching += 1
        touch.last = now
        touch.reported = False
        self._look(arbiter)

    def _separate(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: Any) -> None:
        touch = self._touches[self._owner(arbiter)]
        # Several pairs of shapes may touch at once: the links of a door, two pieces of a wall.
        touch.pairs -= 1
        self._base.touching -= 1
        if self.tick > touch.last:
            touch.last = self.tick
            touch.reported = False

    def _owner(self, arbiter: pymunk.Arbiter) -> str:
        first, second = arbiter.shapes
        return self._owners[second if first is self._robot else first]

    def _look(self, arbiter: pymunk.Arbiter) -> None:
        """Store the present place of the touch if it is deeper than before."""
        touch = self._touches[self._owner(arbiter)]
        contact = arbiter.contact_point_set
        deepest = min(contact.points, key=lambda point: point.distance)
        depth = max(0.0, -deepest.distance)
        if depth <= touch.depth:
            return
        swapped = arbiter.shapes[0] is not self._robot
        a, b, sign = deepest.point_a, deepest.point_b, -1.0 if swapped else 1.0
        touch.depth = depth
        touch.point = ((a.x + b.x) / 2.0, (a.y + b.y) / 2.0)
        touch.normal = (sign * contact.normal.x, sign * contact.normal.y)

    def take(self, tick: int) -> tuple[RobotContact, ...]:
        """Return the touches since the last call, ordered by begin and owner.

        ``tick`` is the number of ticks done.
        """
        if not self._touches:
            return ()
        # Lasting contacts may have been deeper since the last report. Only this instant is
        # examined, because each step would cost a call into Python.
        if any(touch.pairs for touch in self._touches.values()):
            self._body.each_arbiter(self._look)
        contacts, self._finished = self._finished, []
        for owner, touch in list(self._touches.items()):
            if touch.pairs:
                touch.last = tick
            elif touch.reported:
                # Ended and reported; it is removed when it can no longer resume.
                if tick - touch.last > _MERGE_TICKS:
                    del self._touches[owner]
                continue
            contacts.append(_contact(owner, touch))
            touch.reported, touch.depth = True, -1.0
        return tuple(sorted(contacts, key=lambda contact: (contact.time, contact.second)))


def _contact(owner: str, touch: _OngoingContact) -> RobotContact:
    return RobotContact(
        time=touch.began / TICK_RATE,
        first="robot",
        second=owner,
        point=touch.point,
        normal=touch.normal,
        depth=max(0.0, touch.depth),
        until=touch.last / TICK_RATE,
    )
