"""What one sentence means for one object: concrete behaviours of its joints."""

from __future__ import annotations

from collections.abc import Mapping

from grammars.behaviour import (
    Behaviour,
    Event,
    Hold,
    Jump,
    KeyFrame,
    KeyFrames,
    Motion,
    Reaction,
    Servo,
    Spring,
    Trigger,
)
from grammars.composition.catalogue import Catalogue
from grammars.composition.chance import (
    MOST_DRAWS,
    Chance,
    Pauses,
    child_seed,
    draw,
    draw_pauses,
)
from grammars.composition.context import Context
from grammars.composition.occasions import event_of, walk_of
from grammars.composition.positions import joint_of, joint_positions
from grammars.diagnostics import Diagnostic, InputError
from grammars.movers import JOINTS, is_mover
from grammars.scene import SceneObject
from grammars.scenery.model import (
    Alternates,
    Amount,
    Goes,
    MotionAs,
    Moves,
    Occasion,
    Reacts,
    Sentence,
    Stays,
    Toggles,
    Walks,
)


class Speaker:
    """Applies sentences to one object."""

    def __init__(
        self,
        context: Context,
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

    def behaviours(self, said: Sentence) -> list[Behaviour]:
        """Return one behaviour for each joint the sentence moves."""
        match said:
            case Stays():
                return self._stays(said)
            case Moves():
                return self._moves(said)
            case Toggles():
                return self._toggles(said)
            case Goes():
                return self._goes(said)
            case Alternates():
                return self._alternates(said)
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
            if at <= last:
                raise InputError(
                    Diagnostic(time.where, f"{at:g} s is not after {last:g} s", "put them in order")
                )
            last = at
            for joint, value in self._positions(position).items():
                frames.setdefault(joint, []).append(KeyFrame(at, value))
        return [
            KeyFrames(self._full(joint), tuple(f), self._motion(said.motion, joint))
            for joint, f in frames.items()
        ]

    def _toggles(self, said: Toggles) -> list[Behaviour]:
        first, second = self._positions(said.first), self._positions(said.second)
        self._same_joints(said, first, second)
        chance = self._chance(said)
        found: list[Behaviour] = []
        for joint, start in first.items():
            seed = child_seed(self._context.seed, self._full(joint))
            frames = draw(chance, seed, self._context.limit, start, second[joint])
            found.append(KeyFrames(self._full(joint), frames, self._motion(said.motion, joint)))
        return found

    def _chance(self, said: Toggles) -> Chance:
        limit = self._context.limit
        period = self._time(said.every)
        if period <= 0.0:
            raise InputError(Diagnostic(said.every.where, "the period is greater than 0 s"))
        chance = Chance(
            period=period,
            since=period if said.since is None else self._time(said.since),
            until=min(limit, limit if said.until is None else self._time(said.until)),
            probability=said.probability,
            delay=0.0 if said.delay is None else self._time(said.delay),
            step=0.0 if said.step is None else self._time(said.step),
        )
        if chance.delay > period:
            raise InputError(
                Diagnostic(said.where, "a change may come later than the next one", "delay it less")
            )
        if chance.count > MOST_DRAWS:
            message = f"that makes more than {MOST_DRAWS} draws"
            raise InputError(Diagnostic(said.every.where, message, "are the units right?"))
        return chance

    def _goes(self, said: Goes) -> list[Behaviour]:
        start, end = self._positions(said.start), self._positions(said.end)
        distance = self._context.value(said.distance, "length")
        rearm = None if said.again is None else self._context.value(said.again, "length")
        if distance <= 0.0:
            raise InputError(Diagnostic(said.distance.where, "a distance is greater than 0 m"))
        if rearm is not None and said.again is not None and rearm <= distance:
            message = f"it would be ready again at {rearm:g} m, inside of {distance:g} m"
            raise InputError(
                Diagnostic(said.again.where, message, "again beyond a larger distance")
            )
        begin = start if said.begin is None else self._positions(said.begin)
        self._same_joints(said, start, begin)
        self._same_joints(said, start, end)
        if said.begin is not None and said.motion.kind == "jump":
            message = "what jumps is where it goes from at once"
            raise InputError(Diagnostic(said.begin.where, message, "leave out starting at …"))
        if said.of == "doorway" and not self._body.doorway:
            message = f"{self._body.name} does not stand in a doorway"
            raise InputError(Diagnostic(said.where, message, "measure from its hinge or leaf"))
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

    def _alternates(self, said: Alternates) -> list[Behaviour]:
        first, second = self._positions(said.first), self._positions(said.second)
        self._same_joints(said, first, second)
        pauses = self._pauses(said)
        found: list[Behaviour] = []
        for joint, start in first.items():
            seed = child_seed(self._context.seed, self._full(joint))
            frames = draw_pauses(pauses, seed, start, second[joint])
            found.append(KeyFrames(self._full(joint), frames, self._motion(said.motion, joint)))
        return found

    def _pauses(self, said: Alternates) -> Pauses:
        limit, waiting = self._context.limit, said.waiting
        first = self._time(waiting.first)
        second = 0.0 if waiting.second is None else self._time(waiting.second)
        if waiting.kind == "uniform" and second < first:
            raise InputError(Diagnostic(said.where, "the longest wait is less than the shortest"))
        if (second if waiting.kind == "uniform" else first) <= 0.0:
            raise InputError(Diagnostic(waiting.first.where, "it waits longer than 0 s"))
        pauses = Pauses(
            waiting.kind,
            first,
            second,
            0.0 if said.since is None else self._time(said.since),
            min(limit, limit if said.until is None else self._time(said.until)),
        )
        if pauses.count > MOST_DRAWS:
            message = f"that makes more than {MOST_DRAWS} draws"
            raise InputError(Diagnostic(waiting.first.where, message, "are the units right?"))
        return pauses

    def _reacts(self, said: Reacts) -> list[Behaviour]:
        start, end = self._positions(said.start), self._positions(said.end)
        self._same_joints(said, start, end)
        event = self._event(said.occasion)
        delay = 0.0 if said.after is None else self._time(said.after)
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
            raise InputError(Diagnostic(said.where, f"{self._body.name} walks as a whole"))
        event = None if said.occasion is None else self._event(said.occasion)
        return [walk_of(self._context, self._body, said, event)]

    def _event(self, said: Occasion) -> Event:
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
            raise InputError(Diagnostic(said.where, f"{first} and {second} move different joints"))

    def _full(self, joint: str) -> str:
        return f"{self._body.name}.{joint}"

    def _positions(self, position: Amount) -> dict[str, float]:
        positions = joint_positions(
            self._body, self._model, position, self._joint, self._context.parameters
        )
        if is_mover(self._body.joints) and set(JOINTS) & set(positions):
            message = f"{self._body.name} is a mover: it walks, or stands where it is placed"
            hint = f"{self._body.name} walks along …"
            raise InputError(Diagnostic(position.where, message, hint))
        return positions

    def _time(self, amount: Amount) -> float:
        value = self._context.value(amount, "time")
        if value < 0.0:
            message = f"{value:g} s is before the start of the run"
            raise InputError(Diagnostic(amount.where, message, "times count from 0 s"))
        return value

    def _motion(self, said: MotionAs, joint: str) -> Motion:
        value = self._context.optional
        turns = joint_of(self._body, joint).kind == "revolute"
        kind = "torsional " if turns else ""
        if said.kind == "jump":
            return Jump()
        if said.kind == "servo":
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
            raise InputError(Diagnostic(said.damping.where, "damping is never negative"))
        return Spring(stiffness, damping)

    def _positive(self, amount: Amount | None, value: float) -> None:
        if amount is not None and value <= 0.0:
            raise InputError(Diagnostic(amount.where, "this must be greater than 0"))
