"""Overrides: values that one file sets for dotted keys of another (``start.y``, ``laser.noise``).

A dotted key leads through mappings by key and through lists by the names of their items:
``waypoints.kitchen.x``. Overrides are checked like values of the file itself; messages point to
the override.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from grammars.text.diagnostics import Findings, InputError, Where, did_you_mean, raise_all
from grammars.text.documents import KeyPath, YamlDocument, leaves

_NAME_KEYS: Final = ("id", "name")
"""Keys that hold the name of a list item."""


@dataclass(frozen=True, slots=True)
class Override:
    """A value for a dotted key, in the form of the other file, and the place of the override."""

    key: str
    value: Any
    where: Where


def flatten_overrides(
    values: Mapping[str, Any], where: Callable[[KeyPath], Where]
) -> tuple[Override, ...]:
    """Return one override for each leaf of nested mappings; ``where`` maps a path to its place.

    ``{start: {y: 0.1}}`` and ``{start.y: 0.1}`` are the same.
    """
    return tuple(Override(".".join(path), value, where(path)) for path, value in leaves(values))


def override_document(document: YamlDocument, overrides: Iterable[Override]) -> YamlDocument:
    """Return a document with overridden values; missing values are added.

    Overridden values and the values around them take the places of the overrides. Raises
    :class:`InputError` with every key that leads nowhere; the model of the file checks whether a
    key is allowed.
    """
    data = copy.deepcopy(document.data)
    places = dict(document.places)
    findings = Findings()
    for override in overrides:
        with findings.collecting():
            for path in key_paths(data, override):
                _put(data, path, override.value)
                _move(places, path, override.where)
    raise_all(findings.all)
    return replace(document, data=data, places=places)


def key_paths(data: Any, override: Override) -> list[KeyPath]:
    """Return the paths to which the key of an override leads, even if they do not exist yet.

    List items of one name all match. Raises :class:`InputError` for a key that leads nowhere.
    """
    if not override.key:
        raise InputError.at(override.where, "a value without a key", "write KEY: VALUE")
    paths: list[KeyPath] = []
    open_ends: list[tuple[Any, KeyPath, str]] = [(data, (), override.key)]
    while open_ends:
        node, path, rest = open_ends.pop(0)
        if not rest:
            paths.append(path)
        elif isinstance(node, Mapping):
            key, rest = split_key(node, rest)
            open_ends.append((node.get(key), (*path, key), rest))
        elif node is None:
            key, _, rest = rest.partition(".")
            open_ends.append((None, (*path, key), rest))
        elif _is_named(node):
            names = item_names(node, str(path[-1]))
            name, rest = split_key(dict.fromkeys(names), rest)
            same = [index for index, other in enumerate(names) if other == name]
            if not same:
                message = f'{path[-1]} has no "{name}"'
                raise InputError.at(override.where, message, did_you_mean(name, names))
            open_ends += [(node[index], (*path, index), rest) for index in same]
        else:
            kind = "a list" if isinstance(node, list) else "one value"
            above = override.key.removesuffix(rest).rstrip(".")
            message = f'{above} is {kind}, it has no "{rest}"'
            raise InputError.at(override.where, message, f"write {above}: {node}")
    return paths


def placed_at(document: YamlDocument, where: Where) -> YamlDocument:
    """Return a document whose findings about the whole file are reported at ``where``."""
    return replace(document, places={**document.places, (): where})


def _is_named(data: Any) -> bool:
    return isinstance(data, list) and bool(data) and all(isinstance(i, Mapping) for i in data)


def item_names(items: Sequence[Mapping[str, Any]], key: str) -> list[str]:
    """Return the names of the items of a list below ``key``: ``waypoint-1`` without a name."""
    singular = key.removesuffix("s")
    return [
        next((str(item[k]) for k in _NAME_KEYS if item.get(k)), f"{singular}-{number}")
        for number, item in enumerate(items, start=1)
    ]


def split_key(names: Iterable[str], key: str, signs: str = ".") -> tuple[str, str]:
    """Return the first part of a key and the rest; known ``names`` may contain dots."""
    # The longest match counts: "a.b" and "a" may both be names.
    ends = [match.start() for match in re.finditer(f"[{re.escape(signs)}]", key)] + [len(key)]
    known_names = set(names)
    end = next((end for end in reversed(ends) if key[:end] in known_names), ends[0])
    return key[:end], key[end + 1 :]


def _put(data: Any, path: KeyPath, value: Any) -> None:
    for part in path[:-1]:
        if isinstance(part, str) and data.get(part) is None:
            data[part] = {}
        data = data[part]
    data[path[-1]] = copy.deepcopy(value)


def _move(places: dict[KeyPath, Where], path: KeyPath, where: Where) -> None:
    """Give a value and the values around it the place of the override."""
    for inside in [place for place in places if place[: len(path)] == path]:
        del places[inside]
    for length in range(1, len(path) + 1):
        places[path[:length]] = where
