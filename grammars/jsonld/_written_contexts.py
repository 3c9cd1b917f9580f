"""The ``@context`` of what is written here: published contexts, and what their readers need beside.

Two habits of published tools are met. PyLD reads ten remote contexts a document by default, so the
smallest of those an object takes are written out. rdflib applies the terms of a node's first type
only, where the standard says those of all its types: terms that published contexts scope to a type
are therefore written out as well, with the same IRIs.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

from grammars.jsonld.vocabulary import (
    COORD,
    DYN,
    GEOM,
    GZB,
    ITEMS,
    KC,
    KC_STATE,
    OBJ,
    POLY,
    QUDT,
    ROB2B_CONTEXTS,
    SCN,
    SECORO_CONTEXTS,
    XSD,
    Namespace,
    rob2b,
    secoro,
)


def _references(namespace: Namespace, *names: str) -> dict[str, Any]:
    return {name: {"@id": namespace[name], "@type": "@id"} for name in names}


def _numbers(namespace: Namespace, *names: str) -> dict[str, Any]:
    return {name: {"@id": namespace[name], "@type": XSD["double"]} for name in names}


def _words(namespace: Namespace, *names: str) -> dict[str, Any]:
    return {name: namespace[name] for name in names}


_COORDINATES: Final = {
    **_references(COORD, "of-pose", "of-position", "as-seen-by"),
    **_numbers(COORD, "x", "y", "z"),
}
_OBJECTS: Final = {
    **_COORDINATES,
    # Of nodes with several types: published contexts may scope any of these to one of them.
    **_references(GEOM, "origin", "start", "vector-x", "vector-y", "vector-z", "simplices"),
    **_references(KC, "between-attachments", "common-axis"),
    **_references(OBJ, "link", "polytope", "object-frame", "object-links", "kinematic-chain"),
    **_numbers(POLY, "x-size", "y-size", "z-size"),
    **_references(DYN, "of-body"),
    **_numbers(DYN, "mass", "xx", "yy", "zz"),
    **_numbers(QUDT, "value"),
    **_words(KC_STATE, "JointReference", "JointPosition"),
    **_references(KC_STATE, "of-joint"),
    **_words(GZB, "GazeboLinkRepresentation", "material"),
    **_references(GZB, "visual", "collision", "inertia", "gz-link"),
}
_WRITTEN_OUT: Final = ("kinematic-chain/state.json", "simulation/gazebo.json")
# Objects stand in a plan without saying anything about its elements.
_OF_PLANS: Final = ("floorplan/floorplan.json", "qudt.json")


def plan_context(base: str, contexts: Iterable[str]) -> list[Any]:
    """Return the ``@context`` of a plan's file: its base and the published contexts."""
    addresses = list(contexts)
    written: list[Any] = [{"@base": base, "fpm": base}, *addresses]
    if rob2b("geometry/coordinates.json") in addresses:
        written.append(_COORDINATES)
    return written


def layer_context(plan: str) -> list[Any]:
    """Return the ``@context`` of objects and layers that stand in the plan with base ``plan``."""
    addresses = [
        rob2b(path)
        for path, ours in ROB2B_CONTEXTS.items()
        if ours != "dynamics.json" and path not in _WRITTEN_OUT
    ]
    addresses.append(rob2b("newtonian-rigid-body-dynamics.json"))
    addresses += [
        secoro(path) for path in SECORO_CONTEXTS if path not in (*_WRITTEN_OUT, *_OF_PLANS)
    ]
    return [*addresses, {"fpm": plan, "item": ITEMS, "scn": str(SCN), **_OBJECTS}]
