"""Parameters and groups of a layer: values from campaigns, and warnings about unused ones."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final

from grammars.scenery.model import (
    Group,
    Parameter,
    Path,
    SceneryLayer,
    Subject,
    Word,
    parse_measure,
)
from grammars.text.diagnostics import (
    Finding,
    Findings,
    InputError,
    Severity,
    Where,
    did_you_mean,
)

_OBJECT: Final = re.compile(r"([^\d\W]\w*)(?:\.([^\d\W]\w*))?")


def configure(
    layer: SceneryLayer,
    overrides: Mapping[str, object],
    where: Where | None = None,
    places: Mapping[str, Where] | None = None,
) -> SceneryLayer:
    """Return ``layer`` with other parameter values and group members.

    ``overrides`` comes from a campaign: a quantity with its unit for a parameter (``"1.3 m"``),
    a name or a list of names for a group. ``where`` is their place in the campaign, ``places`` has
    the known places of single overrides. Raises :class:`InputError` with every invalid override.
    """
    if not overrides:
        return layer
    groups = {group.name: group for group in layer.groups}
    parameters = {parameter.name: parameter for parameter in layer.parameters}
    findings = Findings()
    for key, value in overrides.items():
        # Names in YAML may have dashes.
        name = str(key).replace("-", "_")
        place = (places or {}).get(str(key)) or where or Where(layer.file)
        with findings.collecting():
            if name in groups:
                groups[name] = _with_members(groups[name], value, place)
            elif name in parameters:
                parameters[name] = _with_value(parameters[name], value, place)
            else:
                hint = did_you_mean(name, (*groups, *parameters))
                findings.error(place, f'layer {layer.name} has no parameter "{key}"', hint)
    findings.raise_errors()
    return dataclasses.replace(
        layer, groups=tuple(groups.values()), parameters=tuple(parameters.values())
    )


def _with_members(group: Group, value: object, where: Where) -> Group:
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list | tuple) or not names:
        raise InputError.at(
            where, f"{group.name} is a group", f"write {group.name}: [door_1, door_2]"
        )
    paths = []
    for name in names:
        match = _OBJECT.fullmatch(name) if isinstance(name, str) else None
        if match is None:
            message = f'{group.name}: "{name}" is not the name of an object'
            raise InputError.at(where, message, "write names, such as door_1")
        paths.append(Path(match[1], match[2] or "", where))
    members = Subject(False, tuple(paths), (), where)
    return Group(group.name, members, where, text=f"group {group.name}: {members}")


def _with_value(parameter: Parameter, value: object, where: Where) -> Parameter:
    example = f"write {parameter.name}: {parameter.value.text}"
    if not isinstance(value, str | int | float) or isinstance(value, bool):
        raise InputError.at(where, f"{parameter.name} is a quantity", example)
    try:
        measure = parse_measure(str(value), where, parameter.value.dimension)
    except InputError as error:
        message = f"{parameter.name}: {error.findings[0].message}"
        raise InputError.at(where, message, example) from error
    text = f"parameter {parameter.name} = {measure}"
    return Parameter(parameter.name, measure, where, text=text)


def unused_parameters(layer: SceneryLayer) -> list[Finding]:
    """Return a warning for every parameter of a layer that none of its sentences uses.

    Other layers cannot use it.
    """
    used = {value.text for value in _values_in(layer.sentences) if isinstance(value, Word)}
    return [
        Finding(
            parameter.where,
            f"no sentence of {layer.name} uses the parameter {parameter.name}",
            "remove it, or write its name in place of a quantity",
            Severity.WARNING,
        )
        for parameter in layer.parameters
        if parameter.name not in used
    ]


def unused_groups(layer: SceneryLayer, others: Iterable[SceneryLayer] = ()) -> list[Finding]:
    """Return a warning for every group of a layer that neither it nor one of ``others`` uses.

    Layers with objects give no warnings: their groups are for users of the layer.
    """
    if layer.instances or not layer.groups:
        return []
    # The scenarios of a campaign share most of their layers.
    users = {id(user): user for user in (layer, *others)}.values()
    used = {
        value.object
        for user in users
        for value in _values_in((user.sentences, user.settings, user.groups))
        if isinstance(value, Path)
    }
    return [
        Finding(
            group.where,
            f"no sentence uses the group {group.name}",
            f"remove it, or write every {group.name}",
            Severity.WARNING,
        )
        for group in layer.groups
        if group.name not in used
    ]


def _values_in(part: Any) -> Iterator[Any]:
    """Yield all dataclass values inside a part of a layer."""
    if isinstance(part, tuple):
        for one in part:
            yield from _values_in(one)
    elif dataclasses.is_dataclass(part):
        yield part
        for entry in dataclasses.fields(part):
            yield from _values_in(getattr(part, entry.name))
