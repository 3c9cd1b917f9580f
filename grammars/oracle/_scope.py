"""Binding oracles to a scene: the doors they speak of must be there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from grammars.diagnostics import Diagnostic, did_you_mean
from grammars.mission import Mission
from grammars.oracle._model import (
    Amount,
    Arithmetic,
    Comparison,
    Expression,
    Function,
    Logic,
    Not,
    Number,
    Oracle,
    Reached,
    Signal,
    Statistic,
    Temporal,
)
from grammars.oracle._vocabulary import SIGNALS
from grammars.scene import Joint, Scene, SceneObject


@dataclass(frozen=True, slots=True)
class JointReference:
    """A joint of a scene object, named by an object signal."""

    object: SceneObject
    joint: Joint


def object_signals(scene: Scene) -> dict[str, JointReference]:
    """Return the signals of scenery objects in ``scene`` and the joint each one reads."""
    found: dict[str, JointReference] = {}
    for item in scene.objects:
        for joint in item.joints:
            position = "angle" if joint.kind == "revolute" else "position"
            prefixes = [f"{item.name}.{joint.name}"]
            if len(item.joints) == 1:
                prefixes.append(item.name)
            for prefix in prefixes:
                found[f"{prefix}.{position}"] = JointReference(item, joint)
                found[f"{prefix}.distance"] = JointReference(item, joint)
    return found


def check_scene(oracle: Oracle, scene: Scene, mission: Mission) -> tuple[Diagnostic, ...]:
    """Return what ``oracle`` speaks of that is not in ``scene`` or ``mission``."""
    known = object_signals(scene)
    found = [
        Diagnostic(
            oracle.place(signal.column),
            f'no "{signal.name}" in scene "{scene.name}"',
            did_you_mean(signal.name, known),
        )
        for signal in signals_of(oracle)
        if signal.name not in SIGNALS and signal.name not in known
    ]
    if isinstance(oracle.judgement, Reached) and not mission.waypoints:
        found.append(Diagnostic(oracle.where, f'mission "{mission.name}" has no waypoints'))
    return tuple(found)


def signals_of(oracle: Oracle) -> Iterator[Signal]:
    """Yield every signal the oracle reads, in the order written."""
    match oracle.judgement:
        case Temporal() | Amount():
            yield from _walk(oracle.judgement.predicate)
        case Statistic():
            yield from _walk(oracle.judgement.signal)
        case Reached():
            pass
    if oracle.guard is not None:
        yield from _walk(oracle.guard)


def _walk(expression: Expression) -> Iterator[Signal]:
    match expression:
        case Signal():
            yield expression
        case Number():
            pass
        case Not() | Function():
            yield from _walk(expression.operand)
        case Comparison() | Arithmetic():
            yield from _walk(expression.left)
            yield from _walk(expression.right)
        case Logic():
            for operand in expression.operands:
                yield from _walk(operand)
