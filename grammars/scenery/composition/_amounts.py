"""What amounts mean: quantities, parameters, ``closed`` or ``1.4 rad`` for joints of the scene."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from grammars.model.geometry import Pose2
from grammars.model.movers import own_joints
from grammars.model.scene import Joint, SceneObject
from grammars.scenery.measure import Measure, require_dimension
from grammars.scenery.model import Amount, ObjectModel, SceneryLayer, Word
from grammars.text.diagnostics import InputError, Where, did_you_mean


class SentenceContext:
    """What the sentences of one layer share."""

    def __init__(
        self,
        layer: SceneryLayer,
        seed: np.random.SeedSequence,
        limit: float,
        frames: Mapping[str, Pose2],
    ) -> None:
        self.layer = layer
        self.frames = frames
        self.seed = seed
        self.limit = limit
        self.parameters: dict[str, Measure] = {p.name: p.value for p in layer.parameters}

    def value(self, amount: Amount, *dimensions: str) -> float:
        """Return the SI value of a quantity or parameter."""
        if not isinstance(amount, Word):
            return require_dimension(amount, *dimensions)
        given = self.parameters.get(amount.text)
        if given is None:
            hint = did_you_mean(amount.text, self.parameters) or (
                f"declare it: parameter {amount} = …"
            )
            raise InputError.at(amount.where, f'there is no parameter "{amount}"', hint)
        return require_dimension(given, *dimensions)

    def optional(self, amount: Amount | None, default: float, *dimensions: str) -> float:
        """Return the SI value, or ``default`` when nothing was said."""
        return default if amount is None else self.value(amount, *dimensions)


_TOLERANCE: Final = 1e-9


def joint_positions(
    body: SceneObject,
    model: ObjectModel,
    position: Amount,
    joint: str,
    parameters: Mapping[str, Measure] | None = None,
) -> dict[str, float]:
    """Return positions [rad or m] by joint name, as the scene counts them.

    ``position`` is a quantity, a parameter or a state of ``model``; ``joint`` limits it to one
    joint. Raises :class:`InputError` for unknown states, wrong units and broken limits.
    """
    if isinstance(position, Word):
        given = (parameters or {}).get(position.text)
        states = {state.name: state for state in model.states}
        if given is None and position.text not in states:
            known = (*states, *(parameters or {}))
            hint = did_you_mean(position.text, known) or f"object {model.name} has no states"
            message = f'{body.name}: {model.name} has no state "{position}"'
            raise InputError.at(position.where, message, hint)
        if given is None:
            chosen = dict(states[position.text].positions)
            if joint and joint not in chosen:
                message = f'state "{position}" of {model.name} says nothing about {joint}'
                raise InputError.at(position.where, message)
            wanted = {joint: chosen[joint]} if joint else chosen
            return {name: _in_scene(body, name, value) for name, value in wanted.items()}
        return _single(body, model, given, position.where, joint)
    return _single(body, model, position, position.where, joint)


def _single(
    body: SceneObject, model: ObjectModel, given: Measure, where: Where, joint: str
) -> dict[str, float]:
    # Fixed joints and those a mover walks on are nobody's to say.
    own = own_joints(model.joints)
    if not joint and len(own) != 1:
        if not own:
            raise InputError.at(where, f"{body.name} has no joint that could move")
        hint = f"write {body.name}.{own[0].name}, or a state"
        raise InputError.at(where, f"{body.name} has several joints", hint)
    kind = next(j for j in (model.joints if joint else own) if not joint or j.name == joint)
    value = require_dimension(given, "angle" if kind.kind == "revolute" else "length")
    if not kind.lower - _TOLERANCE <= value <= kind.upper + _TOLERANCE:
        unit, factor = "rad" if kind.kind == "revolute" else "m", 1.0
        # In the unit of whoever wrote it.
        if unit == "rad" and "deg" in given.text:
            unit, factor = "deg", math.degrees(1.0)
        message = f"{given.text} is outside the limits of {body.name}.{kind.name}"
        hint = f"between {kind.lower * factor:g} {unit} and {kind.upper * factor:g} {unit}"
        raise InputError.at(where, message, hint)
    return {kind.name: _in_scene(body, kind.name, value)}


def closed_positions(model: ObjectModel) -> tuple[float, ...]:
    """Return the joint positions of state ``closed``; zero (or the nearest limit) without it."""
    closed = next((dict(s.positions) for s in model.states if s.name == "closed"), {})
    return tuple(closed.get(j.name, min(max(0.0, j.lower), j.upper)) for j in model.joints)


def joint_of(body: SceneObject, name: str) -> Joint:
    """Return the joint called ``name``."""
    return next(joint for joint in body.joints if joint.name == name)


def _in_scene(body: SceneObject, joint: str, value: float) -> float:
    """A mirrored object turns the other way round."""
    turns = joint_of(body, joint).kind == "revolute"
    return -value + 0.0 if body.mirrored and turns else value
