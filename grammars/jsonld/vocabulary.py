"""The published vocabulary: namespaces, a few words of our own, the contexts that define terms.

Contexts are read from this package, never from the network.
"""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import Any, Final

from grammars.text.diagnostics import did_you_mean

_ROB2B: Final = "https://comp-rob2b.github.io/metamodels/"
_SECORO: Final = "https://secorolab.github.io/metamodels/"


class Namespace(str):
    """An IRI that others start with: ``GEOM["vector-x"]`` is one of its terms."""

    __slots__ = ()

    def __getitem__(self, term: object) -> str:
        return f"{self!s}{term}"


GEOM: Final = Namespace(f"{_ROB2B}geometry/structural-entities#")
REL: Final = Namespace(f"{_ROB2B}geometry/spatial-relations#")
COORD: Final = Namespace(f"{_ROB2B}geometry/coordinates#")
KC: Final = Namespace(f"{_ROB2B}kinematic-chain/structural-entities#")
KC_STATE: Final = Namespace(f"{_ROB2B}kinematic-chain/state#")
DYN: Final = Namespace(f"{_ROB2B}newtonian-rigid-body-dynamics/structural-entities#")
POLY: Final = Namespace(f"{_SECORO}geometry/polytope#")
FP: Final = Namespace(f"{_SECORO}floorplan/floorplan#")
OBJ: Final = Namespace(f"{_SECORO}floorplan/object#")
ST: Final = Namespace(f"{_SECORO}floorplan/state#")
GZB: Final = Namespace(f"{_SECORO}gazebo#")
QUDT: Final = Namespace("http://qudt.org/schema/qudt/")
UNIT: Final = Namespace("http://qudt.org/vocab/unit/")
KIND: Final = Namespace("http://qudt.org/vocab/quantitykind/")
XSD: Final = Namespace("http://www.w3.org/2001/XMLSchema#")
RDF: Final = Namespace("http://www.w3.org/1999/02/22-rdf-syntax-ns#")
SCN: Final = Namespace("urn:scenario-tui:scenery#")
"""Our own words: what the published vocabulary has none for."""

UNKNOWN: Final = Namespace("urn:scenario-tui:unknown:")
"""Words that no context of a document defines, where the document has no address."""

PLANS: Final = f"{_SECORO.removesuffix('metamodels/')}models/floorplan/"
"""Where plans are identified: ``<PLANS><plan name>/<element>``."""
ITEMS: Final = "urn:scenario-tui:item:"
"""Where objects, their parts, groups and parameters of scenery layers are identified."""

ROB2B_CONTEXTS: Final = {
    "geometry/structural-entities.json": "structural-entities.json",
    "geometry/spatial-relations.json": "spatial-relations.json",
    "geometry/coordinates.json": "coordinates.json",
    "kinematic-chain/structural-entities.json": "kinematic-chain.json",
    "kinematic-chain/state.json": "joint-state.json",
    "newtonian-rigid-body-dynamics.json": "dynamics.json",
    "newtonian-rigid-body-dynamics/structural-entities.json": "dynamics.json",
    "newtonian-rigid-body-dynamics/coordinates.json": "dynamics.json",
    "qudt.json": "qudt.json",
}
"""Published context documents of comp-rob2b, by path, and ours with the same IRIs."""
SECORO_CONTEXTS: Final = {
    "geometry/coordinates.json": "coordinates-extension.json",
    "geometry/polytope.json": "polytope.json",
    "floorplan/floorplan.json": "floorplan.json",
    "floorplan/object.json": "object.json",
    "floorplan/state.json": "state.json",
    "simulation/gazebo.json": "gazebo.json",
    "qudt.json": "qudt.json",
}
"""Published context documents of secorolab, by path, and ours with the same IRIs."""


def rob2b(path: str) -> str:
    """Return the published address of a comp-rob2b context."""
    return _ROB2B + path


def secoro(path: str) -> str:
    """Return the published address of a secorolab context."""
    return _SECORO + path


def local_name(iri: str) -> str:
    """Return what follows the last ``/``, ``#`` or ``:``."""
    return iri.rsplit("/", 1)[-1].rsplit("#", 1)[-1].rsplit(":", 1)[-1]


def namespace_of(iri: str) -> str:
    """Return what is in front of the local name."""
    return iri[: len(iri) - len(local_name(iri))]


_FOLDER: Final = Path(__file__).with_name("contexts")


class ContextError(ValueError):
    """A context that cannot be used; the message is for people."""


def context_for(address: str, notes: set[str]) -> Any:
    """Return our context for a published address, whatever host and folder it had at the time."""
    path = address.partition("metamodels/")[2]
    drifted = (
        "/secorolab.github.io/" not in address and "/comp-rob2b.github.io/" not in address
    ) or path.startswith("floor-plan")
    if path in ("floor-plan.json", "floor-plan/floor-plan.json"):
        path = "floorplan/floorplan.json"
    path = path.replace("floor-plan/", "floorplan/")
    if path == "geometry/coordinate-extension.json":
        path, drifted = "geometry/coordinates.json", True
        name: str | None = SECORO_CONTEXTS[path]
    elif "comp-rob2b" in address:
        name = ROB2B_CONTEXTS.get(path)
    else:
        name = SECORO_CONTEXTS.get(path) or (ROB2B_CONTEXTS.get(path) if drifted else None)
    if name is None:
        known = (*ROB2B_CONTEXTS, *SECORO_CONTEXTS)
        hint = did_you_mean(path, known) if path else ""
        raise ContextError(
            f'the context "{address}" is not known here and nothing is fetched'
            + (f"; {hint}" if hint else "")
        )
    if drifted:
        notes.add(address)
    return _ours(name)


@functools.cache
def _contexts_by_type() -> dict[str, str]:
    """Return the address of the one published context that defines a type, by the type's name."""
    found: dict[str, set[str]] = {}
    published = {rob2b(path): name for path, name in ROB2B_CONTEXTS.items()}
    published |= {secoro(path): name for path, name in SECORO_CONTEXTS.items()}
    # Several addresses lead to one context of ours: the first of them names it.
    for name in dict.fromkeys(published.values()):
        address = next(key for key, value in published.items() if value == name)
        for term in _ours(name):
            if term[:1].isupper() or term[:1].isdigit():
                found.setdefault(term, set()).add(address)
    return {term: min(places) for term, places in found.items() if len(places) == 1}


def context_of_type(name: str) -> str:
    """Return the address of the published context that defines a type, or an empty text."""
    return _contexts_by_type().get(name, "")


@functools.cache
def _ours(name: str) -> Any:
    return json.loads((_FOLDER / name).read_text(encoding="utf-8"))["@context"]
