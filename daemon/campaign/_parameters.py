"""Parameters in layers: every value by its path, with its place in a file.

A later layer changes the values that it names and keeps the others; ``null`` removes an inherited
value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeAlias

from grammars.text.diagnostics import Finding, InputError, Where
from grammars.text.documents import KeyPath, leaves, paths_inside
from grammars.text.ros_yaml import ParameterValue

ParameterPath: TypeAlias = tuple[str, ...]
ParameterValues: TypeAlias = dict[ParameterPath, ParameterValue]


def flatten_parameters(
    tree: Mapping[str, Any], where: Callable[[KeyPath], Where], *, namespaces: bool = False
) -> ParameterValues:
    """Return the settings of nested mappings; ``where`` places the value at a path of ``tree``.

    With ``namespaces`` a name such as ``move_base/global_costmap`` means two levels.
    """
    values: ParameterValues = {}
    above: set[ParameterPath] = set()
    for keys, value in leaves(tree):
        path = tuple(p for name in keys for p in name.split("/") if p) if namespaces else keys
        inside = {below: where((*keys, *below)) for below in paths_inside(value)}
        _put(values, above, path, ParameterValue(value, where(keys), inside=inside))
    return values


def under_namespace(settings: ParameterValues, namespace: ParameterPath) -> ParameterValues:
    """Return the settings moved below ``namespace``."""
    return {(*namespace, *path): setting for path, setting in settings.items()}


def merge_parameters(base: ParameterValues, over: ParameterValues) -> ParameterValues:
    """Return ``base`` changed by ``over``.

    Raises :class:`InputError` for a ``null`` without an inherited value.
    """
    # Check against the base, not the result: two lines of one file may each remove a value.
    result = dict(base)
    namespaces = _namespaces(base)
    for path, setting in over.items():
        if setting.value is None and not is_inherited(path, base):
            message = f"{path[-1]}: null removes an inherited value, but there is none"
            raise InputError(Finding(setting.where, message, "write a value or leave it out"))
        _put(result, namespaces, path, setting)
        if setting.value is None:
            del result[path]
    return result


def is_inherited(path: ParameterPath, base: ParameterValues) -> bool:
    """Return whether there is a value at ``path``, above it or below it."""
    return any(_shares(path, old) for old in base)


def _namespaces(paths: Iterable[ParameterPath]) -> set[ParameterPath]:
    """Return every beginning of the paths."""
    return {path[:length] for path in paths for length in range(1, len(path))}


def _put(
    settings: ParameterValues,
    namespaces: set[ParameterPath],
    path: ParameterPath,
    setting: ParameterValue,
) -> None:
    """Set one value in place of any value at its path, above it or below it.

    ``namespaces`` contain at least those of the settings: a search through all settings for each
    value would take minutes for the largest files.
    """
    below: list[ParameterPath] = []
    if path in namespaces:
        below = [old for old in settings if len(old) > len(path) and _shares(old, path)]
    # An empty mapping in a file removes no values below it.
    if setting.value == {} and below:
        return
    above = [path[:length] for length in range(1, len(path)) if path[:length] in settings]
    for old in (*above, *below):
        del settings[old]
    settings[path] = setting
    namespaces |= _namespaces([path])


def _shares(one: ParameterPath, other: ParameterPath) -> bool:
    """Return whether one path is the beginning of the other."""
    shorter = min(len(one), len(other))
    return one[:shorter] == other[:shorter]


def parameter_tree(settings: ParameterValues) -> dict[str, Any]:
    """Return settings as nested dicts in alphabetical order.

    The digest of a run then does not depend on the order of lines in files.
    """
    tree: dict[str, Any] = {}
    for path, setting in sorted(settings.items(), key=lambda item: item[0]):
        node = tree
        for name in path[:-1]:
            node = node.setdefault(name, {})
        node[path[-1]] = setting.value
    return tree


def parameter_place(settings: ParameterValues, path: tuple[str | int, ...]) -> Where | None:
    """Return the place of the value at ``path``, otherwise of the nearest one above or below."""
    first_index = next((i for i, part in enumerate(path) if isinstance(part, int)), len(path))
    names = tuple(part for part in path[:first_index] if isinstance(part, str))
    for length in range(len(names), 0, -1):
        prefix = names[:length]
        if prefix in settings:
            return _nearest(settings[prefix], path[length:])
        inside = [s.where for p, s in settings.items() if p[:length] == prefix]
        if inside:
            return inside[0]
    return None


def _nearest(setting: ParameterValue, below: KeyPath) -> Where:
    """Return the place of the item at ``below`` in a list, or of the nearest one around it."""
    for length in range(len(below), 0, -1):
        if below[:length] in setting.inside:
            return setting.inside[below[:length]]
    return setting.where
