"""What a walk means for one mover: its route in the world, its pace, where it looks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

from grammars.model.behaviour import Event, Walk
from grammars.model.geometry import Point2, Pose2
from grammars.model.movers import is_mover
from grammars.model.scene import SceneObject
from grammars.scenery.composition._amounts import SentenceContext
from grammars.scenery.composition._rings import rounded, rounded_point
from grammars.scenery.measure import Measure
from grammars.scenery.model import RoutePoint, Walks, Word
from grammars.text.diagnostics import InputError, did_you_mean

_SHORTEST = 0.01
"""Points of a route are at least this far apart [m]."""
_PACE = 1.0
"""Walking speed when nothing is said [m/s]."""


def walk_of(context: SentenceContext, body: SceneObject, said: Walks, event: Event | None) -> Walk:
    """Return the walk of ``body``; raises :class:`InputError` for what it cannot mean."""
    if not is_mover(body.joints):
        message = f"{body.name} cannot walk: {body.model} is an object, not a mover"
        raise InputError.at(said.where, message, f"write mover {body.model} …")
    facing, yaw = _facing(context, said)
    yielding = None if said.yielding is None else _positive(context, said, "yielding")
    pause = context.optional(said.pause, 0.0, "time")
    since = context.optional(said.since, 0.0, "time")
    if pause < 0.0 or since < 0.0:
        raise InputError.at(said.where, "times of a walk are never negative")
    if said.manner == "once" and pause > 0.0 and not said.everywhere:
        hint = "add back and forth, or write pausing … at every point"
        raise InputError.at(said.where, "a walk done once ends at its end", hint)
    return Walk(
        body.name,
        _route(context, said),
        _PACE if said.speed is None else _positive(context, said, "speed"),
        1.0 if said.acceleration is None else _positive(context, said, "acceleration"),
        said.manner,
        pause,
        "points" if said.everywhere else "ends",
        since,
        event,
        facing,
        yaw,
        yielding,
    )


Facing = Literal["ahead", "sideways", "fixed"]
_DIMENSIONS = {"speed": "speed", "acceleration": "acceleration", "yielding": "length"}


def _positive(context: SentenceContext, said: Walks, field: str) -> float:
    amount = getattr(said, field)
    value = context.value(amount, _DIMENSIONS[field])
    if value <= 0.0:
        raise InputError.at(amount.where, "this must be greater than 0")
    return value


def _facing(context: SentenceContext, said: Walks) -> tuple[Facing, float]:
    if isinstance(said.facing, Word | Measure):
        angle = context.value(said.facing, "angle")
        frame = frame_in(context.frames, said.route[-1])
        return "fixed", rounded((frame @ Pose2(yaw=angle)).yaw, 12)
    return said.facing, 0.0


def _route(context: SentenceContext, said: Walks) -> tuple[Point2, ...]:
    if len(said.route) < 2:
        raise InputError.at(said.where, "a route has two points or more", "add a point")
    points: list[Point2] = []
    for point in said.route:
        spot = rounded_point(frame_in(context.frames, point).apply((point.x, point.y)))
        if points and math.dist(spot, points[-1]) < _SHORTEST:
            message = "two points of the route are the same"
            raise InputError.at(said.where, message, "pausing … waits at points")
        points.append(spot)
    if said.manner == "round" and math.dist(points[0], points[-1]) < _SHORTEST:
        points.pop()  # round closes the route by itself
    if said.manner == "round" and len(points) < 3:
        hint = "write back and forth"
        raise InputError.at(said.where, "a round needs three points or more", hint)
    return tuple(points)


def frame_in(frames: Mapping[str, Pose2], point: RoutePoint) -> Pose2:
    """Return the world pose of the frame of ``point``; raises for names that are unknown."""
    name = str(point.frame)
    if name == "world":
        return Pose2()
    if name not in frames:
        hint = did_you_mean(name, (*frames, "world"))
        message = f'there is no frame "{name}" in the floor plan'
        raise InputError.at(point.frame.where, message, hint)
    return frames[name]
