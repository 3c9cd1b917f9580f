"""What a sentence means for one object: behaviours of its joints, and what they wait for."""

from __future__ import annotations

from collections.abc import Mapping

from grammars.model.behaviour import (
    Behaviour,
    Event,
    Hold,
    JointActs,
    Jump,
    KeyFrame,
    KeyFrames,
    LegBegins,
    Motion,
    Reaction,
    Servo,
    Spring,
    Trigger,
    WaypointReached,
)
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
from grammars.scenery.composition._walks import walk_of
from grammars.scenery.model import (
    Alternates,
    Amount,
    EventPhrase,
    Goes,
    MotionAs,
    Moves,
    OnLeg,
    OnWaypoint,
    Reacts,
    Sentence,
    Stays,
    Subject,
    Toggles,
    Walks,
)
from grammars.text.diagnostics import InputError


def event_of(
    context: SentenceContext,
    catalogue: Catalogue,
    bodies: Mapping[str, SceneObject],
    said: EventPhrase,
) -> Event:
    """Return the concrete event; raises :class:`InputError` for unknown objects and joints."""
    if isinstance(said, OnLeg):
        return LegBegins(said.leg)
    if isinstance(said, OnWaypoint):
        return WaypointReached(said.waypoint)
    path = said.path
    (target,) = catalogue.targets(context.layer, Subject(False, (path,), (), path.where))
    body = bodies[target.object]
    joints = tuple(joint for joint in body.joints if not is_fixed(joint))
    names = [target.joint] if target.joint else [joint.name for joint in joints]
    if not names:
        hint = "wait for something with a joint"
        raise InputError.at(path.where, f"{body.name} has no joint that moves", hint)
    return JointActs(tuple(f"{body.name}.{name}" for name in names), said.act)


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

    def resolve(self, said: Sentence) -> list[Behaviour]:
        """Return one behaviour for each joint the sentence moves."""
        match said:
            case Stays():
                return self._stays(said)
            case Moves():
                return self._moves(said)
            case Toggles() | Alternates():
                return self._changes(said)
            case Goes():
                return self._goes(said)
            case Reacts():
                return self._reacts(said)
            case Walks():
                return self._walks(said)

    def _stays(self, said: Stays) -> list[Behaviour]:
        positions = self._positions(said.position)
        return [Hold(self._full(joint), position) for joint, position in positions.items()]

    def _moves(self, said: Moves) -> list[Behaviour]:
        frames: dict[str, list[KeyFrame]] = {}
        last = -1.0
        for position, time in said.frames:
            at = self._time(time)
            # Key frames of one sentence are in order of time, so that it reads as it happens;
            # who means another order says so.
            if at == last:
                message = f"two key frames at {at:g} s"
                raise InputError.at(time.where, message, "leave one of them out")
            if at < last and not said.listed:
                message = f"{at:g} s is not after {last:g} s"
                hint = "put them in order, or add as listed: each is played after the one before it"
                raise InputError.at(time.where, message, hint)
            last = at
            for joint, value in self._positions(position).items():
                frames.setdefault(joint, []).append(KeyFrame(at, value))
        return [
            KeyFrames(self._full(joint), tuple(f), self._motion(said.motion, joint))
            for joint, f in frames.items()
        ]

    def _changes(self, said: Toggles | Alternates) -> list[Behaviour]:
        """Return key frames drawn for each joint, of a seed that depends on its name alone."""
        first, second = self._positions(said.first), self._positions(said.second)
        self._same_joints(said, first, second)
        chance = self._toggles(said) if isinstance(said, Toggles) else self._waits(said)
        often = said.every if isinstance(said, Toggles) else said.waiting.first
        if chance.count > MOST_DRAWS:
            message = f"that makes more than {MOST_DRAWS} draws"
            raise InputError.at(often.where, message, "are the units right?")
        return [
            KeyFrames(
                self._full(joint),
                chance.draw(
                    child_seed(self._context.seed, self._full(joint)), start, second[joint]
                ),
                self._motion(said.motion, joint),
            )
            for joint, start in first.items()
        ]

    def _toggles(self, said: Toggles) -> RandomToggles:
        period = self._time(said.every)
        if period <= 0.0:
            raise InputError.at(said.every.where, "the period is greater than 0 s")
        chance = RandomToggles(
            period=period,
            since=self._time(said.since, period),
            until=self._until(said),
            limit=self._context.limit,
            probability=said.probability,
            delay=self._time(said.delay),
            step=self._time(said.step),
        )
        if chance.delay > period:
            raise InputError.at(
                said.where, "a change may come later than the next one", "delay it less"
            )
        return chance

    def _waits(self, said: Alternates) -> RandomWaits:
        waiting = said.waiting
        first, second = self._time(waiting.first), self._time(waiting.second)
        if waiting.kind == "uniform" and second < first:
            raise InputError.at(said.where, "the longest wait is less than the shortest")
        if (second if waiting.kind == "uniform" else first) <= 0.0:
            raise InputError.at(waiting.first.where, "it waits longer than 0 s")
        return RandomWaits(waiting.kind, first, second, self._time(said.since), self._until(said))

    def _until(self, said: Toggles | Alternates) -> float:
        limit = self._context.limit
        return min(limit, self._time(said.until, limit))

    def _goes(self, said: Goes) -> list[Behaviour]:
        start, end = self._positions(said.start), self._positions(said.end)
        distance = self._context.value(said.distance, "length")
        rearm = None if said.again is None else self._context.value(said.again, "length")
        if distance <= 0.0:
            raise InputError.at(said.distance.where, "a distance is greater than 0 m")
        if rearm is not None and said.again is not None and rearm <= distance:
            message = f"it would be ready again at {rearm:g} m, inside of {distance:g} m"
            raise InputError.at(said.again.where, message, "again beyond a larger distance")
        begin = start if said.begin is None else self._positions(said.begin)
        self._same_joints(said, start, begin)
        self._same_joints(said, start, end)
        if said.begin is not None and said.motion.kind == "jump":
            message = "what jumps is where it goes from at once"
            raise InputError.at(said.begin.where, message, "leave out starting at …")
        if said.of == "doorway" and not self._body.doorway:
            message = f"{self._body.name} does not stand in a doorway"
            raise InputError.at(said.where, message, "measure from its hinge or leaf")
        return [
            Trigger(
                self._full(joint),
                start[joint],
                end[joint],
                distance,
                self._motion(said.motion, joint),
                said.of,
                said.to,
                rearm,
                None if said.begin is None else begin[joint],
            )
            for joint in start
        ]

    def _reacts(self, said: Reacts) -> list[Behaviour]:
        start, end = self._positions(said.start), self._positions(said.end)
        self._same_joints(said, start, end)
        event = self._event(said.occasion)
        delay = self._time(said.after)
        return [
            Reaction(
                self._full(joint),
                start[joint],
                end[joint],
                event,
                self._motion(said.motion, joint),
                delay,
            )
            for joint in start
        ]

    def _walks(self, said: Walks) -> list[Behaviour]:
        if self._joint:
            raise InputError.at(said.where, f"{self._body.name} walks as a whole")
        event = None if said.occasion is None else self._event(said.occasion)
        return [walk_of(self._context, self._body, said, event)]

    def _event(self, said: EventPhrase) -> Event:
        return event_of(self._context, self._catalogue, self._bodies, said)

    def _same_joints(
        self,
        said: Toggles | Goes | Alternates | Reacts,
        one: Mapping[str, float],
        other: Mapping[str, float],
    ) -> None:
        if set(one) != set(other):
            first, second = (
                (said.start, said.end)
                if isinstance(said, Goes | Reacts)
                else (said.first, said.second)
            )
            raise InputError.at(said.where, f"{first} and {second} move different joints")

    def _full(self, joint: str) -> str:
        return f"{self._body.name}.{joint}"

    def _positions(self, position: Amount) -> dict[str, float]:
        positions = joint_positions(
            self._body, self._model, position, self._joint, self._context.parameters
        )
        if is_mover(self._body.joints) and set(PLANAR_JOINTS) & set(positions):
            message = f"{self._body.name} is a mover: it walks, or stands where it is placed"
            hint = f"{self._body.name} walks along …"
            raise InputError.at(position.where, message, hint)
        return positions

    def _time(self, amount: Amount | None, default: float = 0.0) -> float:
        """Return a time [s] since the start of the run, ``default`` when nothing was said."""
        if amount is None:
            return default
        value = self._context.value(amount, "time")
        if value < 0.0:
            message = f"{value:g} s is before the start of the run"
            raise InputError.at(amount.where, message, "times count from 0 s")
        return value

    def _motion(self, said: MotionAs, joint: str) -> Motion:
        value = self._context.optional
        turns = joint_of(self._body, joint).kind == "revolute"
        kind = "torsional " if turns else ""
        if said.kind == "jump":
            return Jump()
        if said.kind == "servo":
            # What is not said is what the motion itself has as default: one place for the numbers.
            plain = Servo()
            rate = value(said.rate, plain.rate, "angular speed" if turns else "speed")
            effort = value(said.effort, plain.effort, "torque" if turns else "force")
            self._positive(said.rate, rate)
            self._positive(said.effort, effort)
            return Servo(rate, effort)
        soft = Spring()
        stiffness = value(said.stiffness, soft.stiffness, f"{kind}stiffness")
        damping = value(said.damping, soft.damping, f"{kind}damping")
        self._positive(said.stiffness, stiffness)
        if damping < 0.0 and said.damping is not None:
            raise InputError.at(said.damping.where, "damping is never negative")
        return Spring(stiffness, damping)

    def _positive(self, amount: Amount | None, value: float) -> None:
        if amount is not None and value <= 0.0:
            raise InputError.at(amount.where, "this must be greater than 0")
