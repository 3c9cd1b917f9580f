"""Old ways of writing the published vocabulary, read as the current ones with a warning each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from grammars.jsonld._legacy_models import settle_models
from grammars.jsonld._nodes import Node, NodeGraph, Ref, Value
from grammars.jsonld.vocabulary import COORD, DYN, FP, KC_STATE, POLY, QUDT, UNIT, local_name

_OLD_HOST: Final = "https://hbrs-sesame.github.io/"
_HOST: Final = "https://secorolab.github.io/"
_MODELS: Final = f"{_HOST}metamodels/"
_FOLDERS: Final = {
    f"{_MODELS}floor-plan/floor-plan#": f"{_MODELS}floorplan/floorplan#",
    f"{_MODELS}floor-plan/": f"{_MODELS}floorplan/",
    f"{_MODELS}floor-plan#": f"{_MODELS}floorplan/floorplan#",
    f"{_MODELS}floorplan#": f"{_MODELS}floorplan/floorplan#",
    f"{_MODELS}object#": f"{_MODELS}floorplan/object#",
    f"{_MODELS}state#": f"{_MODELS}floorplan/state#",
    f"{_MODELS}polytope#": f"{_MODELS}geometry/polytope#",
}
_DYNAMICS: Final = DYN.replace("structural-entities", "coordinates")
_UNITS: Final = {
    "degrees": "DEG",
    "degree": "DEG",
    "radians": "RAD",
    "metres": "M",
    "meters": "M",
    "CM": "CentiM",
    "MM": "MilliM",
    "CentiMeter": "CentiM",
    "MilliMeter": "MilliM",
}
_YAW: Final = (COORD["theta"], POLY["theta"])


def replace_legacy_terms(nodes: NodeGraph) -> NodeGraph:
    """Return ``nodes`` with current names everywhere; every kind of drift is one warning.

    What earlier models said otherwise, or not at all, is read as current ones say it
    (:mod:`grammars.jsonld._legacy_models`).
    """
    nodes = rename_terms(nodes)
    settle_models(nodes)
    return nodes


def rename_terms(nodes: NodeGraph) -> NodeGraph:
    """Return ``nodes``, which may be one file of many, in words of the current vocabulary."""
    seen: dict[str, str] = {}
    # Looked at first: what is current, which is nearly everything, is not copied.
    if any(_is_old(word) for word in _words(nodes)):
        nodes = _renamed(nodes, seen)
    for node in nodes.by_id.values():
        for fix in _FIXES:
            said = fix(node)
            if said:
                seen.setdefault(said, node.id)
    for message, id in seen.items():
        nodes.add_warning(id, message, "read as its current form")
    return nodes


def _words(nodes: NodeGraph) -> set[str]:
    words: set[str] = set()
    for node in nodes.by_id.values():
        words.update(node.types, node.values)
        words.update(node.refs(QUDT["unit"]))
        words.update(node.refs(f"https{QUDT[''][4:]}unit"))
    return words


def _is_old(word: str) -> bool:
    return _current(word) != word


def _current(word: str) -> str:
    if word.startswith("https://qudt.org/"):
        word = f"http{word[5:]}"
    if word.startswith(_OLD_HOST):
        word = _HOST + word[len(_OLD_HOST) :]
    for old, new in _FOLDERS.items():
        if word.startswith(old):
            word = new + word[len(old) :]
            break
    if word.startswith(_DYNAMICS):
        word = DYN + word[len(_DYNAMICS) :]
    return word


def _renamed(nodes: NodeGraph, seen: dict[str, str]) -> NodeGraph:
    fresh = NodeGraph(places=nodes.places, diagnostics=nodes.diagnostics, relative=nodes.relative)

    def current(word: str, id: str) -> str:
        new = _current(word)
        if new != word:
            seen.setdefault(f'the namespace "{_namespace(word)}" is outdated', id)
        return new

    def value_of(value: Value, id: str) -> Value:
        if isinstance(value, Ref):
            return Ref(current(value, id))
        return value

    for node in nodes.by_id.values():
        mine = fresh.get(node.id)
        for kind in node.types:
            mine.add_type(current(kind, node.id))
        for predicate, values in node.values.items():
            name = current(predicate, node.id)
            for value in values:
                mine.add(name, value_of(value, node.id) if name == QUDT["unit"] else value)
    return fresh


def _namespace(word: str) -> str:
    return word[: len(word) - len(local_name(word))]


def _yaw(node: Node) -> str:
    for old in _YAW:
        if old in node.values:
            for value in node.values.pop(old):
                node.add(COORD["alpha"], value)
            return '"theta" is an outdated word for "alpha"'
    return ""


def _units(node: Node) -> str:
    units = node.values.get(QUDT["unit"])
    if not units:
        return ""
    said = ""
    for k, unit in enumerate(units):
        name = local_name(str(unit))
        if name in _UNITS and (unit != UNIT[name] or name in ("CM", "MM")):
            units[k] = Ref(UNIT[_UNITS[name]])
            said = f'"{name}" is no unit of QUDT'
    return said


def _quantity(node: Node) -> str:
    # comp-rob2b defines "value" only inside the type Quantity now; door files of 2023 lack the
    # type.
    if QUDT["value"] in node.values and QUDT["Quantity"] not in node.types:
        node.add_type(QUDT["Quantity"])
        if KC_STATE["of-joint"] in node.values:
            return 'the value of a joint needs the type "Quantity"; without, RDF tools drop it'
        return 'a value needs the type "Quantity"; without, RDF tools drop it'
    return ""


def _features(node: Node) -> str:
    if FP["feature"] in node.values:
        for value in node.values.pop(FP["feature"]):
            node.add(FP["features"], value)
        return '"feature" is in no published context; RDF tools drop the link to features'
    return ""


_FIXES: Final[tuple[Callable[[Node], str], ...]] = (_yaw, _units, _quantity, _features)
