"""How objects start and which are frozen, when a later layer says so."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

from grammars.composition.catalogue import Catalogue
from grammars.composition.positions import joint_positions
from grammars.diagnostics import Diagnostic, InputError
from grammars.scene import Scene, SceneObject
from grammars.scenery.model import SceneryLayer, Setting, Starts


def with_settings(
    layers: Sequence[SceneryLayer], catalogue: Catalogue, placed: Mapping[str, SceneObject]
) -> dict[str, SceneObject]:
    """Return the objects as the settings of all layers leave them; later layers win.

    Raises :class:`InputError` for unknown names, states and units.
    """
    objects = dict(placed)
    findings: list[Diagnostic] = []
    for layer in layers:
        for setting in layer.settings:
            try:
                for target in catalogue.targets(layer, setting.subject):
                    body = objects[target.object]
                    objects[body.name] = _with(catalogue, body, setting, target.joint)
            except InputError as error:
                findings.extend(error.diagnostics)
    if findings:
        raise InputError(findings)
    return objects


def _with(catalogue: Catalogue, body: SceneObject, setting: Setting, joint: str) -> SceneObject:
    if not isinstance(setting, Starts):
        return dataclasses.replace(body, frozen=True)
    initial = dict(zip((j.name for j in body.joints), body.initial, strict=True))
    model = catalogue.model_of(body.name)
    initial.update(joint_positions(body, model, setting.position, joint))
    return dataclasses.replace(body, initial=tuple(initial.values()))


def refuse_unapplied(scene: Scene, layers: Sequence[SceneryLayer], catalogue: Catalogue) -> None:
    """Raise for objects and settings in ``layers`` that ``scene`` was compiled without.

    What stands where and how it starts belongs to the scene; a layer that says so must take part
    in compiling it, or its words would be lost without notice.
    """
    bodies = {body.name: body for body in scene.objects}
    hint = "name this layer among the objects, not only among the behaviours"
    findings = [
        Diagnostic(i.where, f"{i.name} does not stand in the scene", hint)
        for i in catalogue.instances.values()
        if i.name not in bodies
    ]
    if not findings:
        wanted = with_settings(layers, catalogue, bodies)
        changed = {name for name, body in wanted.items() if body != bodies[name]}
        findings = [
            Diagnostic(setting.where, f"{target.object} is not so in the scene", hint)
            for layer in layers
            for setting in layer.settings
            for target in catalogue.targets(layer, setting.subject)
            if target.object in changed
        ]
    if findings:
        raise InputError(dict.fromkeys(findings))
