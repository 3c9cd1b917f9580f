"""Which names of a layer are used: parameters and groups that nobody needs."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator
from typing import Any

from grammars.scenery.model import Name, Path, SceneryLayer
from grammars.text.diagnostics import Diagnostic, Severity


def unused_parameters(layer: SceneryLayer) -> list[Diagnostic]:
    """Return a warning for every parameter of a layer that none of its sentences names.

    No other layer can: parameters are those of their layer alone.
    """
    said = {found.text for found in values_in(layer.sentences) if isinstance(found, Name)}
    return [
        Diagnostic(
            parameter.where,
            f"no sentence of {layer.name} uses the parameter {parameter.name}",
            "leave it out, or write its name in place of a quantity",
            Severity.WARNING,
        )
        for parameter in layer.parameters
        if parameter.name not in said
    ]


def unused_groups(layer: SceneryLayer, others: Iterable[SceneryLayer] = ()) -> list[Diagnostic]:
    """Return a warning for every group of a layer that neither it nor one of ``others`` names.

    Layers with objects of their own are left out: their groups are an offer to whoever uses them.
    """
    if layer.instances:
        return []
    said = {
        found.object
        for user in (layer, *others)
        for found in values_in((user.sentences, user.settings, user.groups))
        if isinstance(found, Path)
    }
    return [
        Diagnostic(
            group.where,
            f"no sentence is about the group {group.name}",
            f"leave it out, or write every {group.name}",
            Severity.WARNING,
        )
        for group in layer.groups
        if group.name not in said
    ]


def values_in(part: Any) -> Iterator[Any]:
    """Yield every value that a part of a layer is made of."""
    if isinstance(part, tuple):
        for one in part:
            yield from values_in(one)
    elif dataclasses.is_dataclass(part):
        yield part
        for entry in dataclasses.fields(part):
            yield from values_in(getattr(part, entry.name))
