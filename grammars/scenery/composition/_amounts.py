"""Values of amounts: quantities, parameters, and states such as ``closed`` for joints."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from grammars.model.geometry import Pose2
from grammars.model.movers import own_joints
from grammars.model.scene import Joint, SceneObject
from grammars.scenery.model import (
    Amount,
    Measure,
    ObjectModel,
    SceneryLayer,
    Word,
    require_dimension,
)
from grammars.text.diagnostics import Finding, InputError, Severity, Where, did_you_mean


class SentenceContext:
    """Common context of the sentences of one layer."""

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
        self.warnings: list[Finding] = []
        self.parameters: dict[str, Measure] = {p.name: p.value for p in layer.parameters}

    def warn(self, where: Where, message: str) -> None:
        """Add a warning about a sentence that does nothing."""
        hint = "change the sentence, or leave it out"
        self.warnings.append(Finding(where, message, hint, Severity.WARNING))

    def value(self, amount: Amount, *dimensions: str) -> float:
        """Return the SI value of a quantity or parameter."""
        if not isinstance(amount, Word):
            return require_dimension(amount, *dimensions)
        measure = self.parameters.get(amount.text)
        if measure is None:
            hint = did_you_mean(amount.text, self.parameters) or (
                f"declare it: parameter {amount} = …"
            )
            raise InputError.at(amount.where, f'there is no parameter "{amount}"', hint)
        return require_dimension(measure, *dimensions)

    def optional(self, amount: Amount | None, default: float, *dimensions: str) -> float:
        """Return the SI value of an amount, or ``default`` without one."""
        return default if amount is None else self.value(amount, *dimensions)


_TOLERANCE: Final = 1e-9


def joint_positions(
    body: SceneObject,
    model: ObjectModel,
    position: Amount,
    joint: str,
    parameters: Mapping[str, Measure] | None = None,
) -> dict[str, float]:
    """Return joint positions in the scene [rad or m], by joint name.

    ``position`` is a quantity, a parameter or a state of ``model``; ``joint`` limits it to one
    joint. Raises :class:`InputError` for unknown states, wrong units and broken limits.
    """
    if not isinstance(position, Word):
        return _single(body, model, position, position.where, joint)
    states = {state.name: state for state in model.states}
    measure = (parameters or {}).get(position.text)
    if measure is not None:
        return _single(body, model, measure, position.where, joint)
    if position.text not in states:
        names = (*states, *(parameters or {}))
        hint = did_you_mean(position.text, names) or f"object {model.name} has no states"
        message = f'{body.name}: {model.name} has no state "{position}"'
        raise InputError.at(position.where, message, hint)
    positions = dict(states[position.text].positions)
    if joint and joint not in positions:
        message = f'state "{position}" of {model.name} has no position for {joint}'
        raise InputError.at(position.where, message)
    names = (joint,) if joint else tuple(positions)
    return {name: _in_scene(body, name, positions[name]) for name in names}


def _single(
    body: SceneObject, model: ObjectModel, position: Measure, where: Where, name: str
) -> dict[str, float]:
    # Behaviours cannot set fixed joints and the planar chain of movers.
    own = own_joints(model.joints)
    if not name and len(own) != 1:
        if not own:
            raise InputError.at(where, f"{body.name} has no joint that could move")
        hint = f"write {body.name}.{own[0].name}, or a state"
        raise InputError.at(where, f"{body.name} has several joints", hint)
    joint = next(j for j in (model.joints if name else own) if not name or j.name == name)
    value = require_dimension(position, "angle" if joint.kind == "revolute" else "length")
    if not joint.lower - _TOLERANCE <= value <= joint.upper + _TOLERANCE:
        unit, factor = "rad" if joint.kind == "revolute" else "m", 1.0
        # Use the unit of the file.
        if unit == "rad" and "deg" in position.text:
            unit, factor = "deg", math.degrees(1.0)
        message = f"{position.text} is outside the limits of {body.name}.{joint.name}"
        hint = f"between {joint.lower * factor:g} {unit} and {joint.upper * factor:g} {unit}"
        raise InputError.at(where, message, hint)
    return {joint.name: _in_scene(body, joint.name, value)}


def closed_positions(model: ObjectModel) -> tuple[float, ...]:
    """Return the joint positions of state ``closed``, by default zero or the nearest limit."""
    closed = next((dict(s.positions) for s in model.states if s.name == "closed"), {})
    return tuple(closed.get(j.name, min(max(0.0, j.lower), j.upper)) for j in model.joints)


def joint_of(body: SceneObject, name: str) -> Joint:
    """Return the joint ``name``."""
    return next(joint for joint in body.joints if joint.name == name)


def _in_scene(body: SceneObject, joint: str, value: float) -> float:
    """Return a position in the scene: revolute joints of mirrored objects turn the other way."""
    turns = joint_of(body, joint).kind == "revolute"
    return -value + 0.0 if body.mirrored and turns else value
