"""From sentences about objects to concrete behaviours of joints.

Everything random is drawn here, once, from a seed: what a run specification then says is exactly
what the doors do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from grammars.model.behaviour import Behaviour, Walk
from grammars.model.scene import Scene, SceneObject
from grammars.scenery._parameters import configure
from grammars.scenery.composition._amounts import SentenceContext
from grammars.scenery.composition._catalogue import Catalogue
from grammars.scenery.composition._compiler import refuse_unapplied
from grammars.scenery.composition._sentences import SentenceResolver
from grammars.scenery.model import SceneryLayer, Sentence
from grammars.text.diagnostics import (
    Finding,
    Findings,
    InputError,
    Severity,
    Where,
    did_you_mean,
)
from grammars.text.words import enumerate_words


@dataclass(frozen=True, slots=True)
class ResolvedBehaviours:
    """One behaviour per joint at most, in scene order, and who gave way to whom.

    ``overridden`` has one warning for each sentence that a later layer replaced for some joints.
    ``places`` gives for every joint the place of the sentence that won.
    """

    behaviours: tuple[Behaviour, ...]
    overridden: tuple[Finding, ...] = ()
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
    overrides: Mapping[str, Mapping[str, object]] | None = None,
) -> ResolvedBehaviours:
    """Return what the joints of ``scene`` do in a run of ``limit`` seconds.

    ``layers`` are all layers of the scenario, those with the objects included, in order; later
    layers win on the same joint. ``overrides`` gives by layer name the values a campaign wants
    (see :func:`grammars.scenery.configure`). Random toggles are drawn from a child of ``seed`` per
    joint that depends on nothing but the joint's name, so another door changes none of the others.

    Raises :class:`InputError` for unknown names, wrong units, positions outside of joint limits,
    and two sentences of one layer about the same joint (both places are named).
    """
    layers = _configured(layers, overrides or {})
    catalogue = Catalogue(layers)
    refuse_unapplied(scene, layers, catalogue)
    bodies = {body.name: body for body in scene.objects}
    frames = dict(scene.frames)
    said: dict[str, _AppliedSentence] = {}
    overridden: dict[tuple[Where, Where], list[str]] = {}
    findings = Findings()
    for number, layer in enumerate(layers):
        context = SentenceContext(layer, seed, limit, frames)
        for sentence in layer.sentences:
            with findings.collecting():
                for behaviour in _behaviours(context, catalogue, bodies, sentence):
                    new = _AppliedSentence(number, sentence.where, behaviour)
                    old = said.get(behaviour.joint)
                    if old is not None:
                        _refuse_second(old, new)
                        places = (new.where, old.where)
                        overridden.setdefault(places, []).append(_subject(behaviour))
                    # A walk moves all three joints of its mover: one place for all of them.
                    said.update(dict.fromkeys(_joints(behaviour), new))
    findings.raise_errors()
    # In scene order: the order of layers and sentences must not show in the specification of a run.
    order = [joint for joint in scene.joint_names if joint in said]
    return ResolvedBehaviours(
        tuple(said[joint].behaviour for joint in order if said[joint].behaviour.joint == joint),
        tuple(_replaced(joints, *places) for places, joints in overridden.items()),
        tuple((joint, said[joint].where) for joint in order),
    )


def _joints(behaviour: Behaviour) -> tuple[str, ...]:
    return behaviour.joints if isinstance(behaviour, Walk) else (behaviour.joint,)


def _configured(
    layers: Sequence[SceneryLayer], overrides: Mapping[str, Mapping[str, object]]
) -> list[SceneryLayer]:
    names = [layer.name for layer in layers]
    for name in overrides:
        if name not in names:
            hint = did_you_mean(name, names)
            raise InputError.at(Where(name), f'there is no layer "{name}"', hint)
    return [configure(layer, overrides.get(layer.name, {})) for layer in layers]


def _subject(behaviour: Behaviour) -> str:
    return behaviour.object if isinstance(behaviour, Walk) else behaviour.joint


def _refuse_second(old: _AppliedSentence, new: _AppliedSentence) -> None:
    """Raise :class:`InputError` when one layer says two things of one joint."""
    if old.layer == new.layer:
        raise InputError.at(
            new.where,
            f"{_subject(new.behaviour)} already has a behaviour in this layer",
            f"the other one: {old.where}; leave one out (every … except …)",
        )


_MOST_NAMED: Final = 3
"""So many joints are named, of more how many they are."""


def _replaced(joints: Sequence[str], new: Where, old: Where) -> Finding:
    named = list(joints[:_MOST_NAMED])
    if len(joints) > _MOST_NAMED:
        named[-1] = f"{len(joints) - _MOST_NAMED + 1} more"
    follow = "follow" if len(joints) > 1 else "follows"
    message = f"{enumerate_words(named)} {follow} this sentence, not the one at {old}"
    return Finding(new, message, severity=Severity.WARNING)


def _behaviours(
    context: SentenceContext,
    catalogue: Catalogue,
    bodies: Mapping[str, SceneObject],
    sentence: Sentence,
) -> list[Behaviour]:
    found: list[Behaviour] = []
    for target in catalogue.targets(context.layer, sentence.subject):
        resolver = SentenceResolver(context, catalogue, bodies, target.object, target.joint)
        found.extend(resolver.resolve(sentence))
    return found
