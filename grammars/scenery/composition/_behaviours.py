"""From sentences about objects to concrete behaviours of joints.

All random numbers are drawn here from a seed, so that a run specification is deterministic.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from grammars.model.behaviour import Behaviour, Walk
from grammars.model.scene import Scene, SceneObject
from grammars.scenery.composition._amounts import SentenceContext
from grammars.scenery.composition._catalogue import Catalogue
from grammars.scenery.composition._compiler import refuse_unapplied
from grammars.scenery.composition._sentences import SentenceResolver
from grammars.scenery.model import SceneryLayer, Sentence, Starts
from grammars.text.diagnostics import Finding, Findings, InputError, Severity, Where
from grammars.text.words import enumerate_words


@dataclass(frozen=True, slots=True)
class ResolvedBehaviours:
    """At most one behaviour per joint, in scene order, with warnings about sentences.

    The warnings are about sentences that a later layer replaced for some joints, that change
    nothing in this run, or that contradict the start of their layer. ``places`` has for every joint
    the place of the effective sentence.
    """

    behaviours: tuple[Behaviour, ...]
    warnings: tuple[Finding, ...] = ()
    places: tuple[tuple[str, Where], ...] = ()


@dataclass(frozen=True, slots=True)
class _AppliedSentence:
    layer: int
    where: Where
    behaviour: Behaviour


def resolve_behaviours(
    scene: Scene,
    layers: Sequence[SceneryLayer],
    *,
    seed: np.random.SeedSequence,
    limit: float,
) -> ResolvedBehaviours:
    """Return the behaviours of the joints of ``scene`` in a run of ``limit`` seconds.

    ``layers`` are all layers of the scenario in order, including those with the objects; later
    layers win on the same joint. Random numbers of a joint come from a child of ``seed`` that
    depends only on the name of the joint, so that another door does not change the others.

    Raises :class:`InputError` for unknown names, wrong units, positions outside joint limits, and
    two sentences of one layer about the same joint (with both places).
    """
    catalogue = Catalogue(layers)
    refuse_unapplied(scene, layers, catalogue)
    bodies = {body.name: body for body in scene.objects}
    frames = dict(scene.frames)
    applied: dict[str, _AppliedSentence] = {}
    overridden: dict[tuple[Where, Where], list[str]] = {}
    findings = Findings()
    initial = scene.initial_joints
    idle: list[Finding] = []
    for number, layer in enumerate(layers):
        context = SentenceContext(layer, seed, limit, frames)
        starts = (one for one in layer.settings if isinstance(one, Starts))
        begun = {t.object for one in starts for t in catalogue.targets(layer, one.subject)}
        begun |= {one.name for one in layer.instances if one.starts is not None}
        for sentence in layer.sentences:
            with findings.collecting():
                for behaviour in _behaviours(context, catalogue, bodies, sentence):
                    new = _AppliedSentence(number, sentence.where, behaviour)
                    old = applied.get(behaviour.joint)
                    if old is not None:
                        _refuse_second(old, new)
                        places = (new.where, old.where)
                        overridden.setdefault(places, []).append(_subject(behaviour))
                    # A walk moves all three joints of its mover.
                    applied.update(dict.fromkeys(_joints(behaviour), new))
                    start = None if isinstance(behaviour, Walk) else behaviour.start_position
                    is_begun = behaviour.joint.partition(".")[0] in begun
                    if is_begun and start not in (None, initial[behaviour.joint]):
                        message = f"{behaviour.joint} has two positions at 0 s in this layer"
                        context.warn(sentence.where, message)
        idle += context.warnings
    findings.raise_errors()
    # The specification of a run must not depend on the order of layers and sentences.
    effective = {one.where for one in applied.values()}
    order = [(joint, applied[joint]) for joint in scene.joint_names if joint in applied]
    return ResolvedBehaviours(
        tuple(one.behaviour for joint, one in order if one.behaviour.joint == joint),
        (
            *(_replaced(joints, *places) for places, joints in overridden.items()),
            *(one for one in dict.fromkeys(idle) if one.where in effective),
        ),
        tuple((joint, one.where) for joint, one in order),
    )


def _joints(behaviour: Behaviour) -> tuple[str, ...]:
    return behaviour.joints if isinstance(behaviour, Walk) else (behaviour.joint,)


def _subject(behaviour: Behaviour) -> str:
    return behaviour.object if isinstance(behaviour, Walk) else behaviour.joint


def _refuse_second(old: _AppliedSentence, new: _AppliedSentence) -> None:
    """Raise :class:`InputError` for two behaviours of one joint in the same layer."""
    if old.layer == new.layer:
        raise InputError.at(
            new.where,
            f"{_subject(new.behaviour)} already has a behaviour in this layer",
            f"the other one: {old.where}; remove one (every … except …)",
        )


_MOST_NAMES: Final = 3
"""Names in a message at most; the last one may be a count."""


def _replaced(joints: Sequence[str], new: Where, old: Where) -> Finding:
    names = list(joints[:_MOST_NAMES])
    if len(joints) > _MOST_NAMES:
        names[-1] = f"{len(joints) - _MOST_NAMES + 1} more"
    follow = "follow" if len(joints) > 1 else "follows"
    message = f"{enumerate_words(names)} {follow} this sentence, not the one at {old}"
    return Finding(new, message, severity=Severity.WARNING)


def _behaviours(
    context: SentenceContext,
    catalogue: Catalogue,
    bodies: Mapping[str, SceneObject],
    sentence: Sentence,
) -> list[Behaviour]:
    behaviours: list[Behaviour] = []
    for target in catalogue.targets(context.layer, sentence.subject):
        resolver = SentenceResolver(context, catalogue, bodies, target.object, target.joint)
        behaviours.extend(resolver.resolve(sentence))
    return behaviours
