"""Object layers with fewer objects in them: the statements of the original, copied."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

from daemon.blame._sentences import units_of
from grammars.diagnostics import Where
from grammars.documents import read_text
from grammars.movers import own_joints
from grammars.scene import Scene
from grammars.scenery import SceneryLayer


def reduced(layers: Sequence[SceneryLayer], names: Collection[str]) -> list[SceneryLayer]:
    """Return the layers with only the objects ``names`` and the models of these, if any are left.

    What objects do is left out, and so are groups and how they start: they would name objects
    that are not there. Parameters stay, they may place something.
    """
    used = {i.model.text for layer in layers for i in layer.instances if i.name in names}
    fewer = (
        dataclasses.replace(
            layer,
            models=tuple(model for model in layer.models if model.name in used),
            instances=tuple(i for i in layer.instances if i.name in names),
            groups=(),
            settings=(),
            sentences=(),
        )
        for layer in layers
    )
    return [layer for layer in fewer if layer.models or layer.instances]


def text_of(layer: SceneryLayer, whole: SceneryLayer) -> str:
    """Return the text of a reduced ``.scenery`` layer: the statements of the ``whole``, copied."""
    wanted = {_key(m.where) for m in layer.models} | {_key(p.where) for p in layer.parameters}
    wanted |= {_key(instance.where) for instance in layer.instances}
    parts = [
        part for where, part in _statements(whole, read_text(whole.file)) if _key(where) in wanted
    ]
    return "\n".join(parts) + "\n"


def _statements(layer: SceneryLayer, text: str) -> Iterator[tuple[Where, str]]:
    """Yield where each statement begins and its text, without the comments after it."""
    kinds = (
        layer.models, layer.instances, layer.groups, layer.parameters,
        layer.settings, layer.sentences,
    )  # fmt: skip
    places = sorted((value.where for values in kinds for value in values), key=_key)
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    offsets = [starts[w.line - 1] + w.column - 1 for w in places]
    for where, first, last in zip(places, offsets, (*offsets[1:], len(text)), strict=True):
        lines = text[first:last].rstrip().splitlines()
        while lines and lines[-1].lstrip().startswith("//"):
            lines.pop()
        yield where, "\n".join(lines).rstrip()


def _key(where: Where) -> tuple[int, int]:
    return where.line, where.column


def settings_text(wanted: Scene, plain: Scene) -> str:
    """Return the sentences that make the objects of ``plain`` start as those of ``wanted``."""
    lines, units = [], units_of(wanted)
    starting = {thing.name: thing for thing in plain.objects}
    for thing in wanted.objects:
        other = starting[thing.name]
        positions = dict(zip((j.name for j in thing.joints), thing.initial, strict=True))
        before = dict(zip((j.name for j in other.joints), other.initial, strict=True))
        for joint in own_joints(thing.joints):
            if positions[joint.name] != before[joint.name]:
                name = f"{thing.name}.{joint.name}"
                lines.append(f"{name} starts at {units[name].position(positions[joint.name])}")
        if thing.frozen and not other.frozen:
            lines.append(f"{thing.name} is frozen")
    return "".join(f"{line}\n" for line in lines)


def is_text(layer: SceneryLayer) -> bool:
    """Say whether a layer was written in the scenery language, not as JSON-LD."""
    return Path(layer.file).suffix != ".jsonld"
