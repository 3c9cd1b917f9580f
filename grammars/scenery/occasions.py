"""Reading what sentences about events and walks say."""

from __future__ import annotations

from typing import Any

from grammars.diagnostics import Diagnostic, InputError
from grammars.scenery.model import (
    Amount,
    FrameName,
    Occasion,
    OnLeg,
    OnObject,
    OnWaypoint,
    RoutePoint,
    Subject,
    Waiting,
    Walks,
)
from grammars.scenery.reader import Reader


def read_occasion(reader: Reader, node: Any) -> Occasion:
    """Return the event of a ``when`` (any but that the robot is near)."""
    where = reader.where(node)
    match type(node).__name__:
        case "LegBegins":
            if int(node.leg) < 1:
                raise InputError(Diagnostic(where, "legs are counted from 1", "when leg 1 begins"))
            return OnLeg(int(node.leg), where)
        case "WaypointIsReached":
            return OnWaypoint(str(node.waypoint).strip('"'), where)
        case "ObjectActs":
            return OnObject(reader.path(node.path), "fires" if node.fires else "moves", where)
        case _:
            raise InputError(
                Diagnostic(
                    where,
                    "walks begin at a time or with an event, not with the robot's distance",
                    "from 5 s, when leg 2 begins, when waypoint … is reached, when … fires",
                )
            )


def read_waiting(reader: Reader, node: Any) -> Waiting:
    """Return the distribution of ``after uniform 10 s to 40 s``."""
    second = None if node.kind == "exponential" else reader.amount(node.second, "time")
    return Waiting(node.kind, reader.amount(node.first, "time"), second)


def read_walks(reader: Reader, subject: Subject, node: Any) -> Walks:
    """Return the walk of ``visitor walks along …``."""
    options = reader.once(node.options)
    when, after = options.get("When"), options.get("After")
    since = options.get("From") or after
    if when is None and after is not None:
        raise InputError(
            Diagnostic(reader.where(after), "after what?", "add when …, or write from 5 s")
        )
    if when is not None and "From" in options:
        raise InputError(
            Diagnostic(reader.where(options["From"]), "a walk begins at a time or with an event")
        )
    if "Yielding" in options and "NotYielding" in options:
        raise InputError(Diagnostic(subject.where, "it yields or it does not"))
    pausing = options.get("Pausing")
    return Walks(
        subject,
        _route(reader, node.points),
        _amount(reader, options.get("AtSpeed"), "speed"),
        _amount(reader, options.get("Accelerating"), "acceleration"),
        _manner(options.get("Manner")),
        _amount(reader, pausing, "time"),
        pausing is not None and bool(pausing.everywhere),
        _amount(reader, since, "time"),
        None if when is None else read_occasion(reader, when.condition),
        _facing(reader, options.get("Facing")),
        _amount(reader, options.get("Yielding"), "length"),
        subject.where,
    )


def _route(reader: Reader, nodes: list[Any]) -> tuple[RoutePoint, ...]:
    """Points without a frame are in the one that is named next, or in the world."""
    if len(nodes) < 2:
        raise InputError(
            Diagnostic(reader.where(nodes[0]), "a route has two points or more", "add a point")
        )
    frames = [None if node.frame is None else reader.frame(node.frame) for node in nodes]
    if frames[-1] is None and any(frames):
        raise InputError(
            Diagnostic(reader.where(nodes[-1]), "in which frame is this point?", "add of <frame>")
        )
    following = FrameName("world", None, "", reader.where(nodes[-1]))
    points: list[RoutePoint] = []
    for node, frame in zip(reversed(nodes), reversed(frames), strict=True):
        following = frame or following
        x, y = reader.value(node.at.x, "length"), reader.value(node.at.y, "length")
        points.append(RoutePoint(following, x, y))
    return tuple(reversed(points))


def _amount(reader: Reader, option: Any, dimension: str) -> Amount | None:
    return None if option is None else reader.amount(option.value, dimension)


def _manner(option: Any) -> Any:
    return "once" if option is None else "-".join(option.keyword.split())


def _facing(reader: Reader, option: Any) -> Any:
    if option is None:
        return "ahead"
    return option.way or reader.amount(option.yaw, "angle")
