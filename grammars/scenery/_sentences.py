"""Reader of sentences: placement and start of objects, behaviours of joints, and walks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Literal, TypeAlias

from grammars.model.behaviour import LegBegins, WaypointReached
from grammars.scenery._reader import Options, SceneryReader
from grammars.scenery.model import (
    At,
    EventPhrase,
    FrameName,
    Freezes,
    Goes,
    In,
    Instance,
    MotionAs,
    Moves,
    OnObject,
    Reacts,
    RoutePoint,
    Sentence,
    Setting,
    Starts,
    Stays,
    Subject,
    Toggles,
    Towards,
    Waiting,
    Walks,
    Word,
)
from grammars.text.diagnostics import SyntaxNode, rule_of

_Meaning: TypeAlias = Instance | Setting | Sentence

_SPEEDS = ("angular speed", "speed")
_EFFORTS = ("torque", "force")
_STIFFNESSES = ("torsional stiffness", "stiffness")
_DAMPINGS = ("torsional damping", "damping")
_POSITIONS = ("angle", "length")


def read_sentence(reader: SceneryReader, node: SyntaxNode) -> _Meaning:
    """Read a subject and its predicate."""
    predicate = node.predicate
    return _PREDICATES[rule_of(predicate)](reader, predicate, reader.subject(node.subject))


def _freezes(reader: SceneryReader, node: SyntaxNode, subject: Subject) -> Freezes:
    """Read ``store_door is frozen``."""
    return Freezes(subject)


def _starts(reader: SceneryReader, node: SyntaxNode, subject: Subject) -> Starts:
    """Read ``front_door starts open``."""
    return Starts(subject, reader.amount(node.position, *_POSITIONS))


def _stays(reader: SceneryReader, node: SyntaxNode, subject: Subject) -> Stays:
    """Read ``front_door stays closed``."""
    return Stays(subject, reader.amount(node.position, *_POSITIONS))


def _moves(reader: SceneryReader, node: SyntaxNode, subject: Subject) -> Moves:
    """Read ``front_door moves to open at 5 s``."""
    options = reader.options(node.options)
    frames = tuple(
        (reader.amount(frame.position, *_POSITIONS), reader.amount(frame.time, "time"))
        for frame in node.frames
    )
    listed = "AsListed" in options
    return Moves(subject, frames, _motion(reader, options), listed=listed)


def _toggles(reader: SceneryReader, node: SyntaxNode, subject: Subject) -> Toggles:
    """Read ``front_door toggles between closed and open every 30 s``, or ``after`` random waits."""
    options = reader.options(node.options)
    motion = _motion(reader, options)
    waits = node.waiting is not None
    for rule in ("Probability", "Late") if waits else ():
        option = options.pop(rule, None)
        if option is not None:
            message = f'"{option.keyword}" cannot be combined with "after"'
            reader.error(option, message, "remove it, or write every 30 s")
    late = options.get("Late")
    return Toggles(
        subject,
        reader.amount(node.first, *_POSITIONS),
        reader.amount(node.second, *_POSITIONS),
        _waiting(reader, node.waiting) if waits else reader.amount(node.period, "time"),
        reader.option(options, "From", "time"),
        reader.option(options, "Until", "time"),
        _probability(reader, options),
        reader.option(options, "Late", "time"),
        None if late is None else reader.optional(late.step, "time"),
        motion,
    )


def _goes(reader: SceneryReader, node: SyntaxNode, subject: Subject) -> Goes | Reacts:
    """Read ``front_door goes from open to closed when …``: a trigger, or a reaction to an event."""
    options = reader.options(node.options)
    if "When" not in options:
        hint = "add when the robot is within 1.3 m of its hinge, or write moves to … at …"
        raise reader.refusal(subject.where, 'the sentence needs a condition with "when"', hint)
    condition = options["When"].condition
    start, end = (reader.amount(n, *_POSITIONS) for n in (node.start, node.end))
    motion = _motion(reader, options)
    if rule_of(condition) == "RobotIsNear":
        if "After" in options:
            message = '"after" is only for events, not for the distance of the robot'
            raise reader.refusal(options["After"], message, "remove it")
        return Goes(
            subject,
            start,
            end,
            reader.amount(condition.distance, "length"),
            condition.point,
            "footprint" if condition.body else "base",
            reader.option(options, "Again", "length"),
            reader.option(options, "Starting", *_POSITIONS),
            motion,
        )
    if "Again" in options:
        message = '"again" is only for the distance of the robot: reactions to events happen once'
        raise reader.refusal(options["Again"], message, "remove again …")
    if "Starting" in options:
        message = '"starting at" is only for the distance of the robot'
        raise reader.refusal(options["Starting"], message, "remove starting at …")
    event = _event(reader, condition)
    after = reader.option(options, "After", "time")
    return Reacts(subject, start, end, event, after, motion)


def _walks(reader: SceneryReader, node: SyntaxNode, subject: Subject) -> Walks:
    """Read ``visitor walks along …``."""
    options = reader.options(node.options)
    when = options.get("When")
    if when is None and "After" in options:
        message = '"after" needs an event'
        raise reader.refusal(options["After"], message, "add when …, or write from 5 s")
    if when is not None and "From" in options:
        message = "a walk begins at a time or with an event, not both"
        raise reader.refusal(options["From"], message)
    if "Yielding" in options and "NotYielding" in options:
        raise reader.refusal(subject.where, '"yielding" and "not yielding" exclude each other')
    facing = options.get("Facing")
    return Walks(
        subject,
        _route(reader, node.points),
        reader.option(options, "AtSpeed", "speed"),
        reader.option(options, "Accelerating", "acceleration"),
        _manner(options),
        reader.option(options, "Pausing", "time"),
        "Pausing" in options and bool(options["Pausing"].everywhere),
        reader.option(options, "From" if "From" in options else "After", "time"),
        None if when is None else _event(reader, when.condition),
        "ahead" if facing is None else facing.way or reader.amount(facing.yaw, "angle"),
        reader.option(options, "Yielding", "length"),
    )


def _event(reader: SceneryReader, node: SyntaxNode) -> EventPhrase:
    """Read ``leg 2 begins``, ``waypoint kitchen is reached`` or ``front_door fires``."""
    match rule_of(node):
        case "LegBegins":
            if node.leg < 1:
                raise reader.refusal(node, "legs count from 1", "when leg 1 begins")
            return LegBegins(node.leg)
        case "WaypointIsReached":
            return WaypointReached(node.waypoint.strip('"'))
        case "ObjectActs":
            return OnObject(reader.path(node.path), "fires" if node.fires else "moves")
    raise reader.refusal(
        node,
        "walks begin at a time or with an event, not with the distance of the robot",
        "from 5 s, when leg 2 begins, when waypoint … is reached, when … fires",
    )


def _manner(options: Options) -> Literal["once", "back-and-forth", "round"]:
    match options["Manner"].keyword.split() if "Manner" in options else []:
        case ["back", *_]:
            return "back-and-forth"
        case ["round"]:
            return "round"
    return "once"


def _waiting(reader: SceneryReader, node: SyntaxNode) -> Waiting:
    """Read ``uniform 10 s to 40 s``."""
    second = None if node.kind == "exponential" else reader.amount(node.second, "time")
    return Waiting(node.kind, reader.amount(node.first, "time"), second)


def _route(reader: SceneryReader, nodes: list[SyntaxNode]) -> tuple[RoutePoint, ...]:
    """Read the points of a walk; by default a point is in the next frame, or in the world."""
    if len(nodes) < 2:
        raise reader.refusal(nodes[0], "a route needs two points or more", "add a point")
    frames = [None if node.frame is None else reader.frame(node.frame) for node in nodes]
    if frames[-1] is None and any(frames):
        raise reader.refusal(nodes[-1], "the last point needs a frame", "add of <frame>")
    following = FrameName("world", None, "", reader.where(nodes[-1]))
    points: list[RoutePoint] = []
    # Backwards: "(0 m, 0 m), (1 m, 0 m) of hall" are two points of the hall.
    for node, frame in zip(reversed(nodes), reversed(frames), strict=True):
        following = frame or following
        x, y = reader.value(node.at.x, "length"), reader.value(node.at.y, "length")
        points.append(RoutePoint(following, x, y))
    return tuple(reversed(points))


def _probability(reader: SceneryReader, options: Options) -> float:
    """Read ``with probability 0.5``, also in percent; the default is 0.5."""
    if "Probability" not in options:
        return 0.5
    node = options["Probability"].value
    share = reader.measure(node, "ratio")
    if share.value < 0.0 or share.value > 1.0:
        raise reader.refusal(node, "a probability must be between 0 and 1 (0 % and 100 %)")
    return share.value


def _motion(reader: SceneryReader, options: Options) -> MotionAs:
    """Read ``by jump``, ``by servo at 60 deg/s with 20 N m``, ``by spring of 2 N m/rad``."""
    if "By" not in options:
        return MotionAs()
    node = options["By"].motion
    match node.kind:
        case "servo":
            rate = reader.optional(node.rate, *_SPEEDS)
            return MotionAs("servo", rate=rate, effort=reader.optional(node.effort, *_EFFORTS))
        case "spring":
            stiffness = reader.optional(node.stiffness, *_STIFFNESSES)
            damping = reader.optional(node.damping, *_DAMPINGS)
            return MotionAs("spring", stiffness=stiffness, damping=damping)
    return MotionAs("jump")


def _instance(reader: SceneryReader, node: SyntaxNode, subject: Subject) -> Instance:
    """Read ``door_1 is a hinged_door at hall.walls[1], x 1.2 m``."""
    path = subject.names[0]
    if subject.every or len(subject.names) != 1 or subject.exceptions or path.joint:
        hint = "door_1 is a hinged_door at …"
        raise reader.refusal(subject.where, "a sentence can place only one object", hint)
    options = reader.options(node.options)
    starts = options.pop("StartsIn", None)
    frozen = options.pop("FrozenOption", None) is not None
    return Instance(
        path.object,
        reader.name(node.model),
        _place(reader, node.place, options),
        None if starts is None else reader.amount(starts.position, "angle", "length"),
        frozen,
        subject.where,
    )


def _place(reader: SceneryReader, node: SyntaxNode, options: Options) -> At | In:
    """Read ``at hall.walls[1]``, ``in kitchen_doorway``, or ``in`` a space."""
    if rule_of(node) == "At":
        at = _offsets(reader, options)
        _refuse(reader, options, "is for objects placed in an entryway", "write in <entryway>, …")
        return At(reader.frame(node.frame), *at)
    name = reader.name(node.entryway)
    # x and y are for spaces: "in kitchen, x 1 m". Composition checks that kitchen is a space of
    # the floor plan.
    offsets = [rule for rule in options if rule in ("XIs", "YIs")]
    if offsets and not {"Hinge", "Sliding", "Opening", "OnSide", "Recessed"} & set(options):
        at = _offsets(reader, options)
        return At(FrameName(name.text, None, "", name.where), *at, inside=True)
    refused = {rule: options.pop(rule) for rule in offsets}
    _refuse(reader, refused, "is for objects placed at a frame", "write at <frame>, …")
    if "Hinge" in options and "Sliding" in options:
        raise reader.refusal(options["Sliding"], "a door has a hinge or slides, but not both")
    if "Hinge" in options:
        return _hinged(reader, name, options)
    if "Sliding" in options:
        return _sliding(reader, name, options)
    yaw = _value(reader, options, "Turned", "angle")
    _refuse(reader, options, "needs hinge left, hinge right or sliding …", "add one of them")
    return In(name, yaw=yaw)


def _offsets(reader: SceneryReader, options: Options) -> tuple[float, float, float]:
    return (
        _value(reader, options, "XIs", "length"),
        _value(reader, options, "YIs", "length"),
        _value(reader, options, "Turned", "angle"),
    )


def _hinged(reader: SceneryReader, entryway: Word, options: Options) -> In:
    hinge = options.pop("Hinge")
    opening = options.pop("Opening", None)
    if opening is None:
        hint = "add opening inwards, opening outwards or opening into <space>"
        raise reader.refusal(hinge, "a hinged leaf needs a side to open to", hint)
    recess = _value(reader, options, "Recessed", "length")
    _refuse(reader, options, "is not for doors with a hinge", "remove it")
    return In(
        entryway,
        manner="hinge",
        side=hinge.side,
        seen_from=None if hinge.seen is None else reader.name(hinge.seen),
        towards=_towards(reader, opening),
        recess=recess,
    )


def _sliding(reader: SceneryReader, entryway: Word, options: Options) -> In:
    sliding = options.pop("Sliding")
    side = options.pop("OnSide", None)
    _refuse(reader, options, "is not for sliding doors", "remove it")
    return In(
        entryway,
        manner="sliding",
        side=sliding.side,
        seen_from=None if sliding.seen is None else reader.name(sliding.seen),
        towards="in" if side is None else _towards(reader, side),
    )


def _towards(reader: SceneryReader, option: SyntaxNode) -> Towards:
    if option.space is not None:
        return reader.name(option.space)
    return "in" if option.direction in ("inwards", "inside") else "out"


def _refuse(reader: SceneryReader, options: Options, because: str, hint: str) -> None:
    for option in options.values():
        reader.error(option, f'"{option.keyword}" {because}', hint)


def _value(reader: SceneryReader, options: Options, rule: str, dimension: str) -> float:
    """Remove an option and return its SI value, by default 0."""
    option = options.pop(rule, None)
    return 0.0 if option is None else reader.value(option.value, dimension)


_PREDICATES: Final[dict[str, Callable[[SceneryReader, SyntaxNode, Subject], _Meaning]]] = {
    "IsFrozen": _freezes,
    "IsA": _instance,
    "Starts": _starts,
    "Stays": _stays,
    "Moves": _moves,
    "Toggles": _toggles,
    "Goes": _goes,
    "Walks": _walks,
}
