"""Reading sentences: how objects start, what their joints do, and walks."""

from __future__ import annotations

from typing import Any, Final, TypeAlias, get_args

from grammars.scenery._events import EventNode, RobotIsNearNode
from grammars.scenery._instances import IsANode
from grammars.scenery._reader import NodeReader, QuantityNode, WordNode
from grammars.scenery.model import (
    Alternates,
    Amount,
    FrameName,
    Freezes,
    Goes,
    Group,
    Instance,
    MotionAs,
    Moves,
    Parameter,
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
from grammars.text.diagnostics import InputError, SyntaxNode, TypedNode
from grammars.text.quantity import parse_quantity

_SPEEDS = ("angular speed", "speed")
_EFFORTS = ("torque", "force")
_STIFFNESSES = ("torsional stiffness", "stiffness")
_DAMPINGS = ("torsional damping", "damping")
_POSITIONS = ("angle", "length")


class IsFrozenNode(TypedNode):
    """``store_door is frozen``."""

    def read(self, reader: NodeReader, subject: Subject) -> Freezes:
        """Return the setting."""
        return Freezes(subject, subject.where)


class StartsNode(TypedNode):
    """``front_door starts open``."""

    position: SyntaxNode

    def read(self, reader: NodeReader, subject: Subject) -> Starts:
        """Return the setting."""
        return Starts(subject, reader.amount(self.position, *_POSITIONS), subject.where)


class StaysNode(TypedNode):
    """``front_door stays closed``."""

    position: SyntaxNode

    def read(self, reader: NodeReader, subject: Subject) -> Stays:
        """Return the sentence."""
        return Stays(subject, reader.amount(self.position, *_POSITIONS), subject.where)


class MovesNode(TypedNode):
    """``front_door moves to open at 5 s``."""

    frames: list[SyntaxNode]
    options: list[SyntaxNode]

    def read(self, reader: NodeReader, subject: Subject) -> Moves:
        """Return the sentence."""
        options = reader.options_by_rule(self.options)
        frames = tuple(
            (reader.amount(f.position, *_POSITIONS), reader.amount(f.time, "time"))
            for f in self.frames
        )
        motion = _motion(reader, options.get("By"))
        return Moves(subject, frames, motion, subject.where, listed="AsListed" in options)


class TogglesNode(TypedNode):
    """``front_door toggles between closed and open every 30 s``, or ``after`` random waits."""

    first: SyntaxNode
    second: SyntaxNode
    period: SyntaxNode
    waiting: SyntaxNode | None
    options: list[SyntaxNode]

    def read(self, reader: NodeReader, subject: Subject) -> Toggles | Alternates:
        """Return the sentence."""
        options = reader.options_by_rule(self.options)
        if self.waiting is not None:
            return self._alternates(reader, subject, self.waiting, options)
        late = options.get("Late")
        return Toggles(
            subject,
            reader.amount(self.first, *_POSITIONS),
            reader.amount(self.second, *_POSITIONS),
            reader.amount(self.period, "time"),
            _time(reader, options.get("From")),
            _time(reader, options.get("Until")),
            _probability(reader, options.get("Probability")),
            _time(reader, late),
            None if late is None else reader.optional(late.step, "time"),
            _motion(reader, options.get("By")),
            subject.where,
        )

    def _alternates(
        self,
        reader: NodeReader,
        subject: Subject,
        waiting: SyntaxNode,
        options: dict[str, Any],
    ) -> Alternates:
        for option in (options[rule] for rule in ("Probability", "Late") if rule in options):
            message = f'"{option.keyword}" is for changes every so often, not after waiting'
            reader.report(reader.where(option), message, "leave it out, or write every 30 s")
        return Alternates(
            subject,
            reader.amount(self.first, *_POSITIONS),
            reader.amount(self.second, *_POSITIONS),
            _waiting(reader, waiting),
            _time(reader, options.get("From")),
            _time(reader, options.get("Until")),
            _motion(reader, options.get("By")),
            subject.where,
        )


class GoesNode(TypedNode):
    """``front_door goes from open to closed when …``: a trigger, or a reaction to an event."""

    start: SyntaxNode
    end: SyntaxNode
    options: list[SyntaxNode]

    def read(self, reader: NodeReader, subject: Subject) -> Goes | Reacts:
        """Return the sentence."""
        options = reader.options_by_rule(self.options)
        if "When" not in options:
            raise InputError.at(
                subject.where,
                "when does it go?",
                "add when the robot is within 1.3 m of its hinge; moves to … at … for given times",
            )
        condition = options["When"].condition
        if isinstance(condition, RobotIsNearNode):
            return self._goes(reader, subject, condition, options)
        return self._reacts(reader, subject, condition, options)

    def _goes(
        self,
        reader: NodeReader,
        subject: Subject,
        near: RobotIsNearNode,
        options: dict[str, Any],
    ) -> Goes:
        again, starting = options.get("Again"), options.get("Starting")
        if "After" in options:
            message = "only events are reacted to after some time, not the robot's distance"
            raise InputError.at(reader.where(options["After"]), message, "leave it out")
        return Goes(
            subject,
            reader.amount(self.start, *_POSITIONS),
            reader.amount(self.end, *_POSITIONS),
            reader.amount(near.distance, "length"),
            near.point,
            "footprint" if near.body else "base",
            None if again is None else reader.amount(again.value, "length"),
            None if starting is None else reader.amount(starting.value, *_POSITIONS),
            _motion(reader, options.get("By")),
            subject.where,
        )

    def _reacts(
        self, reader: NodeReader, subject: Subject, event: EventNode, options: dict[str, Any]
    ) -> Reacts:
        if "Again" in options:
            where = reader.where(options["Again"])
            raise InputError.at(where, "an event is reacted to once", "leave out again …")
        if "Starting" in options:
            where = reader.where(options["Starting"])
            message = "only what waits for the robot to come near starts elsewhere"
            raise InputError.at(where, message, "leave out starting at …")
        return Reacts(
            subject,
            reader.amount(self.start, *_POSITIONS),
            reader.amount(self.end, *_POSITIONS),
            event.event(reader),
            _time(reader, options.get("After")),
            _motion(reader, options.get("By")),
            subject.where,
        )


class WalksNode(TypedNode):
    """``visitor walks along …``."""

    points: list[SyntaxNode]
    options: list[SyntaxNode]

    def read(self, reader: NodeReader, subject: Subject) -> Walks:
        """Return the sentence."""
        options = reader.options_by_rule(self.options)
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
            _route(reader, self.points),
            _amount(reader, options.get("AtSpeed"), "speed"),
            _amount(reader, options.get("Accelerating"), "acceleration"),
            _manner(options.get("Manner")),
            _amount(reader, pausing, "time"),
            pausing is not None and bool(pausing.everywhere),
            _amount(reader, since, "time"),
            None if when is None else when.condition.event(reader),
            _facing(reader, options.get("Facing")),
            _amount(reader, options.get("Yielding"), "length"),
            subject.where,
        )


PredicateNode: TypeAlias = (
    IsFrozenNode | StartsNode | StaysNode | MovesNode | TogglesNode | GoesNode | WalksNode
)


class ObjectGroupNode(TypedNode):
    """``group rooms: kitchen_door, store_door``."""

    name: WordNode
    members: SyntaxNode

    def read(self, reader: NodeReader) -> Group:
        """Return the group."""
        members = reader.subject(self.members)
        return Group(self.name.text, members, reader.where(self))


class ParameterNode(TypedNode):
    """``parameter near = 1.3 m``."""

    name: WordNode
    value: QuantityNode

    def read(self, reader: NodeReader) -> Parameter:
        """Return the parameter."""
        return Parameter(self.name.text, reader.measure(self.value), reader.where(self))


class SentenceNode(TypedNode):
    """A subject and what is said about it."""

    subject: SyntaxNode
    predicate: PredicateNode | IsANode

    def read(self, reader: NodeReader) -> Instance | Setting | Sentence:
        """Return what the sentence says."""
        return self.predicate.read(reader, reader.subject(self.subject))


SENTENCE_RULES: Final = (
    *get_args(PredicateNode),
    ObjectGroupNode,
    ParameterNode,
    SentenceNode,
)
"""Classes of syntax nodes, named like their rules."""


def _waiting(reader: NodeReader, node: Any) -> Waiting:
    """Return the distribution of ``after uniform 10 s to 40 s``."""
    second = None if node.kind == "exponential" else reader.amount(node.second, "time")
    return Waiting(node.kind, reader.amount(node.first, "time"), second)


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
    # Backwards: "(0 m, 0 m), (1 m, 0 m) of hall" are two points of the hall.
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


def _time(reader: NodeReader, option: Any) -> Any:
    return None if option is None else reader.amount(option.value, "time")


def _probability(reader: NodeReader, option: Any) -> float:
    if option is None:
        return 0.5
    share = option.value
    quantity = parse_quantity(f"{share.number} {share.unit or ''}", reader.where(share))
    if quantity.dimension != "ratio":
        raise InputError.at(reader.where(share), f"a probability has no unit, {share.unit} is one")
    if not 0.0 <= quantity.value <= 1.0:
        raise InputError.at(
            reader.where(share), "a probability lies between 0 and 1 (0 % and 100 %)"
        )
    return quantity.value


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
