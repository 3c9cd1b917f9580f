"""Published vocabulary: namespaces, a few words of our own, and the contexts that define terms.

Contexts are read from this package, never from the network.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

from grammars.text.diagnostics import did_you_mean

_ROB2B: Final = "https://comp-rob2b.github.io/metamodels/"
_SECORO: Final = "https://secorolab.github.io/metamodels/"


class Namespace(str):
    """Common prefix of IRIs: ``GEOM["vector-x"]`` is one of its terms."""

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
XSD: Final = Namespace("http://www.w3.org/2001/XMLSchema#")
SCN: Final = Namespace("urn:scenario-tui:scenery#")
"""Our own terms, which the published vocabulary lacks."""

UNKNOWN: Final = Namespace("urn:scenario-tui:unknown:")
"""Terms that no context of a document defines."""

PLANS: Final = f"{_SECORO.removesuffix('metamodels/')}models/floorplan/"
"""Namespace of plans: ``<PLANS><plan name>/<element>``."""
ITEMS: Final = "urn:scenario-tui:item:"
"""Namespace of the objects, groups and parameters of scenery layers."""

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
    """Return the part after the last ``/``, ``#`` or ``:``."""
    return iri.rsplit("/", 1)[-1].rsplit("#", 1)[-1].rsplit(":", 1)[-1]


def namespace_of(iri: str) -> str:
    """Return the part in front of the local name."""
    return iri[: len(iri) - len(local_name(iri))]


_FOLDER: Final = Path(__file__).with_name("contexts")


class ContextError(ValueError):
    """Unusable context; people read the message."""


def context_for(address: str, notes: set[str]) -> Any:
    """Return our context for a published address; add a former address to ``notes``."""
    path = address.partition("metamodels/")[2]
    is_former = (
        "/secorolab.github.io/" not in address and "/comp-rob2b.github.io/" not in address
    ) or path.startswith("floor-plan")
    if path in ("floor-plan.json", "floor-plan/floor-plan.json"):
        path = "floorplan/floorplan.json"
    path = path.replace("floor-plan/", "floorplan/")
    if path == "geometry/coordinate-extension.json":
        path, is_former = "geometry/coordinates.json", True
        name: str | None = SECORO_CONTEXTS[path]
    elif "comp-rob2b" in address:
        name = ROB2B_CONTEXTS.get(path)
    else:
        name = SECORO_CONTEXTS.get(path) or (ROB2B_CONTEXTS.get(path) if is_former else None)
    if name is None:
        hint = did_you_mean(path, (*ROB2B_CONTEXTS, *SECORO_CONTEXTS)) if path else ""
        raise ContextError(
            f'the context "{address}" is unknown; contexts are not fetched'
            + (f"; {hint}" if hint else "")
        )
    if is_former:
        notes.add(address)
    return _ours(name)


@functools.cache
def contexts_by_type() -> dict[str, str]:
    """Return, by type, the address of the only published context that defines it."""
    addresses: dict[str, set[str]] = {}
    published = {rob2b(path): name for path, name in ROB2B_CONTEXTS.items()}
    published |= {secoro(path): name for path, name in SECORO_CONTEXTS.items()}
    # Several addresses may lead to one of our contexts: the first of them names it.
    for name in dict.fromkeys(published.values()):
        address = next(key for key, value in published.items() if value == name)
        for term in _ours(name):
            if term[:1].isupper() or term[:1].isdigit():
                addresses.setdefault(term, set()).add(address)
    return {term: min(places) for term, places in addresses.items() if len(places) == 1}


@functools.cache
def _ours(name: str) -> Any:
    return json.loads((_FOLDER / name).read_text(encoding="utf-8"))["@context"]


_COORDINATES: Final = {
    **{
        name: {"@id": COORD[name], "@type": "@id"}
        for name in ("of-pose", "of-position", "as-seen-by")
    },
    **{name: {"@id": COORD[name], "@type": XSD["double"]} for name in ("x", "y", "z")},
}
"""Unscoped terms of coordinates: rdflib applies the scoped terms of a node's first type only."""


def plan_context(base: str, contexts: Iterable[str]) -> list[Any]:
    """Return the ``@context`` of a plan's file: its base and the published contexts."""
    addresses = list(contexts)
    context: list[Any] = [{"@base": base, "fpm": base}, *addresses]
    if rob2b("geometry/coordinates.json") in addresses:
        context.append(_COORDINATES)
    return context


def plain_context(base: str) -> dict[str, Any]:
    """Return the ``@context`` of a graph in the plan with IRI ``base``: all terms, no address.

    PyLD reads at most ten remote contexts a document by default, and an object needs more.
    """
    return {"@base": base, "fpm": base, "item": ITEMS, "scn": str(SCN), **_published_terms()}


@functools.cache
def _published_terms() -> dict[str, Any]:
    addresses = [*map(rob2b, ROB2B_CONTEXTS), *map(secoro, SECORO_CONTEXTS)]
    contexts = [context_for(address, set()) for address in addresses]
    terms = [term for context in contexts for term in context.values() if isinstance(term, dict)]
    scoped = [term["@context"] for term in terms if "@context" in term]
    unscoped: dict[str, Any] = {}
    # A few terms have two meanings; the one without a scope or of a coordinate is written.
    for context in (*contexts, *scoped):
        for name, term in context.items():
            if isinstance(term, dict):
                term = {key: value for key, value in term.items() if key != "@context"}
            unscoped.setdefault(name, term)
    return unscoped
