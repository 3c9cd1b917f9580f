"""From a sentence to the behaviours of one object."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, Literal, TypeAlias

from grammars.model.behaviour import (
    Behaviour,
    Event,
    Hold,
    JointActs,
    Jump,
    KeyFrame,
    KeyFrames,
    Motion,
    Reaction,
    Servo,
    Spring,
    Trigger,
    Walk,
)
from grammars.model.geometry import Point2, Pose2
from grammars.model.movers import PLANAR_JOINTS, is_fixed, is_mover
from grammars.model.scene import SceneObject
from grammars.scenery.composition._amounts import SentenceContext, joint_of, joint_positions
from grammars.scenery.composition._catalogue import Catalogue
from grammars.scenery.composition._chance import (
    MOST_DRAWS,
    RandomToggles,
    RandomWaits,
    child_seed,
)
from grammars.scenery.composition._rings import rounded, rounded_point
from grammars.scenery.model import (
    Amount,
    EventPhrase,
    Goes,
    Measure,
    MotionAs,
    Moves,
    OnObject,
    Reacts,
    RoutePoint,
    Sentence,
    Stays,
    Subject,
    Toggles,
    Waiting,
    Walks,
    Word,
)
from grammars.text.diagnostics import InputError, did_you_mean

_SHORTEST: Final = 0.01
"""Shortest distance between points of a route [m]."""
_PACE: Final = 1.0
"""Default walking speed [m/s]."""
_Facing: TypeAlias = Literal["ahead", "sideways", "fixed"]


class SentenceResolver:
    """Applies sentences to one object."""

    def __init__(
        self,
        context: SentenceContext,
        catalogue: Catalogue,
        bodies: Mapping[str, SceneObject],
        name: str,
        joint: str,
    ) -> None:
        self._context = context
        self._catalogue, self._bodies = catalogue, bodies
        self._body = bodies[name]
        self._model = catalogue.model_of(name)
        self._joint = joint

    def resolve(self, sentence: Sentence) -> list[Behaviour]:
        """Return one behaviour for each joint that the sentence moves."""
        match sentence:
            case Stays():
                return self._stays(sentence)
            case Moves():
                return self._moves(sentence)
            case Toggles():
                return self._toggles(sentence)
            case Goes():
                return self._goes(sentence)
            case Reacts():
                return self._reacts(sentence)
            case Walks():
                return self._walks(sentence)

    def _stays(self, sentence: Stays) -> list[Behaviour]:
        positions = self._positions(sentence.position)
        return [Hold(self._full(joint), position) for joint, position in positions.items()]

    def _moves(self, sentence: Moves) -> list[Behaviour]:
        frames: dict[str, list[KeyFrame]] = {}
        last = -1.0
        for position, time in sentence.frames:
            at = self._time(time)
            # Key frames must be sorted by time unless the sentence has "as listed".
            if at == last:
                message = f"two key frames at {at:g} s"
                raise InputError.at(time.where, message, "remove one of them")
            if at < last and not sentence.listed:
                message = f"{at:g} s is not after {last:g} s"
                hint = "sort them by time, or add as listed to play them in this order"
                raise InputError.at(time.where, message, hint)
            last = at
            for joint, value in self._positions(position).items():
                frames.setdefault(joint, []).append(KeyFrame(at, value))
        return [
            KeyFrames(self._full(joint), tuple(f), self._motion(sentence.motion, joint))
            for joint, f in frames.items()
        ]

    def _toggles(self, sentence: Toggles) -> list[Behaviour]:
        """Return random key frames for each joint, from a seed that depends only on its name."""
        first, second = self._positions(sentence.first), self._positions(sentence.second)
        self._same_joints(sentence, first, second)
        period = sentence.period
        earliest = 0.0
        if isinstance(period, Waiting):
            chance: RandomWaits | RandomToggles = self._random_waits(sentence, period)
            earliest = self._time(period.first) if period.kind == "uniform" else 0.0
            period = period.first
        else:
            chance = self._random_toggles(sentence, period)
        earliest += chance.since
        reasons = {
            "both positions are the same": first == second,
            "its probability is 0": sentence.probability == 0.0,
            f"it would begin at {earliest:g} s and end at {chance.until:g} s": earliest
            > chance.until,
        }
        for reason in [reason for reason, holds in reasons.items() if holds]:
            self._context.warn(sentence.where, f"nothing changes: {reason}")
        if chance.count > MOST_DRAWS:
            message = f"this needs more than {MOST_DRAWS} draws"
            raise InputError.at(period.where, message, "check the units")
        return [
            KeyFrames(
                self._full(joint),
                chance.draw(
                    child_seed(self._context.seed, self._full(joint)), start, second[joint]
                ),
                self._motion(sentence.motion, joint),
            )
            for joint, start in first.items()
        ]

    def _random_toggles(self, sentence: Toggles, every: Amount) -> RandomToggles:
        period = self._time(every)
        if period <= 0.0:
            raise InputError.at(every.where, "the period must be greater than 0 s")
        chance = RandomToggles(
            period=period,
            since=self._time(sentence.since, period),
            until=self._until(sentence),
            limit=self._context.limit,
            probability=sentence.probability,
            delay=self._time(sentence.delay),
            step=self._time(sentence.step),
        )
        if chance.delay > period:
            raise InputError.at(
                sentence.where, "a change may come later than the next one", "use a shorter delay"
            )
        return chance

    def _random_waits(self, sentence: Toggles, waiting: Waiting) -> RandomWaits:
        first, second = self._time(waiting.first), self._time(waiting.second)
        if waiting.kind == "uniform" and second < first:
            raise InputError.at(sentence.where, "the longest wait is shorter than the shortest")
        if (second if waiting.kind == "uniform" else first) <= 0.0:
            raise InputError.at(waiting.first.where, "the wait must be longer than 0 s")
        return RandomWaits(
            waiting.kind, first, second, self._time(sentence.since), self._until(sentence)
        )

    def _until(self, sentence: Toggles) -> float:
        limit = self._context.limit
        return min(limit, self._time(sentence.until, limit))

    def _goes(self, sentence: Goes) -> list[Behaviour]:
        start, end = self._positions(sentence.start), self._positions(sentence.end)
        distance = self._context.value(sentence.distance, "length")
        rearm = None if sentence.again is None else self._context.value(sentence.again, "length")
        if distance <= 0.0:
            raise InputError.at(sentence.distance.where, "the distance must be greater than 0 m")
        if rearm is not None and sentence.again is not None and rearm <= distance:
            message = f"again beyond {rearm:g} m is not farther than {distance:g} m"
            raise InputError.at(sentence.again.where, message, "use a larger distance")
        begin = start if sentence.begin is None else self._positions(sentence.begin)
        self._same_joints(sentence, start, begin)
        self._same_joints(sentence, start, end)
        if sentence.begin is not None and sentence.motion.kind == "jump":
            message = "a jump cannot start at another position"
            raise InputError.at(sentence.begin.where, message, "remove starting at …")
        if sentence.of == "doorway" and not self._body.doorway:
            message = f"{self._body.name} does not stand in a doorway"
            raise InputError.at(sentence.where, message, "measure from its hinge or leaf")
        return [
            Trigger(
                self._full(joint),
                start[joint],
                end[joint],
                distance,
                self._motion(sentence.motion, joint),
                sentence.of,
                sentence.to,
                rearm,
                None if sentence.begin is None else begin[joint],
            )
            for joint in start
        ]

    def _reacts(self, sentence: Reacts) -> list[Behaviour]:
        start, end = self._positions(sentence.start), self._positions(sentence.end)
        self._same_joints(sentence, start, end)
        event = self._event(sentence.occasion)
        delay = self._time(sentence.after)
        return [
            Reaction(
                self._full(joint),
                start[joint],
                end[joint],
                event,
                self._motion(sentence.motion, joint),
                delay,
            )
            for joint in start
        ]

    def _walks(self, sentence: Walks) -> list[Behaviour]:
        if self._joint:
            message = f"only {self._body.name} as a whole can walk"
            raise InputError.at(sentence.where, message, f"remove .{self._joint}")
        body, context = self._body, self._context
        if not is_mover(body.joints):
            message = f"{body.name} cannot walk: {body.model} is an object, not a mover"
            raise InputError.at(sentence.where, message, f"write mover {body.model} …")
        pause = context.optional(sentence.pause, 0.0, "time")
        since = context.optional(sentence.since, 0.0, "time")
        if pause < 0.0 or since < 0.0:
            raise InputError.at(sentence.where, "times of a walk must not be negative")
        if sentence.manner == "once" and pause > 0.0 and not sentence.everywhere:
            hint = "add back and forth, or write pausing … at every point"
            raise InputError.at(sentence.where, "a walk done once has no stops to pause at", hint)
        facing, yaw = _facing(context, sentence)
        yielding = sentence.yielding
        walk = Walk(
            body.name,
            _route(context.frames, sentence),
            self._positive(sentence.speed, _PACE, "speed"),
            self._positive(sentence.acceleration, 1.0, "acceleration"),
            sentence.manner,
            pause,
            "points" if sentence.everywhere else "ends",
            since,
            None if sentence.occasion is None else self._event(sentence.occasion),
            facing,
            yaw,
            yielding if yielding is None else self._positive(yielding, 0.0, "length"),
        )
        return [walk]

    def _event(self, phrase: EventPhrase) -> Event:
        """Return the event of a phrase; raises :class:`InputError` for unknown names."""
        if not isinstance(phrase, OnObject):
            return phrase
        path = phrase.path
        subject = Subject(False, (path,), (), path.where)
        (target,) = self._catalogue.targets(self._context.layer, subject)
        body = self._bodies[target.object]
        joints = (joint.name for joint in body.joints if not is_fixed(joint))
        names = [target.joint] if target.joint else list(joints)
        if not names:
            raise InputError.at(path.where, f"{body.name} has no joint that moves")
        return JointActs(tuple(f"{body.name}.{name}" for name in names), phrase.act)

    def _same_joints(
        self,
        sentence: Toggles | Goes | Reacts,
        one: Mapping[str, float],
        other: Mapping[str, float],
    ) -> None:
        if set(one) != set(other):
            first, second = (
                (sentence.start, sentence.end)
                if isinstance(sentence, Goes | Reacts)
                else (sentence.first, sentence.second)
            )
            raise InputError.at(sentence.where, f"{first} and {second} move different joints")

    def _full(self, joint: str) -> str:
        return f"{self._body.name}.{joint}"

    def _positions(self, position: Amount) -> dict[str, float]:
        positions = joint_positions(
            self._body, self._model, position, self._joint, self._context.parameters
        )
        if is_mover(self._body.joints) and set(PLANAR_JOINTS) & set(positions):
            message = f"{self._body.name} is a mover: sentences cannot set its position"
            hint = f"{self._body.name} walks along …"
            raise InputError.at(position.where, message, hint)
        return positions

    def _time(self, amount: Amount | None, default: float = 0.0) -> float:
        """Return a time [s] since the start of the run, or ``default`` without an amount."""
        if amount is None:
            return default
        value = self._context.value(amount, "time")
        if value < 0.0:
            message = f"{value:g} s is before the start of the run"
            raise InputError.at(amount.where, message, "times count from 0 s")
        return value

    def _motion(self, motion: MotionAs, joint: str) -> Motion:
        turns = joint_of(self._body, joint).kind == "revolute"
        kind = "torsional " if turns else ""
        if motion.kind == "jump":
            return Jump()
        if motion.kind == "servo":
            default = Servo()
            return Servo(
                self._positive(motion.rate, default.rate, "angular speed" if turns else "speed"),
                self._positive(motion.effort, default.effort, "torque" if turns else "force"),
            )
        soft = Spring()
        stiffness = self._positive(motion.stiffness, soft.stiffness, f"{kind}stiffness")
        damping = self._context.optional(motion.damping, soft.damping, f"{kind}damping")
        if damping < 0.0 and motion.damping is not None:
            raise InputError.at(motion.damping.where, "damping must not be negative")
        return Spring(stiffness, damping)

    def _positive(self, amount: Amount | None, default: float, dimension: str) -> float:
        value = self._context.optional(amount, default, dimension)
        if amount is not None and value <= 0.0:
            raise InputError.at(amount.where, "this must be greater than 0")
        return value


def _facing(context: SentenceContext, sentence: Walks) -> tuple[_Facing, float]:
    if isinstance(sentence.facing, Word | Measure):
        angle = context.value(sentence.facing, "angle")
        frame = _frame_in(context.frames, sentence.route[-1])
        return "fixed", rounded((frame @ Pose2(yaw=angle)).yaw, 12)
    return sentence.facing, 0.0


def _route(frames: Mapping[str, Pose2], sentence: Walks) -> tuple[Point2, ...]:
    points: list[Point2] = []
    for point in sentence.route:
        spot = rounded_point(_frame_in(frames, point).apply((point.x, point.y)))
        if points and math.dist(spot, points[-1]) < _SHORTEST:
            message = "two points of the route are the same"
            raise InputError.at(sentence.where, message, "use pausing … to wait at points")
        points.append(spot)
    if sentence.manner == "round" and math.dist(points[0], points[-1]) < _SHORTEST:
        points.pop()  # The route closes itself.
    if sentence.manner == "round" and len(points) < 3:
        message = "a round needs three points or more"
        raise InputError.at(sentence.where, message, "write back and forth")
    return tuple(points)


def _frame_in(frames: Mapping[str, Pose2], point: RoutePoint) -> Pose2:
    """Return the world pose of the frame of ``point``; raises for unknown names."""
    name = str(point.frame)
    if name == "world":
        return Pose2()
    if name not in frames:
        hint = did_you_mean(name, (*frames, "world"))
        message = f'there is no frame "{name}" in the floor plan'
        raise InputError.at(point.frame.where, message, hint)
    return frames[name]
