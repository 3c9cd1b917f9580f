"""Values that one file gives to keys of another, by dotted keys: ``start.y``, ``laser.noise``.

A key leads through mappings by their keys and through lists of named things by the names of these:
``waypoints.kitchen.x``. The values are checked like those of the file itself, and what is wrong
with them is told where they are written.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from grammars.text.diagnostics import Finding, InputError, Where, did_you_mean
from grammars.text.documents import KeyPath, YamlDocument, leaves

_NAME_KEYS: Final = ("id", "name")
"""Keys by which the items of a list are told apart."""


@dataclass(frozen=True, slots=True)
class Override:
    """A value for a dotted key, as it would be written there, and where it is written."""

    key: str
    value: Any
    where: Where


def flatten_overrides(
    values: Mapping[str, Any], where: Callable[[KeyPath], Where]
) -> tuple[Override, ...]:
    """Return one override for each value of nested mappings; ``where`` places the value at a path.

    ``{start: {y: 0.1}}`` and ``{start.y: 0.1}`` are the same.
    """
    return tuple(Override(".".join(path), value, where(path)) for path, value in leaves(values))


def override_document(document: YamlDocument, overrides: Iterable[Override]) -> YamlDocument:
    """Return a document with other values at some keys; a value that is not there is added.

    Places of what is changed, and of what it is in, are those of the overrides. Raises
    :class:`InputError` with every key that leads nowhere; whether the file may have a key is for
    its model to say.
    """
    data = copy.deepcopy(document.data)
    places = dict(document.places)
    findings: list[Finding] = []
    for override in overrides:
        try:
            for path in key_paths(data, override):
                _put(data, path, override.value)
                _move(places, path, override.where)
        except InputError as error:
            findings.extend(error.findings)
    if findings:
        raise InputError(findings)
    return replace(document, data=data, places=places)


def key_paths(data: Any, override: Override) -> list[KeyPath]:
    """Return the paths to which the key of an override leads, written there or not.

    Several items of one name are one thing. Raises :class:`InputError` for a key that leads
    nowhere.
    """
    if not override.key:
        raise InputError.at(override.where, "a value without a key", "write KEY: VALUE")
    found: list[KeyPath] = []
    open_ends: list[tuple[Any, KeyPath, str]] = [(data, (), override.key)]
    while open_ends:
        node, path, rest = open_ends.pop(0)
        if not rest:
            found.append(path)
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
    return found


def placed_at(document: YamlDocument, where: Where) -> YamlDocument:
    """Return a document of which that is told at ``where`` which is about it as a whole."""
    return replace(document, places={**document.places, (): where})


def _is_named(data: Any) -> bool:
    return isinstance(data, list) and bool(data) and all(isinstance(i, Mapping) for i in data)


def item_names(items: Sequence[Mapping[str, Any]], key: str) -> list[str]:
    """Return what the items of a list below ``key`` are called: ``waypoint-1`` without a name."""
    singular = key.removesuffix("s")
    return [
        next((str(item[k]) for k in _NAME_KEYS if item.get(k)), f"{singular}-{number}")
        for number, item in enumerate(items, start=1)
    ]


def split_key(known: Iterable[str], key: str, signs: str = ".") -> tuple[str, str]:
    """Return the first part of a key and the rest; names that are ``known`` may have dots."""
    # The longest first: "a.b" may be a name although "a" is one as well.
    ends = [match.start() for match in re.finditer(f"[{re.escape(signs)}]", key)] + [len(key)]
    names = set(known)
    end = next((end for end in reversed(ends) if key[:end] in names), ends[0])
    return key[:end], key[end + 1 :]


def _put(data: Any, path: KeyPath, value: Any) -> None:
    for part in path[:-1]:
        if isinstance(part, str) and data.get(part) is None:
            data[part] = {}
        data = data[part]
    data[path[-1]] = copy.deepcopy(value)


def _move(places: dict[KeyPath, Where], path: KeyPath, where: Where) -> None:
    """Put the places of a value and of what it is in where its override stands."""
    for inside in [place for place in places if place[: len(path)] == path]:
        del places[inside]
    for length in range(1, len(path) + 1):
        places[path[:length]] = where
