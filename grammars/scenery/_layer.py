"""From the text of a ``.scenery`` file to a :class:`SceneryLayer`, and a campaign's overrides."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path as FilePath
from typing import Final, TypeAlias

from grammars.scenery._reader import NodeReader
from grammars.scenery._syntax import parse_tree
from grammars.scenery.measure import parse_measure, require_dimension
from grammars.scenery.model import (
    Group,
    Instance,
    ObjectModel,
    Parameter,
    Path,
    SceneryLayer,
    Sentence,
    Setting,
    Statement,
    Subject,
)
from grammars.text.diagnostics import (
    Diagnostic,
    InputError,
    SourceText,
    SyntaxNode,
    Where,
    did_you_mean,
)
from grammars.text.sources import read_text

_Part: TypeAlias = ObjectModel | Instance | Group | Parameter | Setting | Sentence
_SPACE: Final = re.compile(r'("[^"\n]*")|(?:\s|//[^\n]*)+')
"""What is between words, and names in quotes, which keep theirs."""
_OBJECT: Final = re.compile(r"([^\d\W]\w*)(?:\.([^\d\W]\w*))?")


def load_scenery(path: str | FilePath) -> SceneryLayer:
    """Read a ``.scenery`` file; raises :class:`InputError` with every problem found in it."""
    return parse_scenery(read_text(path), str(path))


def parse_scenery(text: str, file: str, within: Where | None = None) -> SceneryLayer:
    """Read the text of a layer; ``file`` is the name used in messages, its stem names the layer.

    ``within`` is the place of a text that is part of another file. Raises :class:`InputError` with
    every problem found (of a syntax error only the first).
    """
    source = SourceText(text, file, within=within)
    reader = NodeReader(source)
    tree = parse_tree(source)
    nodes = getattr(tree, "statements", ())  # an empty text gives no tree
    values: list[_Part] = reader.read_all(nodes, partial(_read, reader, source))
    _check_names(reader, values)
    if reader.diagnostics:
        raise InputError(sorted(reader.diagnostics, key=lambda d: (d.where.line, d.where.column)))
    return SceneryLayer(
        name=FilePath(file).name.removesuffix(".scenery"),
        file=file,
        models=tuple(v for v in values if isinstance(v, ObjectModel)),
        instances=tuple(v for v in values if isinstance(v, Instance)),
        groups=tuple(v for v in values if isinstance(v, Group)),
        parameters=tuple(v for v in values if isinstance(v, Parameter)),
        settings=tuple(v for v in values if isinstance(v, Setting)),
        sentences=tuple(v for v in values if isinstance(v, Sentence)),
    )


def _read(reader: NodeReader, source: SourceText, node: SyntaxNode) -> _Part:
    part: _Part = node.read(reader)
    if not isinstance(part, Statement):
        return part
    written = source.text[node._tx_position : node._tx_position_end]
    return replace(part, text=_SPACE.sub(lambda space: space[1] or " ", written))


def _check_names(reader: NodeReader, values: Sequence[_Part]) -> None:
    seen: dict[str, Where] = {}
    for value in values:
        if not isinstance(value, ObjectModel | Instance | Group | Parameter):
            continue
        if value.name in seen:
            hint = f"first used at {seen[value.name]}"
            reader.report(value.where, f'the name "{value.name}" is taken', hint)
        seen.setdefault(value.name, value.where)


def configure(
    layer: SceneryLayer,
    overrides: Mapping[str, object],
    where: Where | None = None,
    places: Mapping[str, Where] | None = None,
) -> SceneryLayer:
    """Return ``layer`` with other parameter values and group members.

    ``overrides`` is what a campaign says: a quantity with its unit for a parameter (``"1.3 m"``),
    a name or a list of names for a group. ``where`` is the place in the campaign, for messages,
    and ``places`` that of each of them, where it is known.
    Raises :class:`InputError` with every override that does not fit.
    """
    if not overrides:
        return layer
    groups = {group.name: group for group in layer.groups}
    parameters = {parameter.name: parameter for parameter in layer.parameters}
    findings: list[Diagnostic] = []
    for key, value in overrides.items():
        # Campaigns are YAML, where names are written with dashes.
        name = str(key).replace("-", "_")
        place = (places or {}).get(str(key)) or where or Where(layer.file)
        try:
            if name in groups:
                groups[name] = _regrouped(groups[name], value, place)
            elif name in parameters:
                parameters[name] = _changed(parameters[name], value, place)
            else:
                hint = did_you_mean(name, (*groups, *parameters))
                findings.append(
                    Diagnostic(place, f'layer {layer.name} has no parameter "{key}"', hint)
                )
        except InputError as error:
            findings.extend(error.diagnostics)
    if findings:
        raise InputError(findings)
    return replace(layer, groups=tuple(groups.values()), parameters=tuple(parameters.values()))


def _regrouped(group: Group, value: object, where: Where) -> Group:
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


def _changed(parameter: Parameter, value: object, where: Where) -> Parameter:
    if not isinstance(value, str | int | float) or isinstance(value, bool):
        raise InputError.at(
            where,
            f"{parameter.name} is a quantity",
            f"write {parameter.name}: {parameter.value.text}",
        )
    given = parse_measure(str(value), where)
    try:
        require_dimension(given, parameter.value.dimension)
    except InputError as error:
        raise InputError.at(
            where,
            f"{parameter.name}: {error.diagnostics[0].message}",
            f"write {parameter.name}: {parameter.value.text}",
        ) from error
    text = f"parameter {parameter.name} = {given}"
    return Parameter(parameter.name, given, where, text=text)
