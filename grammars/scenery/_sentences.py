"""Reading sentences: how objects start, what their joints do, events and walks."""

from __future__ import annotations

import math
from typing import Any

from grammars.scenery._syntax import NodeReader
from grammars.scenery.model import (
    Alternates,
    Amount,
    EventPhrase,
    FrameName,
    Freezes,
    Goes,
    MotionAs,
    Moves,
    OnLeg,
    OnObject,
    OnWaypoint,
    Reacts,
    RoutePoint,
    Sentence,
    Setting,
    Starts,
    Stays,
    Subject,
    Toggles,
    Waiting,
    Walks,
)
from grammars.text.diagnostics import InputError


def read_event(reader: NodeReader, node: Any) -> EventPhrase:
    """Return the event of a ``when`` (any but that the robot is near)."""
    where = reader.where(node)
    match type(node).__name__:
        case "LegBegins":
            if int(node.leg) < 1:
                raise InputError.at(where, "legs are counted from 1", "when leg 1 begins")
            return OnLeg(int(node.leg), where)
        case "WaypointIsReached":
            return OnWaypoint(str(node.waypoint).strip('"'), where)
        case "ObjectActs":
            return OnObject(reader.path(node.path), "fires" if node.fires else "moves", where)
        case _:
            raise InputError.at(
                where,
                "walks begin at a time or with an event, not with the robot's distance",
                "from 5 s, when leg 2 begins, when waypoint … is reached, when … fires",
            )


def read_waiting(reader: NodeReader, node: Any) -> Waiting:
    """Return the distribution of ``after uniform 10 s to 40 s``."""
    second = None if node.kind == "exponential" else reader.amount(node.second, "time")
    return Waiting(node.kind, reader.amount(node.first, "time"), second)


def read_walks(reader: NodeReader, subject: Subject, node: Any) -> Walks:
    """Return the walk of ``visitor walks along …``."""
    options = reader.once(node.options)
    when, after = options.get("When"), options.get("After")
    since = options.get("From") or after
    if when is None and after is not None:
        raise InputError.at(reader.where(after), "after what?", "add when …, or write from 5 s")
    if when is not None and "From" in options:
        raise InputError.at(
            reader.where(options["From"]), "a walk begins at a time or with an event"
        )
    if "Yielding" in options and "NotYielding" in options:
        raise InputError.at(subject.where, "it yields or it does not")
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
        None if when is None else read_event(reader, when.condition),
        _facing(reader, options.get("Facing")),
        _amount(reader, options.get("Yielding"), "length"),
        subject.where,
    )


def _route(reader: NodeReader, nodes: list[Any]) -> tuple[RoutePoint, ...]:
    """Points without a frame are in the one that is named next, or in the world."""
    if len(nodes) < 2:
        raise InputError.at(reader.where(nodes[0]), "a route has two points or more", "add a point")
    frames = [None if node.frame is None else reader.frame(node.frame) for node in nodes]
    if frames[-1] is None and any(frames):
        raise InputError.at(
            reader.where(nodes[-1]), "in which frame is this point?", "add of <frame>"
        )
    following = FrameName("world", None, "", reader.where(nodes[-1]))
    points: list[RoutePoint] = []
    for node, frame in zip(reversed(nodes), reversed(frames), strict=True):
        following = frame or following
        x, y = reader.value(node.at.x, "length"), reader.value(node.at.y, "length")
        points.append(RoutePoint(following, x, y))
    return tuple(reversed(points))


def _amount(reader: NodeReader, option: Any, dimension: str) -> Amount | None:
    return None if option is None else reader.amount(option.value, dimension)


def _manner(option: Any) -> Any:
    return "once" if option is None else "-".join(option.keyword.split())


def _facing(reader: NodeReader, option: Any) -> Any:
    if option is None:
        return "ahead"
    return option.way or reader.amount(option.yaw, "angle")


_SPEEDS = ("angular speed", "speed")
_EFFORTS = ("torque", "force")
_STIFFNESSES = ("torsional stiffness", "stiffness")
_DAMPINGS = ("torsional damping", "damping")
_POSITIONS = ("angle", "length")


def read_predicate(reader: NodeReader, subject: Subject, node: Any) -> Setting | Sentence:
    """Return what a sentence says about its subject (all but ``is a``)."""
    match type(node).__name__:
        case "IsFrozen":
            return Freezes(subject, subject.where)
        case "Starts":
            return Starts(subject, reader.amount(node.position, *_POSITIONS), subject.where)
        case "Stays":
            return Stays(subject, reader.amount(node.position, *_POSITIONS), subject.where)
        case "Moves":
            return _moves(reader, subject, node)
        case "Toggles":
            return _toggles(reader, subject, node)
        case "Walks":
            return read_walks(reader, subject, node)
        case _:
            return _goes(reader, subject, node)


def _moves(reader: NodeReader, subject: Subject, node: Any) -> Moves:
    options = reader.once(node.options)
    frames = tuple(
        (reader.amount(f.position, *_POSITIONS), reader.amount(f.time, "time")) for f in node.frames
    )
    return Moves(subject, frames, _motion(reader, options.get("By")), subject.where)


def _toggles(reader: NodeReader, subject: Subject, node: Any) -> Toggles | Alternates:
    options = reader.once(node.options)
    if node.waiting is not None:
        return _alternates(reader, subject, node, options)
    late = options.get("Late")
    return Toggles(
        subject,
        reader.amount(node.first, *_POSITIONS),
        reader.amount(node.second, *_POSITIONS),
        reader.amount(node.period, "time"),
        _time(reader, options.get("From")),
        _time(reader, options.get("Until")),
        _probability(reader, options.get("Probability")),
        _time(reader, late),
        None if late is None else reader.optional(late.step, "time"),
        _motion(reader, options.get("By")),
        subject.where,
    )


def _alternates(
    reader: NodeReader, subject: Subject, node: Any, options: dict[str, Any]
) -> Alternates:
    for kind in ("Probability", "Late"):
        if kind in options:
            where = reader.where(options[kind])
            hint = "leave it out, or write every 30 s"
            word = options[kind].keyword
            reader.report(where, f'"{word}" is for changes every so often, not after waiting', hint)
    return Alternates(
        subject,
        reader.amount(node.first, *_POSITIONS),
        reader.amount(node.second, *_POSITIONS),
        read_waiting(reader, node.waiting),
        _time(reader, options.get("From")),
        _time(reader, options.get("Until")),
        _motion(reader, options.get("By")),
        subject.where,
    )


def _time(reader: NodeReader, option: Any) -> Any:
    return None if option is None else reader.amount(option.value, "time")


def _probability(reader: NodeReader, option: Any) -> float:
    if option is None:
        return 0.5
    share = option.value
    if share.unit not in ("", "%", None):
        raise InputError.at(reader.where(share), f"a probability has no unit, {share.unit} is one")
    value = float(share.number) * (0.01 if share.unit == "%" else 1.0)
    if not (math.isfinite(value) and 0.0 <= value <= 1.0):
        raise InputError.at(
            reader.where(share), "a probability lies between 0 and 1 (0 % and 100 %)"
        )
    return value


def _goes(reader: NodeReader, subject: Subject, node: Any) -> Goes | Reacts:
    options = reader.once(node.options)
    when = options.get("When")
    if when is None:
        raise InputError.at(
            subject.where,
            "when does it go?",
            "add when the robot is within 1.3 m of its hinge; moves to … at … for given times",
        )
    again, after, near = options.get("Again"), options.get("After"), when.condition
    starting = options.get("Starting")
    if type(near).__name__ != "RobotIsNear":
        return _reacts(reader, subject, node, options)
    if after is not None:
        message = "only events are reacted to after some time, not the robot's distance"
        raise InputError.at(reader.where(after), message, "leave it out")
    return Goes(
        subject,
        reader.amount(node.start, *_POSITIONS),
        reader.amount(node.end, *_POSITIONS),
        reader.amount(near.distance, "length"),
        near.point,
        "footprint" if near.body else "base",
        None if again is None else reader.amount(again.value, "length"),
        None if starting is None else reader.amount(starting.value, *_POSITIONS),
        _motion(reader, options.get("By")),
        subject.where,
    )


def _reacts(reader: NodeReader, subject: Subject, node: Any, options: dict[str, Any]) -> Reacts:
    if "Again" in options:
        where = reader.where(options["Again"])
        raise InputError.at(where, "an event is reacted to once", "leave out again …")
    if "Starting" in options:
        where = reader.where(options["Starting"])
        message = "only what waits for the robot to come near starts elsewhere"
        raise InputError.at(where, message, "leave out starting at …")
    return Reacts(
        subject,
        reader.amount(node.start, *_POSITIONS),
        reader.amount(node.end, *_POSITIONS),
        read_event(reader, options["When"].condition),
        _time(reader, options.get("After")),
        _motion(reader, options.get("By")),
        subject.where,
    )


def _motion(reader: NodeReader, by: Any) -> MotionAs:
    if by is None:
        return MotionAs()
    node = by.motion
    if node.kind == "servo":
        return MotionAs(
            "servo",
            rate=reader.optional(node.rate, *_SPEEDS),
            effort=reader.optional(node.effort, *_EFFORTS),
        )
    if node.kind == "spring":
        return MotionAs(
            "spring",
            stiffness=reader.optional(node.stiffness, *_STIFFNESSES),
            damping=reader.optional(node.damping, *_DAMPINGS),
        )
    return MotionAs("jump")
