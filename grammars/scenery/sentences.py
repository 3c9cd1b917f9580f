"""Reading sentences about objects that stand: how they start, what their joints do."""

from __future__ import annotations

import math
from typing import Any

from grammars.diagnostics import Diagnostic, InputError
from grammars.scenery.model import (
    Alternates,
    Freezes,
    Goes,
    MotionAs,
    Moves,
    Reacts,
    Sentence,
    Setting,
    Starts,
    Stays,
    Subject,
    Toggles,
)
from grammars.scenery.occasions import read_occasion, read_waiting, read_walks
from grammars.scenery.reader import Reader

_SPEEDS = ("angular speed", "speed")
_EFFORTS = ("torque", "force")
_STIFFNESSES = ("torsional stiffness", "stiffness")
_DAMPINGS = ("torsional damping", "damping")
_POSITIONS = ("angle", "length")


def read_predicate(reader: Reader, subject: Subject, node: Any) -> Setting | Sentence:
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


def _moves(reader: Reader, subject: Subject, node: Any) -> Moves:
    options = reader.once(node.options)
    frames = tuple(
        (reader.amount(f.position, *_POSITIONS), reader.amount(f.time, "time")) for f in node.frames
    )
    return Moves(subject, frames, _motion(reader, options.get("By")), subject.where)


def _toggles(reader: Reader, subject: Subject, node: Any) -> Toggles | Alternates:
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


def _alternates(reader: Reader, subject: Subject, node: Any, options: dict[str, Any]) -> Alternates:
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


def _time(reader: Reader, option: Any) -> Any:
    return None if option is None else reader.amount(option.value, "time")


def _probability(reader: Reader, option: Any) -> float:
    if option is None:
        return 0.5
    share = option.value
    if share.unit not in ("", "%", None):
        raise InputError(
            Diagnostic(reader.where(share), f"a probability has no unit, {share.unit} is one")
        )
    value = float(share.number) * (0.01 if share.unit == "%" else 1.0)
    if not (math.isfinite(value) and 0.0 <= value <= 1.0):
        raise InputError(
            Diagnostic(reader.where(share), "a probability lies between 0 and 1 (0 % and 100 %)")
        )
    return value


def _goes(reader: Reader, subject: Subject, node: Any) -> Goes | Reacts:
    options = reader.once(node.options)
    when = options.get("When")
    if when is None:
        raise InputError(
            Diagnostic(
                subject.where,
                "when does it go?",
                "add when the robot is within 1.3 m of its hinge; moves to … at … for given times",
            )
        )
    again, after, near = options.get("Again"), options.get("After"), when.condition
    starting = options.get("Starting")
    if type(near).__name__ != "RobotIsNear":
        return _reacts(reader, subject, node, options)
    if after is not None:
        message = "only events are reacted to after some time, not the robot's distance"
        raise InputError(Diagnostic(reader.where(after), message, "leave it out"))
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


def _reacts(reader: Reader, subject: Subject, node: Any, options: dict[str, Any]) -> Reacts:
    if "Again" in options:
        where = reader.where(options["Again"])
        raise InputError(Diagnostic(where, "an event is reacted to once", "leave out again …"))
    if "Starting" in options:
        where = reader.where(options["Starting"])
        message = "only what waits for the robot to come near starts elsewhere"
        raise InputError(Diagnostic(where, message, "leave out starting at …"))
    return Reacts(
        subject,
        reader.amount(node.start, *_POSITIONS),
        reader.amount(node.end, *_POSITIONS),
        read_occasion(reader, options["When"].condition),
        _time(reader, options.get("After")),
        _motion(reader, options.get("By")),
        subject.where,
    )


def _motion(reader: Reader, by: Any) -> MotionAs:
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
