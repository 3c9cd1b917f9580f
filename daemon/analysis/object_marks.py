"""Objects that decide verdicts, as marks on a map.

The dashboard uses this module too, so it does not load the oracles.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon

from daemon.model.verdicts import Verdict
from grammars.model.geometry import Point2, Pose2, Ring
from grammars.model.kinematics import placed_links
from grammars.model.robot import Robot
from grammars.model.scene import Link, Scene, Solid
from templates.plan_shapes import MeasuredMark

_TOUCHING: Final = 0.002
"""Distance [m] below which two things touch: contacts are recorded a little apart."""


def object_mark(
    scene: Scene, robot: Robot, verdict: Verdict, pose: Pose2,
    positions: Mapping[str, float], about: str,
) -> MeasuredMark | None:  # fmt: skip
    """Return the obstacle or place called ``about``, or the nearest obstacle without a name.

    The robot stands at ``pose``, the joints at ``positions`` [rad or m], by scene-wide name.
    """
    owned = list(_obstacle_parts(scene, robot.height, positions, about))
    parts = [rings for _, rings in owned]
    places = {region.name: region.outline for region in scene.regions}
    places |= {doorway.name: doorway.footprint for doorway in scene.doorways}
    place = () if parts else places.get(about, ())
    if not parts and not place:
        return None
    body = Polygon(pose.apply_ring(robot.footprint))
    # Choose the nearest piece of a wall, or the nearest link of an object.
    shapes = [MultiPolygon([(ring, ()) for ring in rings]) for rings in parts or [(place,)]]
    index = int(np.argmin(shapely.distance(body, shapes)))
    start, end = outline_points(shapely.shortest_line(body, shapes[index]))
    distance = body.distance(shapes[index])
    words = measure_text(verdict, distance)
    if distance < _TOUCHING and verdict.unit != "m":
        words = f"touches {about.partition('.')[0].replace('_', ' ')}".rstrip()
    name = owned[index][0] if parts else about
    return MeasuredMark(name, (start, end), words, parts[index] if parts else (), place)


def _obstacle_parts(
    scene: Scene, height: float, positions: Mapping[str, float], name: str
) -> Iterator[tuple[str, tuple[Ring, ...]]]:
    """Yield owner and outlines of each solid and link below a ``height`` [m].

    ``name`` limits them to one thing, unless it is empty.
    """
    parts: list[tuple[str, Solid | Link, tuple[Ring, ...]]] = [
        (solid.owner, solid, (solid.polygon,)) for solid in scene.solids
    ]
    for thing in scene.objects:
        for link, rings in placed_links(thing, positions):
            parts.append((f"{thing.name}.{link.name}", link, rings))
    for owner, part, rings in parts:
        is_meant = not name or owner == name or owner.startswith(f"{name}.")
        if rings and is_meant and part.z_min < height and part.z_max > 0.0:
            yield owner, rings


def outline_points(geometry: Any) -> tuple[Point2, ...]:
    """Return the points of a shape."""
    return tuple((x, y) for x, y in shapely.get_coordinates(geometry).tolist())


def measure_text(verdict: Verdict, distance: float) -> str:
    """Return the judged value with its limit if it is a length, otherwise a distance [m]."""
    value, limit = verdict.evidence.value, verdict.evidence.limit
    if verdict.unit != "m" or value is None:
        return metres_text(distance)
    return metres_text(value) if limit is None else f"{metres_text(value)}, limit {limit:g} m"


def metres_text(value: float) -> str:
    """Return a length to the millimetre, from ten metres on to the decimetre."""
    digits = 3 if abs(value) < 10.0 else 1
    return f"{value:.{digits}f} m".replace("-", "−")
